"""Places spread over the sub-segments beside them, as far as surveyed positions err."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Calibration
from app.numerics import native
from app.numerics.index import MapIndex
from app.numerics.posterior import CHAINAGE, SCORE, VALUES, WIDTH, Places, masses
from app.numerics.spread import REACH_SDS, over_segments
from app.numerics.summary import Rival, summarise
from tests.numerics.tiny import map_of, tiny_models

SEEDS = st.integers(0, 10_000)
EACH_WAY = pytest.mark.parametrize(
    "in_c",
    [
        pytest.param(True, marks=pytest.mark.skipif(not native.BUILT, reason="no C compiler")),
        False,
    ],
)
WIDTH_M = 0.2


def index_with(segment_sd_m: float) -> MapIndex:
    """Three roads of 60 m, each of three sub-segments."""
    return map_of(tiny_models(1), Calibration(segment_sd_m=segment_sd_m))


def places_at(*each: tuple[int, int, float, float]) -> Places:
    """Of road, direction, chainage and log of the mass."""
    road, sign, chainage_m, score = np.array(each).T
    values = np.zeros((VALUES, len(each)))
    values[CHAINAGE], values[WIDTH], values[SCORE] = chainage_m, WIDTH_M, score
    return Places(np.stack([road, sign]).astype(np.int64), values)


def any_places(seed: int, index: MapIndex) -> Places:
    """Rows of places as the matcher lays them, of several widths, many of them equally likely."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(rng.integers(1, 6)):
        road, count = int(rng.integers(3)), int(rng.integers(1, 30))
        step_m = float(rng.choice([0.2, 1.0, 4.0]))
        first_m = rng.integers(0, 50)
        chainage_m = np.minimum(first_m + step_m * np.arange(count), index.lengths_m[road])
        values = np.zeros((VALUES, count))
        values[CHAINAGE], values[WIDTH] = chainage_m, step_m
        values[SCORE] = rng.integers(-12, 1, count)
        sign = int(rng.choice([-1, 1]))
        rows.append(Places(np.tile([[road], [sign]], count).astype(np.int64), values))
    return Places.join(rows)


def rivals_of(index: MapIndex, places: Places, *, in_c: bool) -> list[Rival]:
    return summarise(index, places, 1.0, 0.68, in_c=in_c).rivals


def mass_of(rivals: list[Rival]) -> dict[tuple[int, int, int], float]:
    return {rival[:3]: rival[3] for rival in rivals}


@EACH_WAY
def test_a_place_on_a_boundary_gives_half_to_either_side(in_c):
    """To the last bit, so that the earlier sub-segment is listed first."""
    index = index_with(3.0)
    boundary_m = float(index.roads[1].edges_m[1])
    first, second = rivals_of(index, places_at((1, 1, boundary_m, 0.0)), in_c=in_c)
    assert (first[:3], second[:3]) == ((1, 0, 1), (1, 1, 1))
    assert first[3] == second[3] == 0.5
    assert first[4] == second[4] == boundary_m


@EACH_WAY
@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, segment_sd_m=st.sampled_from([0.0, 0.5, 3.0, 8.0, 50.0]))
def test_no_road_and_no_direction_gains_any(in_c, seed, segment_sd_m):
    """Masses sum to 1, and to those of the places on every road in either direction."""
    index = index_with(segment_sd_m)
    places = any_places(seed, index)
    mass, rivals = masses(places, 1.0), rivals_of(index, places, in_c=in_c)
    for road, sign in {(one[0], one[2]) for one in rivals}:
        told = sum(one[3] for one in rivals if (one[0], one[2]) == (road, sign))
        there = mass[(places.road == road) & (places.sign == sign)].sum()
        assert told == pytest.approx(there, abs=1e-8)
    assert sum(one[3] for one in rivals) == pytest.approx(1.0, abs=1e-7)
    assert all(one[3] > 0.0 for one in rivals)


@EACH_WAY
def test_without_position_error_nothing_moves(in_c):
    """But for places so near a boundary that the road they stand for lies on either side."""
    index = index_with(0.0)
    edges_m = index.roads[0].edges_m
    apart_m = 1.01 * REACH_SDS * WIDTH_M / np.sqrt(12.0)
    each = [(edges_m[1] - apart_m, 0), (edges_m[1] + apart_m, 1), (edges_m[2] + apart_m, 2)]
    places = places_at(*((0, 1, at_m, -float(segment)) for at_m, segment in each))
    found = mass_of(rivals_of(index, places, in_c=in_c))
    mass = masses(places, 1.0)
    assert found == {(0, segment, 1): mass[segment] for segment in range(3)}


