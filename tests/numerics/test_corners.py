"""Windows round corners: the fast answer is the definition's, and the definition is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Direction, Fix, Window
from app.evaluation.scenario import windows
from app.evaluation.scenario.tours import Leg, Tour, tour_of
from app.numerics import motion, native, tracking
from app.numerics.chosen import choose
from app.numerics.coarse import score_roads, size_of, tapes_of
from app.numerics.contributions import contributions
from app.numerics.corners import LEAST_M, every_corner, lay, reached, score_turns, way_of
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.explanation import explain
from app.numerics.matching import locate
from app.numerics.paths import Way
from app.numerics.query import ask
from app.numerics.stretches import along
from app.numerics.ways import places_along, places_round_corners
from app.numerics.wording import sentences
from tests.numerics.cities import city_of, index_of

SIDES = ("road-south", "road-east", "road-north", "road-west")  # end to end round the square


def round_corner(start: int, sign: int, cells: int = 6, name: str = "paper", number: int = 0):
    """A tour along two sides of the square."""
    ends = (10.0, 399.0) if sign > 0 else (390.0, 1.0)
    after = (1.0, 390.0) if sign > 0 else (399.0, 10.0)
    first, second = SIDES[start], SIDES[(start + sign) % 4]
    return tour_of(city_of(name, cells), Leg(first, *ends), Leg(second, *after), number=number)


def window_past(tour: Tour, past_m: float, length_m: float = 150.0) -> tuple[Window, int]:
    """The window that ends so far past the corner, and its last sample."""
    corner = int(np.flatnonzero(tour.leg == 1)[0])
    last = int(np.searchsorted(tour.travelled_m, tour.travelled_m[corner] + past_m))
    first = int(np.searchsorted(tour.travelled_m, tour.travelled_m[last] - length_m))
    return tour.window(first, last), last


def corners_of(cells: int, count: int, length_m: float = 150.0):
    """Windows round all corners of the square, and where they end."""
    for number in range(count):
        tour = round_corner(number % 4, 1 if number % 8 < 4 else -1, cells, number=number)
        past_m = 20.0 + (37.0 * number) % (length_m - 40.0)
        window, last = window_past(tour, past_m, length_m)
        yield window, tour.legs[1], float(tour.chainage_m[last])


def scores_along(index, query, number: int, sign: int, at_m: np.ndarray) -> np.ndarray:
    """Scores of whole metres of one road."""
    every = along(index, query, number, sign, int(at_m.min()), int(at_m.max())).score
    return every if sign > 0 else every[::-1]


def test_a_window_round_a_corner_is_found():
    """Road, direction and place after the turn; along single roads it is farther off."""
    index = index_of()
    with_turns, without = [], []
    for window, leg, chainage_m in corners_of(6, 16):
        fix, straight = locate(index, window), locate_exhaustively(index, window)
        assert (fix.road_id, fix.direction.sign) == (leg.road_id, leg.sign)
        assert not fix.off_map
        with_turns.append(abs(fix.chainage_m - chainage_m))
        lost = straight.road_id != leg.road_id
        without.append(1e3 if lost else abs(straight.chainage_m - chainage_m))
    assert max(with_turns) < 4.0
    assert np.median(with_turns) < 0.3  # places after a turn are drawn between metres
    assert np.mean(with_turns) < 1.5
    assert np.mean(with_turns) < np.mean(without)


@pytest.mark.parametrize(("cells", "length_m"), [(6, 150.0), (2, 120.0), (2, 300.0), (1, 200.0)])
def test_the_fast_answer_is_the_definitions(cells, length_m):
    """Along roads and round corners, in C and in numpy: road, place, probabilities and radius."""
    index = index_of(cells=cells)
    asked = [window for window, *_ in corners_of(cells, 8, length_m)]
    asked += [window for window, _ in windows(city_of(cells=cells), 8, length_m=length_m)]
    for window in asked:
        slow = locate_exhaustively(index, window, turns=True)
        for in_c in {False, native.BUILT}:
            fast = locate(index, window, in_c=in_c)
            is_that_of(fast, slow)


def is_that_of(fast: Fix, slow: Fix) -> None:
    """The fast answer is the definition's: road, place, probabilities and radius."""
    assert fast.road_posterior == pytest.approx(slow.road_posterior, abs=2e-3)
    assert fast.off_map_posterior == pytest.approx(slow.off_map_posterior, abs=1e-3)
    if slow.candidates[0].posterior > 0.5:
        assert (fast.road_id, fast.direction) == (slow.road_id, slow.direction)
        assert fast.chainage_m == pytest.approx(slow.chainage_m, abs=0.1)
        assert fast.accuracy_m == pytest.approx(slow.accuracy_m, rel=0.05, abs=0.2)


