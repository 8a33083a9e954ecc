"""Explanations say what of a window counts for less, or not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.scenario import windows
from app.numerics.matching import locate
from app.numerics.wording import sentences
from tests.numerics.cities import city_of, index_of
from tests.numerics.test_explanation import explained


def test_a_wild_reading_is_named_and_counts_for_nothing():
    """It is in none of the numbers, and said last; the answer is explained as without it."""
    index = index_of(cells=6)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    spoilt = window.rsrp_dbm.copy()
    spoilt[10, 0] += 35.0 if spoilt[10, 0] < -85.0 else -35.0
    told = explained(index, replace(window, rsrp_dbm=spoilt))
    (wild,) = told.left_out
    assert wild == (window.cells[0], pytest.approx(window.distance_m[-1] - 10.0), spoilt[10, 0])
    assert np.isnan(told.residual_db[10, told.cells.index(wild.cell)])
    said = sentences(told, locate(index, replace(window, rsrp_dbm=spoilt)))
    assert said[-1].startswith("1 reading is left out")
    assert wild.cell in said[-1]
    assert explained(index, window).left_out == ()


def test_what_a_device_lists_and_how_noisy_it_is_are_said():
    """One cell of six a sample, then noise of 4 dB on a map of 2 dB; else neither is named."""
    index = index_of(cells=6)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    usual = explained(index, window)
    assert (usual.silence, usual.noise) == (1.0, 1.0)
    rank = np.argsort(np.argsort(-np.nan_to_num(window.rsrp_dbm, nan=-np.inf), axis=1), axis=1)
    few = replace(window, rsrp_dbm=np.where(rank < 1, window.rsrp_dbm, np.nan))
    told = explained(index, few)
    assert told.silence < 0.2
    assert any("lists fewer cells" in one for one in sentences(told, locate(index, few)))
    noise_db = np.random.default_rng(2).normal(0.0, 3.5, window.rsrp_dbm.shape)
    loud = replace(window, rsrp_dbm=window.rsrp_dbm + noise_db)
    told = explained(index, loud)
    assert told.noise > 2.0
    assert told.temperature == pytest.approx(told.noise * told.query.temperature(index.calibration))
    assert any("noisier" in one for one in sentences(told, locate(index, loud)))
