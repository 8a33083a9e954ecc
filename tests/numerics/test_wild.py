"""Wild readings are found by the window alone: by the book, in C, and what fixes are then."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from statistics import median

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Window
from app.evaluation.scenario import windows
from app.numerics import native_readings
from app.numerics.geodesy import distance_m as apart_m
from app.numerics.matching import locate
from app.numerics.wild import NEIGHBOURS, REACH_M, SURE_DB, TIMES, without_wild
from tests.numerics.cities import city_of, index_of
from tests.numerics.test_native import built


def by_the_book(distance_m: np.ndarray, rsrp_dbm: np.ndarray) -> np.ndarray:
    """One reading at a time."""
    steps, found = [], {}
    for cell in range(rsrp_dbm.shape[1]):
        heard = [i for i in range(len(distance_m)) if not np.isnan(rsrp_dbm[i, cell])]
        for one, other in pairwise(heard):
            if distance_m[other] - distance_m[one] <= REACH_M:
                steps.append(abs(rsrp_dbm[other, cell] - rsrp_dbm[one, cell]))
        for at, i in enumerate(heard):
            about = heard[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = [j for j in about if abs(distance_m[j] - distance_m[i]) <= REACH_M]
            if len(near) >= 3:
                usual = median(rsrp_dbm[j, cell] for j in near)
                found[i, cell] = abs(rsrp_dbm[i, cell] - usual)
    wild = [at for at, stray_db in found.items() if stray_db > max(SURE_DB, TIMES * median(steps))]
    out = rsrp_dbm.copy()
    for i, cell in wild:
        told, strays = (sum(row == i for row, _ in each) for each in (found, wild))
        if i not in (0, len(distance_m) - 1) or 2 * strays <= told:
            out[i, cell] = np.nan
    return out


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 30), st.integers(0, 4), st.floats(0.5, 8.0))
def test_both_find_what_the_book_does(seed, samples, cells, rough_db):
    """Standing cars, gaps, cells heard once, a fifth of the readings wild."""
    rng = np.random.default_rng(seed)
    distance_m = np.cumsum(rng.choice([0.0, 1.0, 8.0, 25.0, 60.0], samples))
    rsrp_dbm = -90.0 + np.cumsum(rng.normal(0.0, rough_db, (samples, cells)), axis=0)
    strays = rng.random(rsrp_dbm.shape) < 0.2
    rsrp_dbm[strays] += rng.choice([-25.0, 15.0, 40.0], int(strays.sum()))
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.3] = np.nan
    wanted = by_the_book(distance_m, rsrp_dbm)
    plain = without_wild(distance_m, rsrp_dbm)
    np.testing.assert_array_equal(plain, wanted)
    assert (plain is rsrp_dbm) == bool(np.array_equal(wanted, rsrp_dbm, equal_nan=True))
    if native_readings.BUILT:
        fast = native_readings.without_wild(distance_m, rsrp_dbm)
        np.testing.assert_array_equal(fast, wanted)
        assert (fast is rsrp_dbm) == (plain is rsrp_dbm)


def test_slopes_steps_and_lone_readings_are_left_as_they_are():
    """A corner drops a level by 30 dB and leaves it there; a cell heard twice tells nothing."""
    distance_m = np.arange(20.0) * 5.0
    levels = np.full((20, 3), np.nan)
    levels[:, 0] = -60.0 - 3.0 * np.arange(20)
    levels[:, 1] = np.where(np.arange(20) < 9, -70.0, -100.0)
    levels[[3, 4], 2] = -60.0, -110.0
    assert without_wild(distance_m, levels) is levels
    levels[12, 0] += 30.0
    left = without_wild(distance_m, levels)
    assert np.isnan(left[12, 0])
    assert np.isnan(left).sum() == np.isnan(levels).sum() + 1


def test_a_step_at_the_end_is_not_wild():
    """The mouth of a tunnel: all cells of the last sample are louder. One of them alone is wild."""
    rng = np.random.default_rng(3)
    levels = -100.0 + rng.normal(0.0, 1.0, (12, 5))
    distance_m = np.arange(12.0) * 8.0
    mouth, one = levels.copy(), levels.copy()
    mouth[-1] += 25.0
    one[-1, 2] += 25.0
    assert without_wild(distance_m, mouth) is mouth
    assert np.argwhere(np.isnan(without_wild(distance_m, one))).tolist() == [[11, 2]]


def test_readings_far_apart_contradict_nobody():
    """Samples 50 m apart may be anything."""
    rng = np.random.default_rng(1)
    levels = rng.uniform(-120.0, -60.0, (10, 3))
    assert without_wild(np.arange(10) * 50.0, levels) is levels


@built
@pytest.mark.parametrize("in_c", [True, False])
def test_a_wild_reading_moves_no_fix(in_c):
    """One reading of a window 30 dB off: the fix that there was, on the map, as sure."""
    index = index_of(cells=6)
    moved, surer = [], []
    for number, one in enumerate(windows(city_of(cells=6), 25, length_m=30.0)):
        rsrp_dbm = one.window.rsrp_dbm.copy()
        row, cell = number % len(rsrp_dbm), number % rsrp_dbm.shape[1]
        rsrp_dbm[row, cell] += 30.0 if rsrp_dbm[row, cell] < -85.0 else -30.0
        spoilt: Window = dataclasses.replace(one.window, rsrp_dbm=rsrp_dbm)
        was, now = (locate(index, each, in_c=in_c) for each in (one.window, spoilt))
        assert now.road_id == was.road_id
        assert not now.off_map
        moved.append(float(apart_m(was.lon, was.lat, now.lon, now.lat)))
        surer.append(now.road_posterior - was.road_posterior)
    assert max(moved) < 0.6
    assert max(np.abs(surer)) < 0.01
