"""The five kinds of feature (the paper's section II-B): closed forms, definitions, gaps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.domain import FEATURE_KINDS
from app.numerics.features import (
    feature_matrix,
    mean_dbm,
    mean_difference_db,
    mean_gradient_db_per_m,
    range_db,
    variance_db2,
)

readings = arrays(np.int64, (9, 3), elements=st.integers(-140, -44))


def gaps(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(seed).random(shape) < 0.3


def test_slope_of_a_straight_line_is_its_end_to_end_gradient():
    """On straight lines the slope is Eq. (1) averaged: last less first over the length."""
    distance_m = np.array([0.0, 0.7, 3.0, 3.1, 8.0, 20.0])
    slopes = np.array([0.25, -1.5, 0.0])
    rsrp_dbm = -90.0 + distance_m[:, None] * slopes
    expected = (rsrp_dbm[-1] - rsrp_dbm[0]) / (distance_m[-1] - distance_m[0])
    np.testing.assert_allclose(
        mean_gradient_db_per_m(rsrp_dbm, distance_m), expected, rtol=1e-9, atol=1e-12
    )


def test_gradients_of_eq_1_average_to_it_on_a_straight_line():
    """The mean of Eq. (1) over even steps equals the slope, too."""
    rsrp_dbm = -80.0 - 0.3 * np.arange(12.0)[:, None] * 2.0
    gradients = np.diff(rsrp_dbm, axis=0) / 2.0
    slope = mean_gradient_db_per_m(rsrp_dbm, np.arange(12.0) * 2.0)
    np.testing.assert_allclose(slope, gradients.mean(axis=0), rtol=1e-9)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(rsrp=readings, seed=st.integers(0, 1000))
def test_slope_is_the_line_of_least_squares(rsrp, seed):
    """Slopes are those of a least-squares line through the samples that heard the cell."""
    rng = np.random.default_rng(seed)
    distance_m = np.cumsum(rng.uniform(0.1, 5.0, len(rsrp)))
    rsrp_dbm = np.where(gaps(seed, rsrp.shape), np.nan, rsrp)
    found = mean_gradient_db_per_m(rsrp_dbm, distance_m)
    for cell, column in enumerate(rsrp_dbm.T):
        heard = ~np.isnan(column)
        if heard.sum() < 2:
            assert np.isnan(found[cell])
        else:
            slope = np.polyfit(distance_m[heard], column[heard], 1)[0]
            assert found[cell] == pytest.approx(slope, rel=1e-6, abs=1e-8)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(rsrp=readings, seed=st.integers(0, 1000))
def test_features_are_numpys_own_where_heard(rsrp, seed):
    """Mean, variance, difference and range are those of the readings there are."""
    rsrp_dbm = np.where(gaps(seed, rsrp.shape), np.nan, rsrp)
    rsrp_dbm[0] = rsrp[0]  # heard at least once
    np.testing.assert_allclose(mean_dbm(rsrp_dbm), np.nanmean(rsrp_dbm, axis=0))
    np.testing.assert_allclose(variance_db2(rsrp_dbm), np.nanvar(rsrp_dbm, axis=0), atol=1e-9)
    difference_db = np.nanmean(rsrp_dbm - rsrp_dbm[:, [1]], axis=0)
    np.testing.assert_allclose(mean_difference_db(rsrp_dbm, 1), difference_db, atol=1e-12)
    extent_db = np.nanmax(rsrp_dbm, axis=0) - np.nanmin(rsrp_dbm, axis=0)
    np.testing.assert_array_equal(range_db(rsrp_dbm), extent_db)


def test_closed_form_of_a_ramp():
    """Of -100, -99 ... -90 dBm a metre apart: 1 dB/m, -95 dBm, 10 dB^2, 10 dB."""
    rsrp_dbm = np.arange(-100.0, -89.0)[:, None]
    found = feature_matrix(rsrp_dbm, np.arange(11.0), 0)[:, 0]
    np.testing.assert_allclose(found, [1.0, -95.0, 10.0, 0.0, 10.0])


def test_rows_are_in_the_order_of_the_kinds():
    """Eq. (3): each row of the matrix is the kind that `FEATURE_KINDS` says."""
    rng = np.random.default_rng(11)
    rsrp_dbm, distance_m = rng.uniform(-120, -60, (30, 4)), np.arange(30.0)
    by_name = {
        "mean_gradient": mean_gradient_db_per_m(rsrp_dbm, distance_m),
        "mean": mean_dbm(rsrp_dbm),
        "variance": variance_db2(rsrp_dbm),
        "mean_difference": mean_difference_db(rsrp_dbm, 2),
        "range": range_db(rsrp_dbm),
    }
    matrix = feature_matrix(rsrp_dbm, distance_m, 2)
    np.testing.assert_array_equal(matrix, np.stack([by_name[kind] for kind in FEATURE_KINDS]))
    assert matrix[3, 2] == 0.0


def test_a_cell_never_heard_has_no_feature():
    """A column of NaN gives five NaN and leaves the other columns alone, without a warning."""
    rng = np.random.default_rng(12)
    rsrp_dbm = rng.uniform(-120, -60, (20, 2))
    with_silent = np.column_stack([rsrp_dbm, np.full(20, np.nan)])
    matrix = feature_matrix(with_silent, np.arange(20.0), 0)
    assert np.isnan(matrix[:, 2]).all()
    np.testing.assert_array_equal(matrix[:, :2], feature_matrix(rsrp_dbm, np.arange(20.0), 0))


def test_one_place_has_no_slope():
    """Readings of one distance have a mean and a range, and no slope."""
    matrix = feature_matrix(np.array([[-90.0], [-86.0]]), np.array([5.0, 5.0]), 0)
    assert np.isnan(matrix[0, 0])
    np.testing.assert_array_equal(matrix[1:, 0], [-88.0, 4.0, 0.0, 4.0])


def test_difference_counts_samples_that_heard_both():
    """A cell and a reference that are never heard together have no difference, Eq. (2)."""
    nan = np.nan
    rsrp_dbm = np.array([[-80.0, -90.0, nan], [nan, -70.0, -60.0], [-84.0, -91.0, nan]])
    np.testing.assert_array_equal(mean_difference_db(rsrp_dbm, 0), [0.0, -8.5, nan])


def test_a_common_offset_moves_the_mean_alone():
    """An offset of 5 dB on all cells adds 5 to the mean and nothing to the other kinds."""
    rng = np.random.default_rng(13)
    rsrp_dbm, distance_m = rng.uniform(-120, -60, (25, 3)), np.arange(25.0)
    moved = feature_matrix(rsrp_dbm + 5.0, distance_m, 0) - feature_matrix(rsrp_dbm, distance_m, 0)
    expected = np.zeros((5, 3))
    expected[1] = 5.0
    np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_driving_back_turns_the_slope_alone():
    """The same samples met in the other order have the opposite slope and all else alike."""
    rng = np.random.default_rng(14)
    rsrp_dbm, distance_m = rng.uniform(-120, -60, (25, 3)), np.sort(rng.uniform(0, 40, 25))
    there = feature_matrix(rsrp_dbm, distance_m, 0)
    back = feature_matrix(rsrp_dbm[::-1], distance_m[-1] - distance_m[::-1], 0)
    np.testing.assert_allclose(back[0], -there[0], rtol=1e-9)
    np.testing.assert_allclose(back[1:], there[1:], rtol=1e-9, atol=1e-12)
