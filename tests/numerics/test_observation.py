"""The likelihood: matrix products against plain loops, integrals against sums, evidence laws."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.numerics.observation import CORRELATION_M, evidence, sample_weight
from app.numerics.offsets import OffsetPrior, offset_db, offset_gain
from app.numerics.posterior import RESIDUAL, WEIGHT
from app.numerics.query import ask
from app.numerics.stretches import whole_roads
from tests.numerics import plain
from tests.numerics.tiny import as_laid, map_of, tiny_models, window_along

ALIKE = np.zeros(3, dtype=np.intp)  # cells of one carrier

residuals = st.floats(-60.0, 60.0)
strengths = st.floats(0.01, 20.0)
spreads = st.floats(0.3, 9.0)


def scored(index, window):
    """Every grid position of every road and direction with its score, residual and weight."""
    places = whole_roads(index, ask(index, window))
    keys = [
        (number, sign, place)
        for number, road in enumerate(index.roads)
        for sign in (1, -1)
        for place in range(road.grid_size)
    ]
    assert places.where.T.tolist() == [[number, sign] for number, sign, _ in keys]
    return places, keys


@pytest.mark.parametrize(
    ("seed", "sign", "extra", "step_m"),
    [
        (1, 1, (), 1.0),
        (2, -1, (), 1.0),
        (3, 1, ("a", "nowhere"), 1.0),
        (4, -1, ("e", "d"), 1.0),
        (5, 1, ("e",), 2.0),
    ],
)
def test_scores_are_the_literal_log_likelihood(seed, sign, extra, step_m):
    """At every place, both ways: cells heard, unheard, unmapped, foreign, and beyond the ends."""
    models = tiny_models(10 * seed, step_m=step_m)
    index = map_of(models)
    window = window_along(models[seed % 2], seed, sign=sign, extra=extra)
    found = plain.readings(window, set(index.cells), as_laid(models))
    places, keys = scored(index, window)
    sd_db = index.calibration.offset_sd_db
    laid = as_laid(models)
    expected = [
        plain.marginal(laid[number], found, place, way, sd_db)[0] for number, way, place in keys
    ]
    np.testing.assert_allclose(places.score, expected, atol=2e-3, rtol=2e-5)


def test_residual_and_weight_are_the_derivatives():
    """The two other channels are the log likelihood's slope and curvature in the offset."""
    models = tiny_models(60)
    index = map_of(models)
    window = window_along(models[0], 6)
    found = plain.readings(window, set(index.cells), as_laid(models))
    places, keys = scored(index, window)
    laid = as_laid(models)
    for column, (number, sign, place) in enumerate(keys):
        low, here, high = (
            plain.log_likelihood(laid[number], found, place, sign, b) for b in (-1.0, 0.0, 1.0)
        )
        residual, weight = places.values[RESIDUAL, column], places.values[WEIGHT, column]
        assert residual == pytest.approx((high - low) / 2.0, abs=1e-3)
        assert weight == pytest.approx(2.0 * here - high - low, abs=1e-3)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(residual=residuals, weight=strengths, sd_db=spreads)
def test_marginalising_the_offset_is_an_integral(residual, weight, sd_db):
    """What the offset adds equals the log of the prior's integral, by numerical quadrature."""
    offset = plain.OFFSETS_DB
    log = residual * offset - 0.5 * weight * offset**2
    mass = np.exp(log - log.max()) * plain.offset_prior(sd_db)
    expected = np.log(mass.sum() * (offset[1] - offset[0])) + log.max()
    mean_db = (mass * offset).sum() / mass.sum()
    prior = OffsetPrior.learnt(sd_db)
    found = offset_gain(np.array([residual]), np.array([weight]), prior)[0]
    inside = mass[0] + mass[-1] < 1e-9 * mass.max()  # else the integral runs beyond its table
    if inside:
        assert found == pytest.approx(expected, abs=1e-6, rel=1e-6)
        assert offset_db(residual, weight, prior) == pytest.approx(mean_db, abs=1e-4, rel=1e-4)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(residual=residuals, weight=strengths, sd_db=spreads)
def test_offset_is_between_none_and_the_best(residual, weight, sd_db):
    """The offset's mean is shrunk towards 0 from the one that fits best, and has its sign."""
    found = offset_db(residual, weight, OffsetPrior.learnt(sd_db))
    assert abs(found) <= abs(residual / weight) + 1e-9
    assert found * residual >= 0.0
    assert offset_db(-residual, weight, OffsetPrior.learnt(sd_db)) == pytest.approx(-found)


