"""Laws of neighbourhoods: near roads share a plane, far ones keep their own metres."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.domain import Line
from app.numerics.geodesy import LocalFrame, LonLat, distance_m, mean_longitude_deg
from app.numerics.graph import RoadGraph
from app.numerics.neighbourhoods import neighbourhoods, planes

TOWNS = {
    "Santa Monica": (-118.49, 34.01),
    "Tromso": (18.95, 69.65),
    "Taveuni": (179.9999, -16.85),
    "Longyearbyen": (15.63, 78.22),
    "Quito": (-78.5, 0.0),
}
anywhere = st.tuples(st.floats(-180.0, 180.0, exclude_max=True), st.floats(-84.0, 84.0))


def road(town: tuple[float, float], *corners: tuple[float, float]) -> Line:
    at = LocalFrame(*town).to_lonlat(*np.array(corners, dtype=float).T)
    return Line(np.asarray(at.lon), np.asarray(at.lat))


@given(anywhere, st.floats(0.0, 21.0), st.floats(0.0, 360.0))
def test_roads_that_are_near_belong_together(town, away_km, bearing_deg):
    """Whatever lies within 21 km of a road is of its neighbourhood, anywhere on the earth."""
    east, north = np.sin(np.radians(bearing_deg)), np.cos(np.radians(bearing_deg))
    x, y = 900.0 * away_km * east, 1000.0 * away_km * north  # a frame stretches x towards the pole
    first = road(town, (0.0, 0.0), (10.0, 0.0))
    second = road(town, (x, y), (x, y + 10.0))
    assert neighbourhoods([first, second]) == [[0, 1]]


def test_towns_are_apart_and_a_road_between_joins_them():
    """Five towns are five neighbourhoods; so are two 60 km apart, until a road joins them."""
    lines = [road(town, (0.0, 0.0), (300.0, 50.0)) for town in TOWNS.values()]
    assert neighbourhoods(lines + lines) == [[n, n + 5] for n in range(5)]
    here = TOWNS["Quito"]
    near, far = road(here, (0.0, 0.0), (9.0, 0.0)), road(here, (60e3, 0.0), (60e3, 9.0))
    between = road(here, *((x, 5.0) for x in np.linspace(0.0, 60e3, 9)))
    assert neighbourhoods([near, far]) == [[0], [1]]
    assert neighbourhoods([near, far, between]) == [[0, 1, 2]]


@pytest.mark.parametrize("town", TOWNS.values(), ids=TOWNS.keys())
def test_metres_of_a_town_do_not_mind_other_towns(town):
    """With all other towns in the map, places 1 km apart are 1 km apart; towns stay far apart."""
    lines = [road(each, (0.0, 0.0), (700.0, 700.0)) for each in (town, *TOWNS.values())]
    found = planes(lines)
    ends = found[0].to_xy(LonLat(lines[0].lon, lines[0].lat))
    true_m = float(distance_m(lines[0].lon[0], lines[0].lat[0], lines[0].lon[1], lines[0].lat[1]))
    assert np.hypot(*(np.diff(ends.x_m), np.diff(ends.y_m))) == pytest.approx(true_m, rel=2e-4)
    for plane, line, each in zip(found[1:], lines[1:], TOWNS.values(), strict=True):
        there = plane.to_xy(LonLat(line.lon, line.lat))
        gap_m = np.hypot(there.x_m[0] - ends.x_m[0], there.y_m[0] - ends.y_m[0])
        assert (gap_m < 1.0) if each == town else (gap_m > 500e3)


def test_one_town_keeps_the_plane_it_always_had():
    """A map of one neighbourhood lies about the plain mean of its roads' first vertices."""
    lines = [road(TOWNS["Tromso"], (x, 0.0), (x, 90.0)) for x in (0.0, 500.0, 900.0)]
    frame = LocalFrame(
        float(np.mean([line.lon[0] for line in lines])),
        float(np.mean([line.lat[0] for line in lines])),
    )
    assert {(plane.frame, plane.east_m, plane.north_m) for plane in planes(lines)} == {
        (frame, 0.0, 0.0)
    }
    assert planes([]) == []


def test_the_mean_of_both_sides_of_the_antimeridian_lies_on_it():
    """The middle of 179.9 and -179.9 degrees is 180 degrees, not Greenwich."""
    assert mean_longitude_deg([179.9, -179.9]) == pytest.approx(-180.0)
    assert mean_longitude_deg([179.9, -179.7]) == pytest.approx(-179.9)
    assert mean_longitude_deg([10.0, 11.0, 30.0]) == 17.0


@pytest.mark.parametrize("town", TOWNS.values(), ids=TOWNS.keys())
def test_a_junction_reaches_as_far_in_every_town(town):
    """Lines 15 m apart are linked and lines 30 m apart are not, whatever else is in the map."""
    elsewhere = [road(each, (0.0, 900.0), (300.0, 900.0)) for each in TOWNS.values()]
    street = road(town, (0.0, -100.0), (0.0, 100.0))
    near, far = road(town, (15.0, 0.0), (200.0, 0.0)), road(town, (-30.0, 0.0), (-200.0, 0.0))
    links = RoadGraph.of([*elsewhere, street, near, far]).links
    number = len(elsewhere)
    assert [link.road for link in links[number]] == [number + 1]
    assert links[number][0].at_m == pytest.approx(100.0, abs=0.1)
    assert links[number + 2] == ()
