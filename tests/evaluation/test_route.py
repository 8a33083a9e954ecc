"""A drive is followed along its route: where it goes twice, where positions jump, either way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Direction, Line, Trace
from app.evaluation.route import follow, odometer_m
from app.evaluation.route_line import draw_line
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import length_m, point_at, project

FRAME = LocalFrame(7.41, 51.49)
SPEED_MPS = 12.0


def line_of(*corners_m: tuple[float, float]) -> Line:
    place = FRAME.to_lonlat(*np.array(corners_m, dtype=float).T)
    return Line(place.lon, place.lat)


HAIRPIN = line_of((0, 0), (1500, 0), (1500, 6), (0, 6), (0, 900))  # back along the same street


def driven(line: Line, seed: int, way: Direction = Direction.FORWARD, noise_m: float = 5.0):
    """A drive at 1 Hz with noisy positions: the trace and its true chainage."""
    rng = np.random.default_rng(seed)
    chainage_m = np.arange(5.0, length_m(line) - 5.0, SPEED_MPS)
    if way is Direction.BACKWARD:
        chainage_m = chainage_m[::-1]
    place = point_at(line, chainage_m)
    xy = FRAME.to_xy(place.lon, place.lat)
    east, north = rng.normal(0.0, noise_m, size=(2, len(chainage_m)))
    seen = FRAME.to_lonlat(xy.x_m + east, xy.y_m + north)
    time_s = np.arange(len(chainage_m), dtype=float)
    rsrp_dbm = np.full((len(time_s), 1), -90.0, dtype=np.float32)
    return Trace(("1:1",), time_s, seen.lon, seen.lat, rsrp_dbm), chainage_m


def travelled(trace: Trace) -> np.ndarray:
    return odometer_m(trace.time_s, np.full(len(trace.time_s), SPEED_MPS))


@pytest.mark.parametrize("way", Direction)
def test_a_street_that_is_driven_twice_is_told_apart(way):
    """There and back lie 6 m apart, less than positions are wrong: the nearest place jumps."""
    trace, truth_m = driven(HAIRPIN, 1, way)
    nearest_m = project(HAIRPIN, trace.lon, trace.lat).chainage_m
    assert np.abs(nearest_m - truth_m).max() > 500.0
    found = follow(HAIRPIN, trace, travelled(trace))
    assert found.direction is way
    known = ~np.isnan(found.chainage_m)
    assert known.mean() > 0.95
    assert np.abs(found.chainage_m - truth_m)[known].max() < 12.0
    assert np.median(np.abs(found.chainage_m - truth_m)[known]) < 2.0


def test_a_drive_never_goes_back():
    """Chainages grow with the drive, whatever the positions do."""
    trace, _ = driven(HAIRPIN, 2, noise_m=15.0)
    chainage_m = follow(HAIRPIN, trace, travelled(trace)).chainage_m
    assert (np.diff(chainage_m[~np.isnan(chainage_m)]) >= 0.0).all()


def test_jumps_are_bridged_by_the_odometer():
    """A handful of positions kilometres off change nothing."""
    trace, truth_m = driven(HAIRPIN, 3)
    lat = trace.lat.copy()
    lat[100:104] += 0.03
    found = follow(HAIRPIN, replace(trace, lat=lat), travelled(trace)).chainage_m
    assert np.abs(found - truth_m)[95:110].max() < 12.0


def test_a_stretch_without_positions_has_no_truth():
    """Where nothing bears witness for long, nothing is claimed; the rest is as it was."""
    trace, truth_m = driven(HAIRPIN, 4)
    lat = trace.lat.copy()
    lat[100:140] += 0.03
    found = follow(HAIRPIN, replace(trace, lat=lat), travelled(trace)).chainage_m
    assert np.isnan(found[110:130]).all()
    later = np.abs(found - truth_m)[150:-5]
    assert np.nanmax(later) < 12.0
    assert np.isnan(later).mean() < 0.05


def test_what_lies_beyond_the_ends_is_not_on_the_line():
    """A drive that began before the line does has no chainage there."""
    longer = line_of((-400, 0), (1500, 0))
    trace, _ = driven(longer, 5)
    found = follow(line_of((0, 0), (1500, 0)), trace, travelled(trace)).chainage_m
    assert np.isnan(found[:30]).all()
    assert not np.isnan(found[50:100]).any()


def test_without_an_odometer_positions_decide():
    """Less exact, but the same way along the line."""
    trace, truth_m = driven(HAIRPIN, 6)
    found = follow(HAIRPIN, trace, None).chainage_m
    assert np.nanmedian(np.abs(found - truth_m)) < 12.0


def test_the_odometer_is_the_integral_of_the_speed():
    """Trapezoids; a negative speed stands."""
    time_s = np.array([0.0, 1.0, 3.0, 4.0])
    np.testing.assert_allclose(
        odometer_m(time_s, np.array([10.0, 12.0, -1.0, 4.0])), [0.0, 11.0, 23.0, 25.0]
    )


def test_the_line_of_many_drives_is_nearer_than_their_positions():
    """Drawn from twelve drives, some the other way; at the ends 50 m may be missing."""
    route = line_of((0, 0), (900, 0), (900, 700), (1700, 700))
    drives = [
        driven(route, seed, Direction.BACKWARD if seed % 4 == 3 else Direction.FORWARD)[0]
        for seed in range(10, 22)
    ]
    line = draw_line(drives, [travelled(trace) for trace in drives])
    away_m = np.abs(project(route, line.lon, line.lat).offset_m)
    assert np.median(away_m) < 2.5
    assert away_m.max() < 10.0
    assert length_m(route) - 100.0 < length_m(line) < 1.01 * length_m(route)
    ends_m = project(route, line.lon[[0, -1]], line.lat[[0, -1]]).chainage_m
    assert ends_m.min() < 50.0  # it runs the way of the drive that it begins with
    assert ends_m.max() > length_m(route) - 50.0
