"""The shadowing has the law it claims, and agrees where roads meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.scenario import build_city, preset
from app.evaluation.scenario.build import GRID_STEP_M
from app.evaluation.scenario.shadowing import autoregressive, bridge, crossing_factor


@pytest.mark.parametrize("rho", [0.0, 1e-4, 0.5, 0.98, 0.9999])
def test_blockwise_recursion_equals_the_plain_one(rho):
    """The cumulative sums give what the recursion gives, sample by sample."""
    innovation = np.random.default_rng(1).normal(size=(3000, 2))
    plain = innovation.copy()
    for i in range(1, len(plain)):
        plain[i] = rho * plain[i - 1] + np.sqrt(1 - rho**2) * innovation[i]
    np.testing.assert_allclose(autoregressive(innovation, rho), plain, atol=1e-9)


def test_autocorrelation_falls_as_gudmundson_says():
    """Over many independent draws the correlation at distance d is exp(-d / l), the variance 1."""
    correlation_m, step_m = 12.0, 0.25
    white = np.random.default_rng(2).normal(size=(401, 4000))
    field = autoregressive(white, np.exp(-step_m / correlation_m))
    for lag in (0, 4, 24, 48, 96, 200):
        products = field[: len(field) - lag] * field[lag:]
        expected = np.exp(-lag * step_m / correlation_m)
        assert np.mean(products) == pytest.approx(expected, abs=0.02)


def test_bridged_roads_keep_their_law():
    """With ends drawn from their joint law the bridge leaves all correlations as they were."""
    correlation_m, step_m, fields = 12.0, 1.0, 20_000
    rng = np.random.default_rng(3)
    steps = 31
    factor = crossing_factor(np.array([0.0, 30.0]), np.zeros(2), correlation_m)
    ends = factor @ rng.normal(size=(2, fields))
    free = autoregressive(rng.normal(size=(steps, fields)), np.exp(-step_m / correlation_m))
    field = bridge(free, ends[0], ends[1], step_m, correlation_m)
    np.testing.assert_allclose(field[[0, -1]], ends, atol=1e-12)
    at_m = np.arange(steps) * step_m
    expected = np.exp(-np.abs(at_m[:, None] - at_m) / correlation_m)
    np.testing.assert_allclose(field @ field.T / fields, expected, atol=0.05)


def test_city_field_has_the_scenarios_correlation():
    """Means of many seeds, less the median loss, correlate along a road as the scenario says."""
    scenario = preset("clean")
    flat = replace(scenario, shadowing_los_db=0.0, shadowing_nlos_db=0.0)
    median_dbm = build_city(flat, 0).roads[0].survey_dbm
    draws = [build_city(scenario, seed).roads[0].survey_dbm - median_dbm for seed in range(60)]
    field = np.stack(draws) / np.std(draws, axis=(0, 1))
    lag = int(scenario.shadowing_correlation_m / GRID_STEP_M)
    products = field[:, :-lag] * field[:, lag:]
    assert np.mean(products) == pytest.approx(np.exp(-1.0), abs=0.08)


def test_roads_agree_where_they_meet():
    """At a shared corner both roads have the same shadowing of every cell."""
    flat = replace(preset("clean"), shadowing_los_db=0.0, shadowing_nlos_db=0.0)
    even = replace(flat, shadowing_los_db=5.0, shadowing_nlos_db=5.0)
    shadow = [
        one.survey_dbm - other.survey_dbm
        for one, other in zip(build_city(even, 4).roads, build_city(flat, 4).roads, strict=True)
    ]
    for here, following in zip(shadow, [*shadow[1:], shadow[0]], strict=True):
        np.testing.assert_allclose(here[-1], following[0], atol=1e-9)
        assert np.std(here) > 3.0
