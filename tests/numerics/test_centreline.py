"""A road's line from its drives: near the road, as long as their union, and the same each time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Line, Trace
from app.errors import RoadTooShort
from app.numerics.centreline import derive_line
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import heading_deg, length_m, point_at, project, slice_line
from tests.factories import line_at, trace_along

FRAME = LocalFrame(-118.49, 34.01)


def bent_road(origin=(-118.49, 34.01)) -> Line:
    """Some 900 m with a gentle curve and a corner of 60 degrees."""
    turn = np.concatenate([np.linspace(0.0, 0.5, 25), np.full(20, 0.5 + np.pi / 3)])
    x_m = np.concatenate([[0.0], np.cumsum(20.0 * np.cos(turn))])
    y_m = np.concatenate([[0.0], np.cumsum(20.0 * np.sin(turn))])
    ends = LocalFrame(*origin).to_lonlat(x_m, y_m)
    return Line(ends.lon, ends.lat)


def backward(trace: Trace) -> Trace:
    return replace(
        trace,
        lon=trace.lon[::-1].copy(),
        lat=trace.lat[::-1].copy(),
        rsrp_dbm=trace.rsrp_dbm[::-1].copy(),
    )


def drives(road: Line, seed: int, noise_m: float, count: int = 4) -> list[Trace]:
    """Passes with GPS noise, every other one backward."""
    passes = [
        trace_along(road, seed=seed + i, noise_m=noise_m, step_m=8.0, cells=("a",))
        for i in range(count)
    ]
    return [backward(one) if i % 2 else one for i, one in enumerate(passes)]


def off_m(derived: Line, road: Line) -> np.ndarray:
    """How far the derived line lies from the road, every metre of it."""
    places = point_at(derived, np.arange(0.0, length_m(derived)))
    return np.abs(project(road, places.lon, places.lat).offset_m)


@pytest.mark.parametrize("origin", [(-118.49, 34.01), (151.21, -33.87), (179.9975, -17.0)])
def test_a_bent_road_is_found_within_metres(origin):
    """Four passes with 3 m of noise an axis: within 1 m on average, 3 m nearly always."""
    road = bent_road(origin)
    derived = derive_line(drives(road, seed=41, noise_m=3.0))
    away_m = off_m(derived, road)
    assert away_m.mean() < 1.0
    assert np.quantile(away_m, 0.95) < 3.0
    assert length_m(derived) == pytest.approx(length_m(road), rel=0.015)  # no zigzag


def test_without_noise_the_road_is_met():
    """Exact positions give the road back within a metre, but for the corner that is rounded."""
    road = bent_road()
    away_m = off_m(derive_line(drives(road, seed=42, noise_m=0.0)), road)
    assert np.quantile(away_m, 0.9) < 0.5
    assert away_m.max() < 4.0


@pytest.mark.parametrize("reverse_second", [False, True])
def test_the_line_is_the_union_of_the_passes(reverse_second):
    """Two passes that overlap on a third make one line from the one's start to the other's end."""
    road = bent_road()
    total_m = length_m(road)
    first = trace_along(slice_line(road, 0.0, 600.0), seed=43, step_m=5.0, cells=("a",))
    second = trace_along(slice_line(road, 300.0, total_m), seed=44, step_m=5.0, cells=("a",))
    derived = derive_line([first, backward(second) if reverse_second else second])
    assert length_m(derived) > max(600.0, total_m - 300.0) + 100.0
    assert length_m(derived) == pytest.approx(total_m, abs=15.0)
    assert np.quantile(off_m(derived, road), 0.9) < 1.0


def test_the_longest_pass_gives_the_direction():
    """Chainage grows the way that the longest pass was driven."""
    road = line_at(length_m=300.0)
    whole = trace_along(road, seed=45, cells=("a",))
    part = trace_along(slice_line(road, 50.0, 200.0), seed=46, cells=("a",))
    assert heading_deg(derive_line([whole, backward(part)]), 10.0) == pytest.approx(90.0, abs=1.0)
    turned = derive_line([backward(whole), part])
    assert heading_deg(turned, 10.0) == pytest.approx(270.0, abs=1.0)


def test_a_standing_car_draws_no_knot():
    """Minutes of jitter at a red light add no length."""
    road = line_at(length_m=300.0)
    trace = trace_along(road, seed=47, step_m=3.0, cells=("a",))
    rng = np.random.default_rng(47)
    x_m = np.concatenate(
        [np.arange(0, 150, 3), 150 + rng.normal(0, 1.5, 90), np.arange(153, 300, 3)]
    )
    y_m = np.concatenate([np.zeros(50), rng.normal(0, 1.5, 90), np.zeros(49)])
    place = FRAME.to_lonlat(x_m, y_m)
    stood = replace(
        trace,
        time_s=np.arange(float(len(x_m))),
        lon=np.asarray(place.lon),
        lat=np.asarray(place.lat),
        rsrp_dbm=np.full((len(x_m), 1), -90.0, dtype=np.float32),
    )
    derived = derive_line([stood])
    assert length_m(derived) == pytest.approx(297.0, abs=5.0)
    assert off_m(derived, road).max() < 2.0


def test_a_pass_that_does_not_move_is_no_road():
    """Jitter about one place is refused with the length it has."""
    trace = trace_along(line_at(length_m=12.0), seed=48, cells=("a",))
    with pytest.raises(RoadTooShort) as refused:
        derive_line([trace])
    assert refused.value.got_m < refused.value.needed_m


def test_a_pass_elsewhere_adds_nothing():
    """A pass that never comes near the longest one does not carry it on."""
    road, elsewhere = line_at(length_m=400.0), line_at(500.0, length_m=200.0, x_m=600.0)
    alone = derive_line([trace_along(road, seed=49, cells=("a",))])
    both = derive_line(
        [trace_along(road, seed=49, cells=("a",)), trace_along(elsewhere, seed=50, cells=("a",))]
    )
    assert length_m(both) == pytest.approx(length_m(alone), abs=1.0)


def test_more_passes_come_nearer():
    """Sixteen noisy passes lie nearer to the road than one does."""
    road = bent_road()
    one, many = (derive_line(drives(road, 51, 3.0, count)) for count in (1, 16))
    assert off_m(many, road).mean() < 0.8 * off_m(one, road).mean()
