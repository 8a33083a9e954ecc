"""Chainage: lengths, places, headings and feet of perpendiculars on bent lines."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from app.domain import Line
from app.numerics.geodesy import LocalFrame, distance_m, wrap_longitude_deg
from app.numerics.lines import (
    heading_deg,
    headings_deg,
    length_m,
    parts_in_range,
    point_at,
    project,
    slice_line,
    vertex_chainage_m,
)

GEOD = Geod(ellps="WGS84")
PLACES = {
    "Los Angeles": (-118.49, 34.01),
    "Sydney": (151.21, -33.87),
    "Tromso": (18.95, 69.65),
    "Taveuni, on the antimeridian": (179.9995, -16.85),
    "Quito": (-78.5, -0.2),
}
at_each_place = pytest.mark.parametrize("origin", PLACES.values(), ids=PLACES)


def bent(origin, seed=5, pieces=8) -> Line:
    """A road of pieces of 20 to 120 m that turns by up to 40 degrees at each vertex."""
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.uniform(-0.7, 0.7, pieces))
    size_m = rng.uniform(20.0, 120.0, pieces)
    x_m = np.concatenate([[0.0], np.cumsum(size_m * np.cos(turn))])
    y_m = np.concatenate([[0.0], np.cumsum(size_m * np.sin(turn))])
    ends = LocalFrame(*origin).to_lonlat(x_m, y_m)
    return Line(ends.lon, ends.lat)


@at_each_place
def test_length_is_the_geodesic_length(origin):
    """Lines are as long as their pieces on the ellipsoid."""
    line = bent(origin)
    assert length_m(line) == pytest.approx(GEOD.line_length(line.lon, line.lat), rel=1e-5)
    assert vertex_chainage_m(line)[0] == 0.0
    assert vertex_chainage_m(line)[-1] == length_m(line)


@at_each_place
def test_a_point_on_the_line_lies_at_its_own_chainage(origin):
    """Projecting the place at a chainage gives the chainage back, with no offset."""
    line = bent(origin)
    chainage_m = np.linspace(0.0, length_m(line), 211)
    place = point_at(line, chainage_m)
    feet = project(line, place.lon, place.lat)
    np.testing.assert_allclose(feet.chainage_m, chainage_m, atol=0.01)
    np.testing.assert_allclose(feet.offset_m, 0.0, atol=1e-3)


@at_each_place
def test_chainage_grows_as_one_travels(origin):
    """Places a metre of chainage apart on one piece are a metre apart on the earth."""
    line = bent(origin)
    vertex_m = vertex_chainage_m(line)
    chainage_m = np.arange(vertex_m[2], vertex_m[3])
    place = point_at(line, chainage_m)
    _, _, steps_m = GEOD.inv(place.lon[:-1], place.lat[:-1], place.lon[1:], place.lat[1:])
    np.testing.assert_allclose(steps_m, 1.0, rtol=1e-4)


@at_each_place
def test_headings_are_the_geodesics(origin):
    """The heading of each piece is its forward azimuth, and a vertex has that of the next piece."""
    line = bent(origin)
    azimuth, _, _ = GEOD.inv(line.lon[:-1], line.lat[:-1], line.lon[1:], line.lat[1:])
    vertex_m = vertex_chainage_m(line)
    middles_m = (vertex_m[1:] + vertex_m[:-1]) / 2.0
    for chainage_m in (middles_m, vertex_m[:-1]):
        turn = (headings_deg(line, chainage_m) - azimuth + 180.0) % 360.0 - 180.0
        np.testing.assert_allclose(turn, 0.0, atol=0.02)
    assert heading_deg(line, length_m(line) + 5.0) == heading_deg(line, float(middles_m[-1]))


@pytest.mark.parametrize(
    ("east_m", "north_m", "heading"), [(0, 9, 0.0), (9, 0, 90.0), (0, -9, 180.0), (-9, 0, 270.0)]
)
def test_compass_headings(east_m, north_m, heading):
    """North is 0 and east 90, and no heading is 360."""
    ends = LocalFrame(-118.49, 34.01).to_lonlat([0.0, east_m], [0.0, north_m])
    found = heading_deg(Line(ends.lon, ends.lat), 1.0)
    assert found == pytest.approx(heading, abs=1e-6)
    assert 0.0 <= found < 360.0


@at_each_place
def test_left_is_positive(origin):
    """A point beside the middle of a piece has its distance as offset, positive to the left."""
    line = bent(origin)
    vertex_m = vertex_chainage_m(line)
    middle_m = (vertex_m[3] + vertex_m[4]) / 2.0
    place, heading = point_at(line, middle_m), heading_deg(line, middle_m)
    for side, azimuth in ((1.0, heading - 90.0), (-1.0, heading + 90.0)):
        lon, lat, _ = GEOD.fwd(float(place.lon), float(place.lat), azimuth, 6.0)
        feet = project(line, np.array([lon]), np.array([lat]))
        assert feet.offset_m[0] == pytest.approx(side * 6.0, abs=0.01)
        assert feet.chainage_m[0] == pytest.approx(middle_m, abs=0.02)


def test_beyond_an_end_the_foot_is_that_end():
    """Points past either end fall on it, with their distance from it as offset."""
    frame = LocalFrame(11.5, 48.1)
    ends = frame.to_lonlat([0.0, 100.0], [0.0, 0.0])
    line = Line(ends.lon, ends.lat)
    past = frame.to_lonlat([-30.0, 130.0, 140.0], [0.0, 0.0, 30.0])
    feet = project(line, past.lon, past.lat)
    np.testing.assert_allclose(feet.chainage_m, [0.0, 100.0, 100.0], atol=1e-3)
    np.testing.assert_allclose(np.abs(feet.offset_m), [30.0, 30.0, 50.0], atol=1e-3)
    assert feet.offset_m[2] > 0
    for chainage_m, end in ((-5.0, 0), (500.0, -1)):
        place = point_at(line, chainage_m)
        assert (float(place.lon), float(place.lat)) == (line.lon[end], line.lat[end])


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    x_m=st.floats(-100, 500),
    y_m=st.floats(-300, 300),
    origin=st.sampled_from(list(PLACES.values())),
)
def test_the_foot_is_the_nearest_place_of_the_line(seed, x_m, y_m, origin):
    """No place of a line, sampled every 0.25 m, is nearer than the foot of the perpendicular."""
    line = bent(origin, seed)
    point = LocalFrame(*origin).to_lonlat([x_m], [y_m])
    feet = project(line, point.lon, point.lat)
    every = point_at(line, np.arange(0.0, length_m(line), 0.25))
    nearest_m = distance_m(every.lon, every.lat, point.lon, point.lat).min()
    foot = point_at(line, feet.chainage_m)
    foot_m = float(distance_m(foot.lon, foot.lat, point.lon, point.lat)[0])
    assert foot_m <= nearest_m + 0.05
    assert abs(feet.offset_m[0]) == pytest.approx(foot_m, rel=1e-3, abs=0.01)


@at_each_place
def test_reversing_the_road_mirrors_the_chainage(origin):
    """From the other end, chainages count down and offsets change sides."""
    line = bent(origin)
    turned = Line(line.lon[::-1].copy(), line.lat[::-1].copy())
    rng = np.random.default_rng(8)
    points = point_at(line, rng.uniform(0.0, length_m(line), 40))
    lon, lat = points.lon + rng.normal(0, 3e-5, 40), points.lat + rng.normal(0, 3e-5, 40)
    there, back = project(line, lon, lat), project(turned, lon, lat)
    np.testing.assert_allclose(back.chainage_m, length_m(line) - there.chainage_m, atol=1e-3)
    np.testing.assert_allclose(back.offset_m, -there.offset_m, atol=1e-3)


@at_each_place
def test_a_slice_is_the_line_between(origin):
    """A slice has the length asked for and lies on the line, bends and all."""
    line = bent(origin)
    vertex_m = vertex_chainage_m(line)
    start_m, end_m = float(vertex_m[1]) + 3.0, float(vertex_m[5]) + 4.0
    part = slice_line(line, start_m, end_m)
    assert length_m(part) == pytest.approx(end_m - start_m, abs=0.01)
    assert len(part.lon) == 2 + 4  # its ends and the vertices between
    along_m = np.linspace(0.0, end_m - start_m, 50)
    place = point_at(part, along_m)
    feet = project(line, place.lon, place.lat)
    np.testing.assert_allclose(feet.chainage_m, start_m + along_m, atol=0.02)
    np.testing.assert_allclose(feet.offset_m, 0.0, atol=1e-3)


def test_a_repeated_vertex_is_a_point():
    """A vertex said twice changes neither length nor feet."""
    line = bent(PLACES["Sydney"])
    order = np.sort(np.concatenate([np.arange(len(line.lon)), [3, 3]]))
    twice = Line(line.lon[order], line.lat[order])
    place = point_at(line, np.linspace(0.0, length_m(line), 60))
    assert length_m(twice) == length_m(line)
    once, again = project(line, place.lon, place.lat), project(twice, place.lon, place.lat)
    np.testing.assert_allclose(again.chainage_m, once.chainage_m, atol=1e-3)


def test_places_across_the_antimeridian_stay_beside_it():
    """Between 179.999 and -179.999 degrees a line's places never pass through Greenwich."""
    line = bent(PLACES["Taveuni, on the antimeridian"])
    assert line.lon.max() > 179.0
    assert line.lon.min() < -179.0
    place = point_at(line, np.linspace(0.0, length_m(line), 300))
    assert np.abs(place.lon).min() > 179.0
    assert np.abs(place.lon).max() <= 180.0


