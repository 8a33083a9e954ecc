"""The Cramer-Rao bound: its closed forms, and that a best estimator reaches it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.bound import MEAN_ABSOLUTE, information_per_m2, least_sd_m
from app.evaluation.scenario import build_city, preset

SEED = 11


def test_a_single_slope_gives_noise_over_slope():
    """One reading of slope g and noise sigma: a standard deviation of sigma / g."""
    assert information_per_m2(np.array([[0.5]]), 2.0) == pytest.approx((0.5 / 2.0) ** 2)


def test_rounding_adds_a_twelfth_of_its_square():
    """Steps of 1 dB are noise of variance 1/12 dB^2."""
    plain = information_per_m2(np.array([[0.5, 0.2]]), np.sqrt(4.0 + 1.0 / 12.0))
    assert information_per_m2(np.array([[0.5, 0.2]]), 2.0, 1.0) == pytest.approx(plain)


def test_readings_add_up():
    """Twice the readings are twice the information; a cell not heard adds none."""
    slope = np.array([[0.5, np.nan], [0.1, 0.3]])
    once, twice = information_per_m2(slope, 2.0), information_per_m2(np.vstack([slope] * 2), 2.0)
    assert twice == pytest.approx(2.0 * once)
    assert once == pytest.approx((0.25 + 0.01 + 0.09) / 4.0)


def test_an_unknown_offset_hides_what_all_cells_do_alike():
    """With a free offset equal slopes say nothing; opposite ones lose nothing."""
    alike, opposite = np.array([[0.5, 0.5]]), np.array([[0.5, -0.5]])
    assert information_per_m2(alike, 2.0, 0.0, 1e6) == pytest.approx(0.0, abs=1e-6)
    assert information_per_m2(opposite, 2.0, 0.0, 1e6) == pytest.approx(0.125)


def test_maximum_likelihood_reaches_the_bound_where_noise_is_small():
    """Monte Carlo: the error's spread is the bound's within its own sampling error."""
    noise_db, draws = 0.05, 2000
    scenario = replace(preset("paper"), noise_db=noise_db, quantisation_db=0.0)
    truth = build_city(scenario, SEED).roads[1]
    rng = np.random.default_rng(SEED)
    # In the middle of a piece of the true mean, so that its slope is that of the neighbourhood.
    piece_m = truth.length_m / (len(truth.drive_dbm) - 1)
    chainage_m = (np.arange(500, 530) + 0.5) * piece_m
    least_m = least_sd_m(truth, chainage_m, scenario)
    shifts_m = np.linspace(-0.1, 0.1, 401)
    curves = np.stack([truth.mean_dbm(chainage_m + shift) for shift in shifts_m])
    mean = truth.mean_dbm(chainage_m)
    errors_m = []
    for _ in range(draws):
        reading = mean + noise_db * rng.normal(size=mean.shape)
        errors_m.append(shifts_m[((curves - reading) ** 2).sum(axis=(1, 2)).argmin()])
    assert least_m < 0.02
    assert np.std(errors_m) == pytest.approx(least_m, rel=4.0 / np.sqrt(2 * draws) + 0.02)
    assert np.mean(np.abs(errors_m)) == pytest.approx(MEAN_ABSOLUTE * least_m, rel=0.08)


def test_more_cells_never_raise_the_bound():
    """A cell can be ignored."""
    at_m = np.arange(100.0, 131.0)
    bounds = [
        least_sd_m(
            build_city(replace(preset("paper"), cells=k), SEED).roads[0], at_m, preset("paper")
        )
        for k in range(1, 7)
    ]
    assert bounds == sorted(bounds, reverse=True)
