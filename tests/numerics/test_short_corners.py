"""Short windows that may have turned are laid round corners, the others as ever."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.domain import Fix, Window
from app.evaluation.scenario import windows
from app.evaluation.scenario.tours import Leg
from app.evaluation.truth import Truth
from app.numerics import native
from app.numerics.answer import answer
from app.numerics.calibration import UNTRIED
from app.numerics.corners import SHORT_M, may_turn
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.explanation import explain
from app.numerics.index import MapIndex
from app.numerics.matching import locate, may_have_turned, place
from app.numerics.query import ask
from app.numerics.wording import sentences
from tests.numerics.cities import city_of, index_of
from tests.numerics.test_corners import is_that_of, round_corner, window_past


def short_corners(cells: int, count: int) -> Iterator[tuple[Window, Leg, float]]:
    """Windows of 30 m round all corners of the square, and where they end."""
    for number in range(count):
        tour = round_corner(number % 4, 1 if number % 8 < 4 else -1, cells, number=number)
        window, last = window_past(tour, 8.0 + 5.0 * number % 15.0, 30.0)
        yield window, tour.legs[1], float(tour.chainage_m[last])


def test_a_short_window_round_a_corner_is_found():
    """Along single roads most fit nowhere, or far off."""
    index, missed_m, straight_m = index_of(), [], []
    for window, leg, chainage_m in short_corners(6, 16):
        for fix, missed in (
            (locate(index, window), missed_m),
            (locate_exhaustively(index, window), straight_m),
        ):
            right = fix.road_id == leg.road_id and not fix.off_map
            missed.append(abs(fix.chainage_m - chainage_m) if right else 1e3)
    assert np.mean(np.array(missed_m) < 2.0) > 0.9
    assert np.mean(np.array(straight_m) < 2.0) < 0.5


@pytest.mark.parametrize("cells", [2, 6])
def test_the_fast_answer_is_the_definitions(cells: int):
    """Round corners, in C and in numpy: road, place, probabilities and radius."""
    index, turned = index_of(cells=cells), 0
    for window, *_ in short_corners(cells, 8):
        slow = locate_exhaustively(index, window, turns=True)
        straight = locate_exhaustively(index, window)
        turned += may_have_turned(index, ask(index, window), straight)
        for in_c in {False, native.BUILT}:
            fast = locate(index, window, in_c=in_c)
            is_that_of(fast, slow)
    assert turned >= 6


def test_windows_that_fit_a_road_are_asked_once():
    """To the last bit; and what is too short, or has errors in common, is never laid round one."""
    index = index_of()
    middle = [one for one in windows(city_of(), 20, length_m=30.0) if mid_road(one.truth)]
    assert len(middle) >= 12
    for window, _ in middle:
        query = ask(index, window)
        assert not may_turn(index, query)
        assert may_turn(index, query, strays=True)
        assert locate(index, window, in_c=False) == along_roads(index, window)
    brief = ask(index, next(iter(windows(city_of(), 1, length_m=SHORT_M - 2.0))).window)
    assert not may_turn(index, brief, strays=True)
    together = index.recalibrated(UNTRIED)
    assert not may_turn(together, ask(together, window), strays=True)


def mid_road(truth: Truth) -> bool:
    """Whether neither end of the road, where turns go off, is near."""
    return 40.0 < truth.chainage_m < 360.0


def along_roads(index: MapIndex, window: Window) -> Fix:
    """The answer from places along roads alone."""
    query = ask(index, window)
    placed = place(index, query)
    return answer(index, query, placed.places, 0.68, placed.known)


def test_strange_windows_stay_off_the_map():
    """Levels that follow no law fit round no corner."""
    index, rng = index_of(), np.random.default_rng(3)
    for window, _ in windows(city_of(), 6, length_m=30.0):
        strange = replace(window, rsrp_dbm=rng.uniform(-110.0, -70.0, window.rsrp_dbm.shape))
        assert locate(index, strange).off_map


def test_the_corner_is_explained():
    """By the road that it was come by, in words as well."""
    index, told = index_of(), 0
    for window, leg, _ in short_corners(6, 8):
        fix = locate(index, window)
        why = explain(index, window, fix)
        if why.answer.place.way is not None:
            told += 1
            assert why.answer.came_by != leg.road_id
            assert any("round a corner" in one for one in sentences(why, fix))
    assert told >= 5