@EACH_WAY
def test_what_falls_off_the_road_stays_at_its_end(in_c):
    """A place at the end of the road errs into the road only."""
    index = index_with(2.0)
    places = places_at((0, 1, 0.0, 0.0), (0, -1, float(index.lengths_m[0]), 0.0))
    found = mass_of(rivals_of(index, places, in_c=in_c))
    assert found == pytest.approx({(0, 0, 1): 0.5, (0, 2, -1): 0.5})


@EACH_WAY
@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, segment_sd_m=st.sampled_from([3.0, 8.0, 50.0]))
def test_every_candidate_lies_in_its_sub_segment(in_c, seed, segment_sd_m):
    """Those with places of their own at the best of these, the others at the edge beside it."""
    index = index_with(segment_sd_m)
    places = any_places(seed, index)
    own = index.atlas.segment[index.atlas.spot(places.road, places.chainage_m).low]
    for number, segment, sign, _, chainage_m, lon, lat in rivals_of(index, places, in_c=in_c):
        road = index.roads[number]
        start_m, end_m = road.edges_m[segment : segment + 2]
        there = (places.road == number) & (places.sign == sign) & (own == segment)
        if there.any():
            best = np.where(there, places.score, -np.inf).argmax()
            assert chainage_m == places.chainage_m[best]
        else:
            assert chainage_m in {start_m, end_m}
        at = index.atlas.spot(np.array([number]), np.array([chainage_m]))
        assert [[lon], [lat]] == pytest.approx(at.of(index.atlas.plane[2:4]))


@pytest.mark.skipif(not native.BUILT, reason="no C compiler")
@settings(max_examples=100, deadline=None)
@given(seed=SEEDS, segment_sd_m=st.sampled_from([0.0, 0.5, 3.0, 8.0, 50.0]))
def test_both_forms_list_the_same(seed, segment_sd_m):
    """The same candidates with the same masses at the same places, though many places tie."""
    index = index_with(segment_sd_m)
    places = any_places(seed, index)
    ours, wanted = (sorted(rivals_of(index, places, in_c=in_c)) for in_c in (True, False))
    for one, other in zip(ours, wanted, strict=True):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12)


@EACH_WAY
def test_ties_stand_by_road_and_direction(in_c):
    """Mirrored places on equal roads: earlier road, earlier sub-segment, forward first."""
    index = index_with(2.0)
    middle_m = [float(road.edges_m[1]) for road in index.roads]
    each = ((road, sign, middle_m[road], 0.0) for road in (2, 0) for sign in (-1, 1))
    found = rivals_of(index, places_at(*each), in_c=in_c)
    wanted = [(road, segment, sign) for road in (0, 2) for segment in (0, 1) for sign in (1, -1)]
    assert [one[:3] for one in found] == wanted


def test_light_places_are_not_spread():
    """What does not matter to a radius does not matter here: it costs nothing."""
    index = index_with(3.0)
    boundary_m = float(index.roads[0].edges_m[1])
    places = places_at((0, 1, 30.0, 0.0), (0, 1, boundary_m, -11.0))
    spots = index.atlas.spot(places.road, places.chainage_m)
    shares = over_segments(index.atlas, places, masses(places, 1.0), spots, 3.0)
    assert not shares.spilled[shares.place == 1].any()


def test_sub_segments_come_true_as_often_as_they_say():
    """Truths that err by 4 m lie in a sub-segment as often as its posterior says; unspread not."""
    rng = np.random.default_rng(4)
    count, sd_m = 4000, 4.0
    where_m = rng.uniform(10.0, 50.0, count)
    truth_m = where_m + rng.normal(0.0, sd_m, count)
    gap = {}
    for spread_m in (0.0, sd_m):
        index = index_with(spread_m)
        said, right = np.empty((2, count))
        for i, (at_m, true_m) in enumerate(zip(where_m.tolist(), truth_m.tolist(), strict=True)):
            _, segment, _, said[i], *_ = rivals_of(
                index, places_at((0, 1, at_m, 0.0)), in_c=native.BUILT
            )[0]
            right[i] = index.roads[0].segment_at(true_m) == segment
        bins = np.minimum((10.0 * said).astype(int), 9)
        gap[spread_m] = abs(np.bincount(bins, said - right)).sum() / count
    assert gap[0.0] > 0.1
    assert gap[sd_m] < 0.02
