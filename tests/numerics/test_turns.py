"""Turns: which ways round a corner there are, from the roads' lines and how they meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Line
from app.numerics.index import MapIndex
from app.numerics.lines import point_at
from app.numerics.tapes import COARSE_STEPS_M, GAP
from tests.factories import FRAME, model_of
from tests.numerics.tiny import map_of


def line_through(*points_m: tuple[float, float]) -> Line:
    x_m, y_m = np.array(points_m).T
    place = FRAME.to_lonlat(x_m, y_m)
    return Line(np.asarray(place.lon), np.asarray(place.lat))


def index_of(*lines: Line) -> MapIndex:
    made = [model_of(f"road-{i}", seed=i, line=line, cells=("a",)) for i, line in enumerate(lines)]
    return map_of(tuple(replace(one, length_m=len(one.mean_dbm) - 1.0) for one in made))


def turns_of(index: MapIndex) -> set[tuple[int, int, int, int]]:
    ways = index.turns.ways
    columns = (ways.from_road, ways.from_sign, ways.road, ways.sign)
    return set(zip(*(column.tolist() for column in columns), strict=True))


EAST = line_through((0, 0), (400, 0))


def test_a_crossing_has_eight_turns():
    """From either road, coming from either side, left and right."""
    turns = turns_of(index_of(EAST, line_through((150, -90), (150, 300))))
    assert turns == {
        (road, before, 1 - road, after)
        for road in (0, 1)
        for before in (1, -1)
        for after in (1, -1)
    }


def test_a_road_that_ends_on_another_has_four_turns():
    """Out of it left and right, and into it from either side; nobody comes from where it is not."""
    turns = turns_of(index_of(EAST, line_through((150, 6), (150, 300))))
    assert turns == {(0, 1, 1, 1), (0, -1, 1, 1), (1, -1, 0, 1), (1, -1, 0, -1)}


def test_a_road_drawn_on_as_another_is_gone_on_along():
    """Straight on where one road ends and another begins, either way."""
    turns = turns_of(index_of(EAST, line_through((405, 2), (800, 2))))
    assert turns == {(0, 1, 1, 1), (1, -1, 0, -1)}


@pytest.mark.parametrize("onward", [((0, 15), (400, 15)), ((200, 0), (-80, 60))])
def test_carriageways_and_ways_back_are_no_turns(onward):
    """Parallel lines a lane apart are not changed between; an acute fork has a way back."""
    turns = turns_of(index_of(EAST, line_through(*onward)))
    assert (0, 1, 1, 1) not in turns


def test_stubs_lead_nowhere():
    """A crossing 10 m before a road's end is not turned at towards that end."""
    turns = turns_of(index_of(EAST, line_through((150, -10), (150, 300))))
    assert (0, 1, 1, -1) not in turns
    assert (0, 1, 1, 1) in turns


def test_both_roads_of_a_turn_meet_where_it_is():
    """On random streets, the place that is left lies by the one that is entered."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(0, 700, (9, 2, 2))
    index = index_of(*(line_through(tuple(a), tuple(b)) for a, b in ends.tolist()))
    ways = index.turns.ways
    assert len(ways) > 20
    for i in range(len(ways)):
        left = point_at(index.lines[ways.from_road[i]], float(ways.left_m[i]))
        entered = point_at(index.lines[ways.road[i]], float(ways.entered_m[i]))
        a, b = FRAME.to_xy(left.lon, left.lat), FRAME.to_xy(entered.lon, entered.lat)
        assert np.hypot(a.x_m - b.x_m, a.y_m - b.y_m) < 20.5


def test_arms_lie_where_the_turns_are():
    """At every coarse step each turn's two columns are its junction's to half a column of way."""
    rng = np.random.default_rng(4)
    ends = rng.uniform(0, 900, (14, 2, 2))
    index = index_of(*(line_through(tuple(a), tuple(b)) for a, b in ends.tolist()))
    ways = index.turns.ways
    for size, step_m in enumerate(COARSE_STEPS_M):
        level = index.turns.levels[size]
        where = np.concatenate([arms.where for arms in level.arms], axis=1)
        assert where.shape[1] == level.total
        for turn in range(len(ways)):
            onto, off = where[:, level.onto[turn]], where[:, level.off[turn]]
            assert onto[1:].tolist() == [ways.sign[turn], 1]
            assert off[1:].tolist() == [ways.from_sign[turn], 0]
            columns = index.tapes[index.turns.tape[turn]].levels[size]
            at = int(np.searchsorted(columns.positions, onto[0]))
            assert columns.places.road[at] == ways.road[turn]
            past_m = ways.sign[turn] * (columns.places.chainage_m[at] - ways.entered_m[turn])
            assert past_m == pytest.approx(level.past_m[turn])
            before = index.tapes[index.turns.from_tape[turn]].levels[size]
            at = int(np.searchsorted(before.positions, off[0]))
            before_m = ways.from_sign[turn] * (before.places.chainage_m[at] - ways.left_m[turn])
            assert abs(before_m - past_m) <= step_m / 2.0 + 1e-6
            assert GAP <= onto[0] < columns.columns - GAP


def test_a_map_without_junctions_has_no_turns():
    """One road, and no road at all."""
    assert len(index_of(EAST).turns) == 0
    assert len(index_of().turns) == 0
