"""Boxes hold their points and meet their like, across the antimeridian too."""

from __future__ import annotations

import numpy as np
import pytest

from app.domain import Line, Road
from app.store import roads
from app.store.bounds import bounds_of, touches, union, widened
from app.store.engine import read, write
from app.store.records import Bounds

FIJI = Bounds(179.5, -17.0, -179.5, -16.0)


@pytest.mark.parametrize(
    ("lon", "west", "east"),
    [
        ([10.0, 11.0, 10.5], 10.0, 11.0),
        ([5.0], 5.0, 5.0),
        ([179.9, -179.9, 180.0], 179.9, -179.9),
        ([-179.9, 179.8], 179.8, -179.9),
        ([-170.0, 0.0, 170.0], 0.0, -170.0),
    ],
)
def test_the_smallest_box_is_found(lon, west, east):
    """The box leaves out the widest gap between longitudes, be it at the antimeridian or not."""
    box = bounds_of(lon, np.zeros(len(lon)))
    assert (box.west, box.east) == (west, east)


def test_a_union_holds_both():
    """Two boxes on either side of the antimeridian unite across it."""
    both = union(Bounds(179.0, -17.0, 179.9, -16.5), Bounds(-179.9, -16.8, -179.0, -16.0))
    assert both == Bounds(179.0, -17.0, -179.0, -16.0)


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        (FIJI, ["across", "east", "west"]),
        (Bounds(179.95, -17.0, 180.0, -16.0), ["across"]),
        (Bounds(-179.9, -17.0, -179.0, -16.0), ["across", "east"]),
        (Bounds(178.0, -17.0, 179.7, -16.0), ["west"]),
        (Bounds(0.0, -17.0, 10.0, -16.0), []),
        (Bounds(-180.0, -90.0, 180.0, 90.0), ["across", "east", "west"]),
        (Bounds(179.0, 16.0, -179.0, 17.0), []),
        (widened(Bounds(-179.95, -17.0, -179.94, -16.0), 0.2), ["across", "east"]),
        (widened(Bounds(179.93, -17.0, 179.94, -16.0), 0.3), ["across", "east", "west"]),
    ],
)
def test_roads_about_the_antimeridian_are_found(engine, box, expected):
    """A box finds the roads it touches, whichever of the two holds the antimeridian."""
    lines = {
        "west": Line(np.array([179.6, 179.7]), np.array([-16.5, -16.5])),
        "across": Line(np.array([179.9, -179.9]), np.array([-16.5, -16.5])),
        "east": Line(np.array([-179.8, -179.7]), np.array([-16.5, -16.5])),
    }
    with write(engine) as connection:
        for road_id, line in lines.items():
            roads.put_road(connection, Road(road_id, None, line))
    with read(engine) as connection:
        assert [road_id for road_id, _ in roads.lines_near(connection, box)] == expected


@pytest.mark.parametrize("lon", [-180.0, 180.0, -179.999, 179.999, 0.0])
def test_a_widened_box_reaches_what_is_near(lon):
    """By as many metres eastward as northward, north and south of the equator, across the line."""
    for lat in (-65.0, 0.0, 65.0):
        box = bounds_of([lon], [lat])
        wide = widened(box, 0.01)
        assert abs(wide.west) <= 180.0 >= abs(wide.east)
        for east in (-0.0099, 0.0099):
            there = (lon + east / np.cos(np.radians(lat)) + 180.0) % 360.0 - 180.0
            assert touches(wide, bounds_of([there], [lat]))
        assert not touches(wide, bounds_of([(lon + 0.1 + 180.0) % 360.0 - 180.0], [lat]))


def test_the_whole_earth_touches_everything():
    """A box of 360 degrees is no box of none, nor is one that was widened to it."""
    for earth in (Bounds(-180.0, -90.0, 180.0, 90.0), widened(Bounds(-179.0, -80, 178, 80), 2.0)):
        for lon in (-180.0, -90.0, 0.0, 120.0, 179.9):
            one = Bounds(lon, 10.0, lon, 10.0)
            assert touches(earth, one)
            assert touches(one, earth)