def test_windows_that_do_not_turn_are_answered_as_ever():
    """Of 150 m along a side: the road as sure as along single roads but near its beginning."""
    index = index_of()
    for window, truth in windows(city_of(), 25, length_m=150.0):
        fix, straight = locate(index, window), locate_exhaustively(index, window)
        assert fix.road_id == straight.road_id == truth.road_id
        assert fix.chainage_m == pytest.approx(straight.chainage_m, abs=0.1)
        assert fix.road_posterior > straight.road_posterior - 0.01


def test_short_windows_are_not_laid_round_corners():
    """Under the least length no turn is looked at."""
    index = index_of(cells=2)
    for window, *_ in corners_of(2, 6, LEAST_M - 2.0):
        query = ask(index, window, in_c=native.BUILT)
        assert choose(index, query)[1] == every_corner(index, query) == []


@pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
@settings(max_examples=20, deadline=None)
@given(
    st.integers(0, 200),
    st.sampled_from([1, 2, 6]),
    st.sampled_from([95.0, 140.0, 230.0, 380.0]),
    st.booleans(),
)
def test_corners_are_scored_the_same_in_c(number, cells, length_m, strangers):
    """Coarse scores round every turn, with cells that some roads lack and readings missing."""
    index = index_of(cells=cells)
    tour = round_corner(number % 4, 1 if number % 8 < 4 else -1, cells, number=number)
    window, _ = window_past(tour, 30.0 + number % 60, length_m)
    rng = np.random.default_rng(number)
    readings_dbm = window.rsrp_dbm.copy()
    if strangers:
        readings_dbm[rng.random(readings_dbm.shape) < 0.3] = np.nan
    window = replace(window, rsrp_dbm=readings_dbm)
    scores = []
    for in_c in (True, False):
        query = ask(index, window, in_c=in_c)
        tapes = tapes_of(index, query)
        laid = lay(index, query, size_of(query), tapes)
        score_roads(index, query, tapes, laid)
        scores.append(score_turns(index, query, laid))
    ours, wanted = scores
    assert (np.isfinite(ours) == np.isfinite(wanted)).all()
    assert np.isfinite(ours).any()
    known = np.isfinite(ours)
    np.testing.assert_allclose(ours[known], wanted[known], rtol=1e-5, atol=0.02)


def test_coarse_scores_are_near_the_fine_ones():
    """The turn that fits best metre by metre is the one that fits best at coarse steps."""
    index = index_of()
    for window, *_ in corners_of(6, 8):
        query = ask(index, window)
        tapes = tapes_of(index, query)
        laid = lay(index, query, size_of(query), tapes)
        score_roads(index, query, tapes, laid)
        coarse = score_turns(index, query, laid).max(axis=1)
        fine = np.array(
            [
                places_along(
                    index, query, way_of(index, one.turn), (one.first_m, one.last_m)
                ).score.max()
                for one in every_corner(index, query)
            ]
        )
        assert coarse.argmax() == fine.argmax()


@pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
def test_ways_are_laid_the_same_in_c():
    """Places along a way, metre by metre, to the nanometre and the nat's millionth."""
    index = index_of(cells=2)
    for window, *_ in corners_of(2, 6):
        fast, plain = ask(index, window, in_c=True), ask(index, window)
        for one in every_corner(index, plain):
            way, span = way_of(index, one.turn), (one.first_m, one.last_m)
            ours, wanted = (places_along(index, q, way, span) for q in (fast, plain))
            np.testing.assert_array_equal(ours.where, wanted.where)
            np.testing.assert_allclose(ours.values, wanted.values, rtol=1e-9, atol=1e-6)


@pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
@pytest.mark.parametrize("worth", [-np.inf, np.inf])
def test_places_after_turns_are_the_same_in_c(worth):
    """Drawn between metres and under every odometer, on their last roads; in order."""
    index = index_of(cells=2)
    for window, *_ in corners_of(2, 6):
        fast, plain = ask(index, window, in_c=True), ask(index, window)
        ways = [reached(index, plain, one) for one in every_corner(index, plain)[:3]]
        ours, wanted = (places_round_corners(index, q, ways, worth) for q in (fast, plain))
        np.testing.assert_array_equal(ours.places.where, wanted.places.where)
        np.testing.assert_allclose(ours.places.values, wanted.places.values, rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(ours.known, wanted.known)
        assert ours.together == pytest.approx(wanted.together)
        assert len(ours.known.factor) == len(ours.places)
        assert worth < 0.0 or not ours.together
        assert {one.way.road for one in ways} == set(ours.places.road.tolist())


def test_odometers_err_round_corners_too():
    """Windows whose metres are 4 % too long end where they do all the same, if that may be."""
    index = index_of()
    may_err, must_not = [], []
    for window, leg, chainage_m in corners_of(6, 8, 100.0):
        longer = replace(window, distance_m=1.04 * np.asarray(window.distance_m))
        fix = locate(index, longer)
        assert fix.road_id == leg.road_id
        may_err.append(abs(fix.chainage_m - chainage_m))
        exact = locate(index, replace(longer, distance_error=0.0))
        must_not.append(abs(exact.chainage_m - chainage_m) if exact.road_id == leg.road_id else 9.0)
    assert np.median(may_err) < 0.5 < np.median(must_not)


def test_a_way_straight_on_is_the_road_itself():
    """A window laid along a road by way of itself fits as it does along the road."""
    index = index_of()
    for window, truth in windows(city_of(), 12, length_m=60.0):
        number, sign = index.road_ids.index(truth.road_id), truth.direction.sign
        entered_m = 150.0 if sign > 0 else 250.0
        way = Way((motion.Leg(number, sign, entered_m, entered_m),), number, sign, entered_m)
        query = ask(index, window)
        laid = places_along(index, query, way, (5, 90))
        straight = scores_along(index, query, number, sign, laid.chainage_m)
        np.testing.assert_allclose(laid.score, straight, rtol=1e-9, atol=1e-6)


def test_an_explained_corner_adds_up():
    """The score of a place round a corner is the sum of its parts, and the words say so."""
    index = index_of(cells=2)
    turned = 0
    for window, leg, _ in corners_of(2, 8):
        fix = locate(index, window)
        told = explain(index, window, fix)
        where = told.answer.place
        assert told.answer.road_id == fix.road_id
        if where.way is None:
            continue
        turned += 1
        query = ask(index, window)
        past_m = round(where.way.sign * (where.chainage_m - where.way.entered_m))
        places = places_along(index, query, where.way, (past_m, past_m))
        assert contributions(index, query, where).score == pytest.approx(
            float(places.score[0]), abs=1e-3
        )
        assert told.answer.came_by != leg.road_id
        assert any("round a corner" in one for one in sentences(told, fix))
        assert np.nanstd(told.residual_db) < 4.0
    assert turned >= 6


def test_a_tracks_first_window_turns_too():
    """Its fix is the ordinary one, and its belief is on the road after the corner."""
    index = index_of()
    for window, leg, chainage_m in corners_of(6, 4):
        first = tracking.begin(index, window)
        assert first.fix == locate(index, window)
        mode = first.belief.modes[0]
        assert index.road_ids[mode.road] == leg.road_id
        assert mode.sign == leg.sign
        assert mode.chainage_m == pytest.approx(chainage_m, abs=3.0)


def test_direction_is_told_after_the_turn():
    """Driven the other way round, the same corner ends on the other road."""
    index = index_of()
    window, _ = window_past(round_corner(0, 1), 70.0)
    back = Window(window.cells, window.distance_m, window.rsrp_dbm[::-1])
    there, again = locate(index, window), locate(index, back)
    assert (there.road_id, there.direction) == ("road-east", Direction.FORWARD)
    assert (again.road_id, again.direction) == ("road-south", Direction.BACKWARD)
