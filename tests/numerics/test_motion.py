"""How a belief moves: the way shifts it, junctions split it, nothing of it is lost."""

from __future__ import annotations

import numpy as np
import pytest

from app.domain import Calibration, RadioMap
from app.numerics.belief import Belief, Mode
from app.numerics.index import MapIndex
from app.numerics.motion import FARTHEST_M, Predicted, predict
from app.numerics.offmap import OFF_MAP_PRIOR
from tests.factories import line_at, model_of
from tests.numerics.test_graph import line_through


@pytest.fixture(scope="module")
def crossing() -> MapIndex:
    """A street to the east, one across it at 300 m, and one that carries the first on."""
    lines = {
        "east": line_at(length_m=600.0),
        "across": line_through((300, -200), (300, 200)),
        "onward": line_through((605, 0), (900, 0)),
    }
    models = [model_of(name, seed=i, line=line) for i, (name, line) in enumerate(lines.items())]
    return MapIndex.build(RadioMap(1, tuple(models), Calibration()))


def at(chainage_m: float, *, road: int = 0, sign: int = 1, sd_m: float = 3.0) -> Belief:
    return Belief((Mode(road, sign, chainage_m, sd_m, 0.9),), 0.05, 0.05)


def whole(moved: Predicted) -> float:
    return sum(each.mode.weight for each in moved.branches) + moved.anywhere + moved.off_map


@pytest.mark.parametrize("travelled_m", [0.0, 0.5, 20.0, 150.0, 400.0, 900.0, FARTHEST_M + 1.0])
@pytest.mark.parametrize("start_m", [0.0, 290.0, 310.0, 599.0])
def test_nothing_is_lost_or_made(crossing: MapIndex, travelled_m: float, start_m: float):
    """Branches, anywhere and off the map sum to 1, wherever the way leads."""
    for sign in (1, -1):
        moved = predict(crossing, at(start_m, sign=sign), travelled_m)
        assert whole(moved) == pytest.approx(1.0, abs=1e-9)
        assert all(each.mode.weight >= 0.0 for each in moved.branches)
        for each in moved.branches:
            assert 0.0 <= each.mode.chainage_m <= crossing.roads[each.mode.road].length_m


def test_the_way_shifts_a_mode_in_its_direction(crossing: MapIndex):
    """By as much as was travelled, and less surely than before."""
    for sign in (1, -1):
        moved = predict(crossing, at(150.0, sign=sign), 80.0).branches[0].mode
        assert moved.chainage_m == pytest.approx(150.0 + 80.0 * sign)
        assert moved.sd_m > 3.0


def test_standing_still_moves_nothing(crossing: MapIndex):
    """Not even the spread."""
    moved = predict(crossing, at(150.0), 0.0)
    assert [each.mode.chainage_m for each in moved.branches] == [150.0]
    assert moved.branches[0].mode.sd_m == 3.0
    assert moved.branches[0].mode.weight == pytest.approx(0.9)


def test_a_junction_passed_offers_both_ways_of_the_other_road(crossing: MapIndex):
    """Each as far past the junction as the vehicle would be; straight on is likeliest."""
    moved = predict(crossing, at(260.0), 100.0)
    straight = moved.branches[0]
    assert (straight.mode.road, straight.legs) == (0, ())
    turned = [each for each in moved.branches if each.mode.road == 1]
    ends = sorted((each.mode.sign, each.mode.chainage_m) for each in turned)
    assert ends == [(-1, pytest.approx(140.0, abs=1.0)), (1, pytest.approx(260.0, abs=1.0))]
    assert all(each.entered_m == pytest.approx(200.0, abs=1.0) for each in turned)
    assert sum(each.mode.weight for each in turned) < straight.mode.weight


def test_a_junction_not_reached_offers_nothing(crossing: MapIndex):
    """A hundred metres before it there is one way to go."""
    moved = predict(crossing, at(100.0), 80.0)
    assert all(each.mode.road == 0 for each in moved.branches)


def test_a_road_that_goes_on_under_another_name_is_gone_on(crossing: MapIndex):
    """Past the end most of the belief is on the road that carries on."""
    moved = predict(crossing, at(560.0), 100.0)
    best = moved.branches[0]
    assert (best.mode.road, best.mode.sign) == (2, 1)
    assert best.mode.chainage_m == pytest.approx(60.0, abs=6.0)
    assert best.mode.weight > 0.6


def test_at_the_end_of_the_map_the_vehicle_may_have_left_it(crossing: MapIndex):
    """Where no road goes on, being off the map gains."""
    moved = predict(crossing, at(250.0, road=2), 200.0)
    assert moved.off_map > 0.2
    assert np.isclose(max(each.mode.weight for each in moved.branches), 0.0, atol=0.4)


def test_being_off_the_map_is_forgotten(crossing: MapIndex):
    """Over kilometres, towards what is thought of a window without a track."""
    lost = Belief((), 0.0, 1.0)
    shares = [predict(crossing, lost, way_m).off_map for way_m in (0.0, 300.0, 1000.0, 20_000.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == 1.0
    assert shares[-1] == pytest.approx(OFF_MAP_PRIOR, abs=0.005)


def test_a_known_odometer_moves_the_spread(crossing: MapIndex):
    """An exact one adds what clocks and the map err by, one of 5 % that much of the way."""
    spread = [
        predict(crossing, at(150.0), 200.0, error).branches[0].mode.sd_m
        for error in (0.0, None, 0.05)
    ]
    assert spread == sorted(spread)
    assert spread[2] ** 2 - spread[0] ** 2 == pytest.approx((0.05 * 200.0) ** 2)