def test_many_readings_settle_the_offset():
    """With much weight the offset is the mean residual, whatever the prior."""
    for sd_db, true_db in product((0.5, 2.0), (-5.0, 0.0, 5.0)):
        found = offset_db(true_db * 50.0, 50.0, OffsetPrior.learnt(sd_db))
        assert found == pytest.approx(true_db, abs=0.5)


def test_standing_samples_are_one():
    """A hundred readings of one place count as one: their mean, and the share that heard."""
    rng = np.random.default_rng(71)
    moving_m = np.arange(0.0, 20.0, 4.0)
    stood = rng.normal(-90.0, 3.0, (100, 2))
    stood[::4, 1] = np.nan
    rsrp_dbm = np.vstack([rng.normal(-90.0, 3.0, (5, 2)), stood])
    seen = evidence(np.concatenate([moving_m, np.full(100, 20.0)]), rsrp_dbm, 1.0, ALIKE[:2])
    np.testing.assert_allclose(seen.behind_m, [0.0, 4.0, 8.0, 12.0, 16.0, 20.0])
    np.testing.assert_allclose(seen.rsrp_db[0] - 95.0, np.nanmean(stood, axis=0))
    np.testing.assert_allclose(seen.heard[0], [1.0, 0.75])
    np.testing.assert_allclose(seen.rsrp_db[1:] - 95.0, rsrp_dbm[4::-1])


def test_standing_longer_says_no_more():
    """The same place read again and again has the weight of one reading."""
    distance_m = np.concatenate([np.arange(0.0, 20.0, 4.0), np.full(100, 20.0)])
    rsrp_dbm = np.full((105, 1), -88.0)
    long = evidence(distance_m, rsrp_dbm, 1.0, ALIKE[:1])
    short = evidence(distance_m[:6], rsrp_dbm[:6], 1.0, ALIKE[:1])
    for name in ("behind_m", "rsrp_db", "heard", "share", "weight"):
        np.testing.assert_allclose(getattr(long, name), getattr(short, name))


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_order_within_a_metre_moves_nothing(seed):
    """Samples of one metre in another order are the same evidence."""
    rng = np.random.default_rng(seed)
    distance_m = np.repeat(np.arange(6.0), 5)
    rsrp_dbm = np.round(rng.normal(-90.0, 5.0, (30, 3)))
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.3] = np.nan
    order = np.concatenate([5 * metre + rng.permutation(5) for metre in range(6)])
    there = evidence(distance_m, rsrp_dbm, 1.0, ALIKE)
    turned = evidence(distance_m, rsrp_dbm[order], 1.0, ALIKE)
    for name in ("behind_m", "rsrp_db", "heard", "share", "weight"):
        np.testing.assert_allclose(getattr(turned, name), getattr(there, name), atol=1e-12)


def test_any_origin_of_distance_will_do():
    """Travelled distance counts from anywhere: a trip meter at 4096 m gives the same evidence."""
    distance_m = np.array([0.0, 0.25, 3.5, 9.75, 20.0])
    rsrp_dbm = np.full((5, 1), -90.0)
    there = evidence(distance_m, rsrp_dbm, 1.0, ALIKE[:1])
    moved = evidence(distance_m + 4096.0, rsrp_dbm, 1.0, ALIKE[:1])
    np.testing.assert_array_equal(moved.behind_m, there.behind_m)
    np.testing.assert_array_equal(moved.weight, there.weight)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(gaps_m=st.lists(st.floats(0.5, 40.0), min_size=1, max_size=40))
def test_weights_are_shares_of_the_correlation_length(gaps_m):
    """Close samples share one correlation length between them, far ones count in full."""
    behind_m = np.concatenate([[0.0], np.cumsum(gaps_m)])
    weight = sample_weight(behind_m)
    assert np.all((weight > 0.0) & (weight <= 1.0))
    ends_m = (gaps_m[0] + gaps_m[-1]) / 2.0
    assert weight.sum() <= (behind_m[-1] + ends_m) / CORRELATION_M + 1e-9
    if min(gaps_m) >= CORRELATION_M:
        np.testing.assert_array_equal(weight, 1.0)


def test_twice_the_rate_says_no_more():
    """Samples every metre weigh together what samples every two metres do."""
    fine, coarse = sample_weight(np.arange(0.0, 101.0)), sample_weight(np.arange(0.0, 101.0, 2.0))
    assert fine.sum() == pytest.approx(coarse.sum(), rel=0.02)
