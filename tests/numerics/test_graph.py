"""The road graph: where roads meet, from their lines alone."""

from __future__ import annotations

import numpy as np
import pytest

from app.domain import Line
from app.numerics.graph import REACH_M, RoadGraph
from app.numerics.lines import point_at
from tests.factories import FRAME, line_at


def line_through(*points_m: tuple[float, float]) -> Line:
    x_m, y_m = np.array(points_m).T
    place = FRAME.to_lonlat(x_m, y_m)
    return Line(np.asarray(place.lon), np.asarray(place.lat))


def meetings(*lines: Line) -> list[list[tuple[int, float, float]]]:
    graph = RoadGraph.of(lines)
    return [[(one.road, one.at_m, one.there_m) for one in links] for links in graph.links]


def test_roads_that_cross_are_linked_where_they_do():
    """A crossing has its chainage on both roads."""
    east, north = line_through((0, 0), (400, 0)), line_through((150, -90), (150, 300))
    first, second = meetings(east, north)
    assert first == [(1, pytest.approx(150, abs=0.5), pytest.approx(90, abs=0.5))]
    assert second == [(0, pytest.approx(90, abs=0.5), pytest.approx(150, abs=0.5))]


def test_ends_that_nearly_touch_are_linked():
    """A T-junction and a road drawn on as another road, each some metres short of meeting."""
    through = line_through((0, 0), (300, 0))
    stem, onward = line_through((120, 12), (120, 200)), line_through((308, 4), (600, 4))
    first, second, third = meetings(through, stem, onward)
    assert [(road, round(at_m)) for road, at_m, _ in first] == [(1, 120), (2, 300)]
    assert second == [(0, pytest.approx(0, abs=0.5), pytest.approx(120, abs=0.5))]
    assert third == [(0, pytest.approx(0, abs=0.5), pytest.approx(300, abs=0.5))]


def test_roads_apart_are_not_linked():
    """Nor a road with itself, however it winds."""
    bent = line_through((0, 0), (100, 0), (100, 8), (0, 8))
    assert meetings(bent, line_at(8.0 + REACH_M + 1.0)) == [[], []]


def test_two_roads_may_meet_twice():
    """A road that comes back meets the other a second time."""
    straight = line_through((0, 0), (600, 0))
    horseshoe = line_through((100, 150), (100, -150), (450, -150), (450, 150))
    first, _ = meetings(straight, horseshoe)
    assert [round(at_m) for _, at_m, _ in first] == [100, 450]


def test_every_link_is_where_the_lines_are_near():
    """On random streets, against points drawn along both lines."""
    rng = np.random.default_rng(11)
    lines = [
        line_through(tuple(rng.uniform(0, 800, 2)), tuple(rng.uniform(0, 800, 2)))
        for _ in range(12)
    ]
    graph = RoadGraph.of(lines)
    along = [FRAME.to_xy(*_points(line)) for line in lines]
    for i, links in enumerate(graph.links):
        linked = {link.road for link in links}
        for link in links:
            here, there = point_at(lines[i], link.at_m), point_at(lines[link.road], link.there_m)
            a, b = FRAME.to_xy(here.lon, here.lat), FRAME.to_xy(there.lon, there.lat)
            assert np.hypot(a.x_m - b.x_m, a.y_m - b.y_m) <= REACH_M + 0.1
        for j in set(range(len(lines))) - linked - {i}:
            dx = along[i].x_m[:, None] - along[j].x_m
            dy = along[i].y_m[:, None] - along[j].y_m
            assert np.hypot(dx, dy).min() > REACH_M - 1.0


def _points(line: Line) -> tuple[np.ndarray, np.ndarray]:
    place = point_at(line, np.linspace(0.0, 1200.0, 1201))
    return place.lon, place.lat


def test_a_map_without_roads_has_no_links():
    """Nothing is nothing, not an error."""
    assert RoadGraph.of([]).links == ()
