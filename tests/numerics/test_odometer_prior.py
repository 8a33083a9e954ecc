"""Factors that odometers may be off by: how likely each is, and how close to one another."""

from __future__ import annotations

import numpy as np
import pytest

from app.numerics import odometer_prior
from app.numerics.odometer_prior import (
    FEWEST_STEPS,
    MOST_STEPS,
    factors_for,
    fine_factors,
    rough_factors,
    scale_sd_of,
)

ANY = fine_factors(None, FEWEST_STEPS)


@pytest.mark.parametrize("error", [None, 0.01, 0.1])
@pytest.mark.parametrize("steps", [2, 5, 12])
def test_factors_are_balanced(error, steps):
    """Of either list: 1 is likelier than said, the mean is 1; of two the spread is right, too."""
    prior = odometer_prior
    err = 1.0 if error is not None else prior.ERR + prior.ERR_FAR
    for looked in (rough_factors(error), fine_factors(error, steps)):
        factors = looked.every
        middle = 1.0 / (1.0 + np.exp(factors.log_prior).sum())
        share = middle * np.exp(factors.log_prior)
        assert middle > 1.0 - err
        assert share @ (factors.value - 1.0) == pytest.approx(0.0, abs=1e-12)
    two = rough_factors(error).near
    share = np.exp(two.log_prior - two.together)
    spread = np.sqrt(share @ (two.value - 1.0) ** 2)
    rough = 1.0 if error is not None else prior.ROUGH_ERR
    assert spread == pytest.approx(scale_sd_of(error) * np.sqrt(rough))


def test_factors_are_no_farther_apart_than_an_unknown_odometer_s():
    """However far an odometer may err: between two factors a narrow peak would be lost."""
    step = np.diff(np.append(ANY.near.value, 1.0)).max()
    for error in (0.01, 0.03, 0.05, 0.1):
        looked = factors_for(error, 3.0, 0.02)
        assert looked is not None
        value = np.sort(np.append(looked.near.value, 1.0))
        assert value[-1] - 1.0 == pytest.approx(1.8 * error)
        assert np.diff(value).max() <= step + 1e-12


def test_the_longer_a_window_and_the_narrower_its_peak_the_closer_factors_are():
    """They move the oldest sample by two widths of the peak at most, half a metre at least."""
    for length_m, width_m in ((30.0, 0.1), (100.0, 0.1), (100.0, 0.5), (60.0, 1.0)):
        looked = factors_for(None, length_m, width_m)
        assert looked is not None
        assert looked.farther is not None
        low, high = looked.farther
        for near in (looked.near.value, np.concatenate((low.value, looked.near.value, high.value))):
            value = np.sort(np.append(near, 1.0))
            np.testing.assert_allclose(np.diff(value), value[1] - value[0], rtol=1e-9)
        assert (value[1] - value[0]) * length_m <= max(2.0 * width_m, 0.5) + 1e-9
        assert value[0] == pytest.approx(1.0 - 3.6 * 0.03)
    every = factors_for(None, 4_000.0, 0.1)
    assert every is not None
    assert len(every.near.value) == 2 * MOST_STEPS
