"""Windows that stray further than the surveys' did: of noisier devices, or where much drifted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.scenario import windows
from app.numerics.answer import _of_noise
from app.numerics.geodesy import distance_m as apart_m
from app.numerics.matching import locate, place
from app.numerics.posterior import SCORE, Known
from app.numerics.query import ask
from app.numerics.this_road import DRIFT_TIMES, MUCH, NOISE_TIMES, NOISIER, Likelihoods
from tests.numerics.cities import city_of, index_of
from tests.numerics.test_this_road import best_fit_of


def test_a_noisy_device_is_on_its_road_and_less_sure_where():
    """Noise of 4 dB on a map of 2 dB: not refused, and radii that hold what they say."""
    index, held, wide, refused = index_of(cells=6), [], [], []
    rng = np.random.default_rng(11)
    for one in windows(city_of(cells=6), 60, length_m=30.0):
        noisy = one.window.rsrp_dbm + rng.normal(0.0, 3.5, one.window.rsrp_dbm.shape)
        window = replace(one.window, rsrp_dbm=noisy)
        fix, quiet = (locate(index, each) for each in (window, one.window))
        refused.append(fix.off_map)
        held.append(
            float(apart_m(fix.lon, fix.lat, one.truth.lon, one.truth.lat)) <= fix.accuracy_m
        )
        wide.append(fix.accuracy_m / quiet.accuracy_m)
    assert not any(refused)
    assert 0.5 < np.mean(held) < 0.95
    assert np.median(wide) > 1.4


def test_noise_is_told_by_windows_of_enough_readings():
    """Of the survey's own noise hardly any window is taken for a noisy device's."""
    index = index_of(cells=6)
    told = [
        best_fit_of(index, one.window).noise for one in windows(city_of(cells=6), 40, length_m=30.0)
    ]
    assert np.median(told) < 1.01
    assert np.mean(np.array(told) > 2.0) < 0.05


def test_noise_is_what_the_laws_of_this_road_make_likely():
    """Where a window tells nothing what is known beforehand, else that of the law which is true."""
    apart = 60.0
    nothing = Likelihoods(0.0, 0.0, 0.0, 0.0, 0.0)
    expected = 1.0 + MUCH * (DRIFT_TIMES - 1.0) + NOISIER * (NOISE_TIMES - 1.0)
    assert nothing.judged()[1] == pytest.approx(expected)
    assert nothing._replace(here=apart).judged()[1] == 1.0
    assert nothing._replace(drifted=apart).judged()[1] == pytest.approx(DRIFT_TIMES)
    assert nothing._replace(noisier=apart).judged()[1] == pytest.approx(NOISE_TIMES)


def test_an_area_that_has_drifted_widens_radii():
    """Every cell 6 dB off by the end of the window, one up, one down: no noise, and no road's."""
    index, wide = index_of(cells=6), []
    for one in windows(city_of(cells=6), 20, length_m=30.0):
        window = one.window
        slowly = np.linspace(0.0, 6.0, len(window.distance_m))[:, None]
        drifted = window.rsrp_dbm + slowly * np.where(np.arange(len(window.cells)) % 2, 1.0, -1.0)
        fixes = [locate(index, each) for each in (replace(window, rsrp_dbm=drifted), window)]
        wide.append(fixes[0].accuracy_m / fixes[1].accuracy_m)
    assert np.median(wide) > 1.2


def test_what_is_known_beforehand_is_no_less_known_of_a_noisy_device():
    """Divided by more, readings of the last places say less and their prior what it did."""
    index = index_of(cells=6)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    places = place(index, ask(index, window)).places
    temperature, times, log_prior = 0.4, 3.0, np.array([-2.0, -5.0])
    known = Known(log_prior, np.ones(2))
    said = places.score.copy()
    places.values[SCORE, -2:] += log_prior * temperature
    held = places.score.copy()
    louder = _of_noise(places, times, temperature, known)
    over = temperature * times
    np.testing.assert_allclose(louder.score[-2:] / over, said[-2:] / over + log_prior, rtol=1e-12)
    np.testing.assert_array_equal(louder.score[:-2], said[:-2])
    np.testing.assert_array_equal(places.score, held)
    assert _of_noise(places, times, temperature, None) is places
