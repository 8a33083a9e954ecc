"""Roads that appear from drives: the streets, all of them, and nothing but the streets."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from app.numerics.geodesy import LocalFrame
from app.numerics.network.nouns import KnownRoad
from tests.numerics.network.towns import (
    HERE,
    drive,
    find,
    grid_drives,
    grid_streets,
    lies_on,
    lines_of,
    way,
)

PLACES = {
    "California": HERE,
    "across the antimeridian": LocalFrame(179.998, -17.0),
    "south": LocalFrame(151.21, -33.87),
    "60 degrees north": LocalFrame(24.94, 60.17),
}


def assert_grid(found, frame=HERE, streets=None):
    lines = lines_of(found, frame)
    for street in streets or grid_streets():
        best = max(lies_on(street, line, 6.0) for line in lines.values())
        assert best >= 0.9, (street, best)


@pytest.mark.parametrize("place", PLACES)
def test_every_street_of_a_grid_is_one_road(place):
    """Eight streets, eight roads, straight over every crossing, anywhere on the globe."""
    frame = PLACES[place]
    found = find(grid_drives(frame=frame))
    assert len(found.lines) == 8
    assert_grid(found, frame)


def test_the_order_of_the_drives_moves_nothing():
    """Shuffled drives make the same lines to the centimetre."""
    drives = grid_drives()
    rng = np.random.default_rng(8)
    lines = sorted(lines_of(find(drives)).values(), key=lambda line: line.coords[0])
    shuffled = find([drives[i] for i in rng.permutation(len(drives))])
    again = sorted(lines_of(shuffled).values(), key=lambda line: line.coords[0])
    assert len(lines) == len(again)
    for one, other in zip(lines, again, strict=True):
        assert one.hausdorff_distance(other) < 0.01


def test_the_same_drives_twice_make_the_same_roads():
    """A second copy of every drive adds passes, and no road."""
    drives = grid_drives()
    copies = [drive_again(one) for one in drives]
    found = find([*drives, *copies])
    assert len(found.lines) == 8
    assert_grid(found)


def drive_again(one):
    return type(one)(one.drive_id + "-again", one.lon, one.lat, one.time_s, one.new)


def test_parallel_streets_40_m_apart_stay_two():
    """Even with 5 m of error, and however often they are driven."""
    drives = [
        drive(way((0.0, y), (600.0, y)), seed=100 * n + int(y), noise_m=5.0)
        for n in range(4)
        for y in (0.0, 40.0)
    ]
    found = lines_of(find(drives))
    assert len(found) == 2
    middles = sorted(line.centroid.y for line in found.values())
    assert middles == pytest.approx([0.0, 40.0], abs=4.0)


def test_both_directions_are_one_road():
    """Lanes 8 m apart, driven each its own way, are one street with passes both ways."""
    drives = [drive(way((0.0, -4.0), (500.0, -4.0)), seed=n) for n in range(3)]
    drives += [drive(way((500.0, 4.0), (0.0, 4.0)), seed=10 + n) for n in range(3)]
    found = find(drives)
    assert len(found.lines) == 1
    assert all(len(along) == 1 for along in found.passes.values())


def test_a_bridge_over_a_road_welds_nothing():
    """Two roads that cross and that nobody turns between stay two, each unbroken."""
    drives = [drive(way((-400.0, 0.0), (400.0, 0.0)), seed=n) for n in range(2)]
    drives += [drive(way((0.0, -400.0), (0.0, 400.0)), seed=10 + n) for n in range(2)]
    found = find(drives)
    assert sorted(round(line.length, -2) for line in lines_of(found).values()) == [800.0, 800.0]
    assert all(len(along) == 1 for along in found.passes.values())


def test_a_u_turn_is_two_passes_of_one_road():
    """There and back is driven once each way; the turning place is no road."""
    there_and_back = way((0.0, 0.0), (500.0, 0.0), (500.0, 8.0), (0.0, 8.0))
    found = find([drive(there_and_back, seed=4, noise_m=1.0)])
    assert len(found.lines) == 1
    (along,) = found.passes.values()
    assert len(along) == 2
    assert along[0].end_sample <= along[1].first_sample + 6


def test_a_loop_round_a_block_is_found_whole():
    """A block driven round twice: every side lies on a road, and no stretch on two."""
    sides = [(0.0, 0.0), (200.0, 0.0), (200.0, 160.0), (0.0, 160.0), (0.0, 0.0)]
    found = find([drive(way(*sides, *sides[1:]), seed=6, noise_m=2.0)])
    lines = lines_of(found)
    assert 600.0 < sum(line.length for line in lines.values()) < 760.0
    for a, b in itertools.pairwise(sides):
        assert max(lies_on((a, b), line, 10.0) for line in lines.values()) > 0.8


def test_a_corner_without_a_crossing_divides_nothing():
    """A road that turns sharply where no other one meets it is one road."""
    bent = way((0.0, 0.0), (400.0, 0.0), (400.0, 300.0), (800.0, 300.0))
    found = find([drive(bent, seed=n, noise_m=2.0) for n in range(3)])
    (line,) = lines_of(found).values()
    assert line.length == pytest.approx(1100.0, rel=0.04)  # corners are rounded off
    assert lies_on(((0.0, 0.0), (400.0, 0.0)), line, 12.0) > 0.95


def test_one_drive_once_is_worth_a_road():
    """A first survey of a single street gives that street."""
    found = find([drive(way((0.0, 0.0), (300.0, 0.0)), seed=1)])
    assert len(found.lines) == 1
    ((stretch,),) = found.passes.values()
    assert (stretch.first_sample, stretch.end_sample) == (0, 35)


def test_a_car_park_is_no_road():
    """Shunting about on 40 m of asphalt beside a street adds no road to it."""
    rng = np.random.default_rng(9)
    turns = rng.uniform(-20.0, 20.0, (25, 2)) + np.array([300.0, 60.0])
    street = way((0.0, 0.0), (300.0, 0.0))
    parking = way((300.0, 0.0), *map(tuple, turns), (300.0, 0.0), every_m=3.0)
    tour = np.concatenate([street, parking, way((300.0, 0.0), (600.0, 0.0))])
    lines = lines_of(find([drive(tour, seed=2, noise_m=1.0)]))
    assert len(lines) <= 2
    assert all(line.length > 200.0 for line in lines.values())


def test_wild_jumps_make_no_road():
    """Fixes kilometres off, now and then, leave the street alone."""
    places = way((0.0, 0.0), (900.0, 0.0))
    rng = np.random.default_rng(12)
    wild = places.copy()
    wild[rng.choice(len(places), 12, replace=False)] += rng.normal(0.0, 2000.0, (12, 2))
    (line,) = lines_of(find([drive(wild, seed=3, noise_m=1.0)])).values()
    assert line.length == pytest.approx(900.0, abs=30.0)


def test_a_given_road_stays_and_takes_its_drives():
    """Drives along a drawn road are its passes; only what leads away from it is a new road."""
    drawn = find([drive(way((0.0, 0.0), (600.0, 0.0)), seed=1, noise_m=0.0)])
    (line,) = drawn.lines.values()
    known = [KnownRoad("main-street", line, given=True)]
    turning = way((0.0, 0.0), (300.0, 0.0), (300.0, 400.0))
    found = find([drive(turning, seed=n) for n in (5, 6)], known)
    (side,) = lines_of(found).values()
    assert lies_on(((300.0, 30.0), (300.0, 400.0)), side, 6.0) > 0.95
    assert side.length < 440.0
    for along in found.passes.values():
        assert [each.road_id for each in along] == ["main-street", "r0"]
