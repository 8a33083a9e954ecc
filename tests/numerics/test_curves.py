"""P-splines: what they reproduce, what they solve, how they choose their strength and doubt."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from app.numerics.curves import (
    DEGREE,
    LEAST_NOISE_DB,
    MAX_LEVERAGE,
    RIDGE,
    STRENGTHS,
    Basis,
    fit_curves,
)

LENGTH_M = 200.0
GRID_M = np.arange(0.0, LENGTH_M + 0.5)
SPACING_M = 1.0


def wave(chainage_m: np.ndarray, cells: int = 2) -> np.ndarray:
    """Smooth levels, some 20 dB up and down over 120 m."""
    return -90.0 + 10.0 * np.sin(chainage_m[:, None] / 20.0 + np.arange(cells))


def readings(seed: int, noise_db: float, cells: int = 2, count: int = 201):
    """Chainages and noisy levels, in driving order."""
    rng = np.random.default_rng(seed)
    chainage_m = np.sort(rng.uniform(0.0, LENGTH_M, count))
    return chainage_m, wave(chainage_m, cells) + rng.normal(0, noise_db, (count, cells))


def dense_solution(chainage_m, column, strength):
    """The penalised normal equations of one cell, written out as full matrices."""
    basis = Basis.over(LENGTH_M, SPACING_M)
    heard = ~np.isnan(column)
    design = BSpline.design_matrix(chainage_m[heard], basis.knots_m, DEGREE).toarray()
    difference = np.diff(np.eye(basis.size), axis=0)
    level_dbm = np.median(column[heard])
    matrix = design.T @ design + strength * difference.T @ difference + RIDGE * np.eye(basis.size)
    right = design.T @ (column[heard] - level_dbm)
    coefficients = np.linalg.solve(matrix, right)
    misfit = np.sum((column[heard] - level_dbm) ** 2) - coefficients @ right
    return matrix, coefficients, level_dbm, misfit


@settings(derandomize=True, deadline=None, max_examples=20)
@given(seed=st.integers(0, 1000), strength=st.sampled_from(STRENGTHS))
def test_coefficients_solve_the_dense_normal_equations(seed, strength):
    """The banded solution is that of the full matrices, with gaps in the readings."""
    chainage_m, rsrp_dbm = readings(seed, 2.0)
    rsrp_dbm[np.random.default_rng(seed).random(rsrp_dbm.shape) < 0.3] = np.nan
    fitted = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M, strength)
    for cell, column in enumerate(rsrp_dbm.T):
        _, coefficients, level_dbm, _ = dense_solution(chainage_m, column, strength)
        np.testing.assert_allclose(
            fitted.coefficients_dbm[:, cell], coefficients + level_dbm, atol=1e-6
        )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_strength_is_the_most_likely_of_those_offered(seed):
    """The restricted likelihood, written with full matrices, is largest at the chosen strength."""
    chainage_m, rsrp_dbm = readings(seed, 2.0)
    count = rsrp_dbm.size

    def deviance(strength):
        parts = [dense_solution(chainage_m, column, strength) for column in rsrp_dbm.T]
        misfit = sum(part[3] for part in parts)
        determinant = sum(np.linalg.slogdet(part[0])[1] for part in parts)
        rank = sum(len(part[0]) - 1 for part in parts)
        return count * np.log(misfit / count) + determinant - rank * np.log(strength)

    fitted = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M)
    assert fitted.strength == min(STRENGTHS, key=deviance)


def test_noisier_readings_are_smoothed_more():
    """The chosen strength never falls as noise grows, and does rise."""
    strengths = [
        fit_curves(*readings(4, noise_db), GRID_M, SPACING_M).strength
        for noise_db in (0.0, 0.5, 2.0, 6.0, 15.0)
    ]
    assert strengths == sorted(strengths)
    assert strengths[0] == STRENGTHS[0]
    assert strengths[-1] > 10 * strengths[0]


@settings(derandomize=True, deadline=None, max_examples=25)
@given(level_dbm=st.floats(-140.0, -44.0), strength=st.sampled_from((*STRENGTHS, None)))
def test_a_constant_is_reproduced(level_dbm, strength):
    """Of constant readings the curve is that constant everywhere, whatever the strength."""
    rsrp_dbm = np.full((30, 1), level_dbm)
    fitted = fit_curves(np.linspace(50.0, 80.0, 30), rsrp_dbm, GRID_M, SPACING_M, strength or 1.0)
    np.testing.assert_allclose(fitted.mean_dbm, level_dbm, atol=1e-9)


def test_a_straight_line_is_reproduced():
    """Between the ends, a straight line of readings is the curve within 0.02 dB."""
    chainage_m = np.arange(0.0, LENGTH_M, 1.0)
    rsrp_dbm = (-70.0 - 0.2 * chainage_m)[:, None]
    fitted = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M)
    inner = (GRID_M > 10.0) & (GRID_M < LENGTH_M - 10.0)
    np.testing.assert_allclose(fitted.mean_dbm[inner, 0], -70.0 - 0.2 * GRID_M[inner], atol=0.02)


def test_zero_noise_gives_back_the_truth():
    """Smooth levels without noise are met within 0.05 dB, at the very ends within 0.15 dB."""
    chainage_m = np.arange(0.0, LENGTH_M + 0.5)
    fitted = fit_curves(chainage_m, wave(chainage_m), GRID_M, SPACING_M)
    np.testing.assert_allclose(fitted.mean_dbm[3:-3], wave(GRID_M)[3:-3], atol=0.05)
    np.testing.assert_allclose(fitted.mean_dbm, wave(GRID_M), atol=0.15)
    assert fitted.noise_db.max() < 0.2


@pytest.mark.parametrize("noise_db", [1.0, 2.0, 4.0])
def test_noise_is_found(noise_db):
    """The noise that a curve reports is that of the readings, within a sixth."""
    chainage_m, rsrp_dbm = readings(5, noise_db, cells=4, count=800)
    fitted = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M)
    np.testing.assert_allclose(fitted.noise_db, noise_db, rtol=1 / 6)


def test_smoothing_beats_the_readings():
    """The curve of noisy readings is nearer to the truth than half the noise."""
    fitted = fit_curves(*readings(6, 2.0), GRID_M, SPACING_M)
    assert np.sqrt(np.mean((fitted.mean_dbm - wave(GRID_M)) ** 2)) < 1.0


def test_spread_grows_in_gaps():
    """Where no sample was taken the spread grows with the distance from the nearest, to a bound."""
    chainage_m, rsrp_dbm = readings(7, 2.0, count=400)
    kept = (chainage_m < 80.0) | (chainage_m > 140.0)
    fitted = fit_curves(chainage_m[kept], rsrp_dbm[kept], GRID_M, SPACING_M)
    middle, edge, inside = fitted.spread_db[110], fitted.spread_db[88], fitted.spread_db[40]
    assert np.all(middle > edge)
    assert np.all(edge > inside)
    assert np.all(middle > 1.3 * inside)
    assert np.all(fitted.spread_db <= fitted.noise_db * np.sqrt(1.0 + MAX_LEVERAGE) + 1e-9)
    assert np.all(fitted.spread_db >= fitted.noise_db)


def test_spread_is_that_of_a_new_reading():
    """Held-out readings divided by the spread have unit variance, within a tenth."""
    chainage_m, rsrp_dbm = readings(8, 2.0, cells=6, count=1200)
    fitted = fit_curves(chainage_m[::2], rsrp_dbm[::2], GRID_M, SPACING_M)
    at = np.rint(chainage_m[1::2]).astype(int)
    mean_dbm = fitted.basis.at(chainage_m[1::2]).times(fitted.coefficients_dbm)
    score = (rsrp_dbm[1::2] - mean_dbm) / fitted.spread_db[at]
    assert score.std() == pytest.approx(1.0, abs=0.1)


def test_scipy_evaluates_the_coefficients_to_the_mean():
    """Knots and coefficients are a `scipy.interpolate.BSpline` whose values are ``mean_dbm``."""
    fitted = fit_curves(*readings(9, 2.0, cells=3), GRID_M, SPACING_M)
    spline = BSpline(fitted.basis.knots_m, fitted.coefficients_dbm, DEGREE)
    inside = GRID_M < LENGTH_M
    np.testing.assert_allclose(spline(GRID_M[inside]), fitted.mean_dbm[inside], atol=1e-9)
    at_the_end = spline(np.nextafter(LENGTH_M, 0.0))
    np.testing.assert_allclose(fitted.mean_dbm[-1], at_the_end, atol=1e-9)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(length_m=st.floats(0.5, 900.0), spacing_m=st.floats(1.0, 9.0))
def test_a_basis_covers_its_road_and_sums_to_one(length_m, spacing_m):
    """At every chainage the two splines that are not zero sum to 1; past an end, that end's."""
    basis = Basis.over(length_m, spacing_m)
    weights = basis.at(np.linspace(-5.0, length_m + 5.0, 57))
    np.testing.assert_allclose(weights.value.sum(axis=1), 1.0, atol=1e-9)
    assert weights.first.min() >= 0
    assert weights.first.max() + DEGREE < basis.size
    ends = basis.at(np.array([-5.0, 0.0])).times(np.arange(float(basis.size)))
    assert ends[0] == ends[1]


