"""Roads keep their ids as drives come in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.numerics.network.nouns import KnownRoad
from tests.numerics.network.towns import BLOCK_M, drive, find, grid_drives, lines_of, way


class Store:
    """What a store would remember between builds."""

    def __init__(self) -> None:
        self.drives, self.lines, self.count = [], {}, 0

    def take_in(self, drives):
        """One build."""
        self.drives = [replace(one, new=False) for one in self.drives]
        self.count += 1
        known = [KnownRoad(road_id, line, given=False) for road_id, line in self.lines.items()]
        found = find([*self.drives, *drives], known, prefix=f"build-{self.count}-")
        self.drives += drives
        self.lines = {k: v for k, v in self.lines.items() if k not in found.gone} | found.lines
        return found


def test_more_drives_along_known_roads_change_no_id():
    """A second round over the same streets moves no id, and hardly a line."""
    store = Store()
    store.take_in(grid_drives())
    before = set(store.lines)
    again = [replace(one, drive_id=f"again-{one.drive_id}") for one in grid_drives(noise_m=4.0)]
    found = store.take_in(again)
    assert set(store.lines) == before
    assert not found.gone


def test_a_road_that_grows_keeps_its_id():
    """A drive that goes on beyond the end lengthens the road."""
    store = Store()
    store.take_in([drive(way((0.0, 0.0), (400.0, 0.0)), seed=1)])
    (road_id,) = store.lines
    found = store.take_in([drive(way((200.0, 0.0), (3000.0, 0.0)), seed=2)])
    assert set(store.lines) == {road_id}
    assert lines_of(found)[road_id].length > 2950.0


def test_a_road_that_is_cut_keeps_its_id_on_the_longer_part():
    """Streets that come to cross a winding first drive divide it; the first id stays in use."""
    store = Store()
    store.take_in([drive(way((0.0, 0.0), (900.0, 0.0), (900.0, 400.0)), seed=1)])
    (road_id,) = store.lines
    store.take_in([drive(way((900.0, -400.0), (900.0, 800.0)), seed=n) for n in (2, 3)])
    store.take_in([drive(way((0.0, 0.0), (1500.0, 0.0)), seed=n) for n in (4, 5)])
    assert road_id in store.lines
    assert len(store.lines) == 2


def test_drives_in_any_order_and_any_portions_give_the_same_streets():
    """One build, or five with a few drives each: the same eight streets within metres."""
    rng = np.random.default_rng(21)
    drives = grid_drives()
    at_once = lines_of(find(drives)).values()
    store = Store()
    for part in np.array_split(rng.permutation(len(drives)), 5):
        store.take_in([drives[i] for i in part])
    stepwise = lines_of(type("F", (), {"lines": store.lines})).values()
    assert len(stepwise) == len(at_once) == 8
    for one in at_once:
        assert min(one.hausdorff_distance(other) for other in stepwise) < 12.0


def test_what_lies_far_from_new_drives_is_left_alone():
    """A new drive at one end of town gives no new line to roads at the other."""
    store = Store()
    store.take_in(grid_drives())
    far = 20 * BLOCK_M
    found = store.take_in([drive(way((far, 0.0), (far + 500.0, 0.0)), seed=90)])
    assert len(found.lines) == 1
    assert not found.gone


def test_a_long_road_does_not_creep():
    """Twenty additions at one end leave the other end, a corner too, where it was."""
    store = Store()
    store.take_in([drive(way((0.0, 300.0), (0.0, 0.0), (900.0, 0.0)), seed=1, noise_m=0.5)])
    (road_id,) = store.lines
    first = next(iter(lines_of(type("F", (), {"lines": store.lines})).values()))
    for n in range(6):
        begins = 600.0 + n * 200.0
        store.take_in([drive(way((begins, 0.0), (begins + 500.0, 0.0)), seed=50 + n, noise_m=0.5)])
    assert set(store.lines) == {road_id}
    last = lines_of(type("F", (), {"lines": store.lines}))[road_id]
    corner = first.interpolate(0.0), first.interpolate(300.0)
    assert all(last.distance(place) < 3.0 for place in corner)
    assert last.length > 2300.0


def test_a_short_dead_end_outlives_drives_elsewhere():
    """A stub that few drove stays a road when a drive comes by that does not see it."""
    store = Store()
    street = way((0.0, 0.0), (1500.0, 0.0))
    stub = way((1300.0, 0.0), (1300.0, 170.0))
    store.take_in([drive(stub, seed=1), drive(street, seed=2)])
    before = set(store.lines)
    assert len(before) == 2
    for n in range(8):
        found = store.take_in([drive(way((0.0, 0.0), (700.0 + 40.0 * n, 0.0)), seed=30 + n)])
        assert not found.gone
    assert set(store.lines) == before