@pytest.mark.parametrize("shift_deg", [0.0, 1e-9, 3e-4, -3e-4])
def test_parts_of_a_line_are_the_line(shift_deg):
    """Cut at the antimeridian nothing is lost, parts meet there, and none runs round the earth."""
    zigzag = np.array([-2.0, -1.0, 0.0, 1.0, 0.5, -0.5, -1.0, 2.0, 3.0]) * 4e-4
    lon = np.asarray(wrap_longitude_deg(180.0 + shift_deg + zigzag))
    line = Line(lon, -16.85 + 1e-4 * np.arange(len(lon)))
    parts = parts_in_range(line)
    assert len(parts) > 2
    assert sum(map(length_m, parts)) == pytest.approx(length_m(line), rel=1e-9)
    for one, other in pairwise(parts):
        assert abs(one.lon[-1]) == 180.0
        assert (one.lon[-1], one.lat[-1]) == (-other.lon[0], other.lat[0])
    for part in parts:
        assert len(part.lon) > 1
        assert np.ptp(part.lon) < 0.01


def test_a_line_that_does_not_cross_is_one_part():
    """Elsewhere, and up to the antimeridian from either side, a line stays as it is."""
    for lon in ([10.0, 10.1, 10.2], [-179.9, -180.0], [179.9, 179.8]):
        line = Line(np.array(lon), np.zeros(len(lon)))
        assert parts_in_range(line) == [line]
    (kept,) = parts_in_range(Line(np.array([179.9, 180.0]), np.zeros(2)))
    assert kept.lon.tolist() == [179.9, 180.0]