def test_order_of_samples_moves_nothing():
    """Samples in another order give the same curves, to the last digits of a sum."""
    chainage_m, rsrp_dbm = readings(10, 2.0)
    order = np.random.default_rng(10).permutation(len(chainage_m))
    there = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M)
    turned = fit_curves(chainage_m[order], rsrp_dbm[order], GRID_M, SPACING_M)
    assert turned.strength == there.strength
    np.testing.assert_allclose(turned.mean_dbm, there.mean_dbm, atol=1e-9)


def test_cells_are_fitted_each_for_itself():
    """With the strength given, a cell's curve does not depend on the other cells."""
    chainage_m, rsrp_dbm = readings(11, 2.0, cells=3)
    together = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M, 1.0)
    alone = fit_curves(chainage_m, rsrp_dbm[:, [1]], GRID_M, SPACING_M, 1.0)
    np.testing.assert_array_equal(together.coefficients_dbm[:, 1], alone.coefficients_dbm[:, 0])


def test_few_readings_borrow_the_roads_noise():
    """A cell read twice does not claim to be exact: its noise leans on the other cells'."""
    chainage_m, rsrp_dbm = readings(12, 3.0, cells=4)
    rsrp_dbm[2:, 3] = np.nan
    noise_db = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M).noise_db
    assert noise_db[3] > 0.5 * noise_db[:3].mean()


def test_a_cell_never_heard_is_flat():
    """A column of NaN gives a flat curve and touches no other."""
    chainage_m, rsrp_dbm = readings(13, 2.0)
    silent = np.column_stack([rsrp_dbm, np.full(len(rsrp_dbm), np.nan)])
    there = fit_curves(chainage_m, rsrp_dbm, GRID_M, SPACING_M, 1.0)
    found = fit_curves(chainage_m, silent, GRID_M, SPACING_M, 1.0)
    np.testing.assert_array_equal(found.mean_dbm[:, :2], there.mean_dbm)
    assert np.ptp(found.mean_dbm[:, 2]) == 0.0
    assert np.isfinite(found.spread_db).all()


@pytest.mark.filterwarnings("error")
def test_levels_that_never_move_are_not_taken_to_be_exact():
    """Of constant levels the curve is flat, and its spread is that of a receiver's steps."""
    chainage_m = np.linspace(0.0, LENGTH_M, 80)
    fitted = fit_curves(chainage_m, np.full((80, 2), -90.0), GRID_M, SPACING_M)
    np.testing.assert_allclose(fitted.mean_dbm, -90.0, atol=1e-9)
    assert np.all(fitted.spread_db >= LEAST_NOISE_DB)
