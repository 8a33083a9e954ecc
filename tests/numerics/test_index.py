"""A map in memory: all roads, all cells, places where they belong, many roads at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, Line, RadioMap
from app.numerics.carriers import columns_of
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.geodesy import LocalFrame
from app.numerics.index import MapIndex
from app.numerics.lines import headings_deg, point_at
from app.numerics.matching import locate
from app.numerics.tapes import COARSE_STEPS_M, GAP, salient_cells
from tests.factories import line_at, model_of
from tests.numerics.tiny import gentle_models, map_of, window_along


def test_an_index_knows_its_map():
    """Version, roads in their order, and the union of all roads' cells."""
    index = map_of(gentle_models(500))
    assert index.version == 3
    assert index.road_ids == ("road-0", "road-1", "road-2")
    assert set(index.cells) == {"a", "b", "c", "d", "e"}
    assert index.calibration == Calibration()


def test_fixes_lie_on_their_roads():
    """The position, heading and candidates of a fix are those of its chainage on the line."""
    ends = LocalFrame(-118.49, 34.01).to_lonlat([0.0, 70.0, 90.0, 200.0], [0.0, 10.0, 70.0, 90.0])
    line = Line(np.asarray(ends.lon), np.asarray(ends.lat))
    model = model_of("bent", seed=3, line=line, cells=("a", "b"), step_m=1.0)
    model = replace(model, length_m=len(model.mean_dbm) - 1.0)
    index = map_of((model,))
    for seed in range(8):
        fix = locate(index, window_along(model, seed, sign=1 if seed % 2 else -1))
        place = point_at(line, fix.chainage_m)
        assert fix.lon == pytest.approx(float(place.lon), abs=5e-6)
        assert fix.lat == pytest.approx(float(place.lat), abs=5e-6)
        along_deg = headings_deg(line, np.array([np.floor(fix.chainage_m)]))[0]
        backward = 0.0 if fix.direction.sign > 0 else 180.0
        turn_deg = (fix.heading_deg - along_deg - backward + 180.0) % 360.0 - 180.0
        assert turn_deg == pytest.approx(0.0, abs=1e-6)
        for one in fix.candidates:
            there = point_at(line, one.chainage_m)
            assert one.lon == pytest.approx(float(there.lon), abs=5e-6)
            segment = model.segments[one.segment_index]
            assert segment.start_m - 1.0 <= one.chainage_m <= segment.end_m + 1.0


def on_taveuni(models):
    """The models moved to where the antimeridian crosses the roads, one of them the other way."""
    return at_place(models, LocalFrame(179.9999, -16.85))


def at_place(models, frame: LocalFrame):
    """The models side by side about a place, one of them the other way."""
    for i, model in enumerate(models):
        x_m = [-30.0, 30.0] if i % 2 else [30.0, -30.0]
        ends = frame.to_lonlat(x_m, [15.0 * i, 15.0 * i])
        yield replace(model, line=Line(np.asarray(ends.lon), np.asarray(ends.lat)))


def test_roads_on_both_sides_of_the_antimeridian_are_neighbours():
    """On Taveuni fixes lie on the island, with radii of metres, not in Greenwich."""
    models = gentle_models(510)[:2]
    index = map_of(tuple(on_taveuni(models)))
    for seed in range(40):
        window = window_along(models[seed % 2], seed, sign=1 if seed % 3 else -1)
        fix = locate(index, window)
        assert fix.accuracy_m < 100.0
        assert all(abs(one.lon) > 179.9 for one in (fix, *fix.candidates))


def test_chainages_do_not_mind_the_antimeridian():
    """Where a road lies on the earth moves no chainage, road or direction."""
    models = gentle_models(510)
    index = map_of(tuple(at_place(models, LocalFrame(10.0, -16.85))))
    moved = map_of(tuple(on_taveuni(models)))
    for seed in range(9):
        window = window_along(models[seed % 3], seed)
        here, there = locate(index, window), locate(moved, window)
        assert (there.road_id, there.direction) == (here.road_id, here.direction)
        assert there.chainage_m == pytest.approx(here.chainage_m, abs=1e-6)


def test_a_far_town_changes_no_radius():
    """A road of another continent in the map leaves positions and radii where they were."""
    models = gentle_models(520)
    ends = LocalFrame(18.95, 69.65).to_lonlat([0.0, 60.0], [0.0, 0.0])
    far = model_of("far", seed=1, line=Line(ends.lon, ends.lat), cells=("n",), step_m=1.0)
    known = np.where(np.isnan(far.mean_dbm), np.float32(0.0), far.heard)  # "n" alone is heard there
    far = replace(far, length_m=59.0, heard=known)
    alone, together = map_of(models), map_of((*models, far))
    for seed in range(6):
        window = window_along(models[seed % 3], seed, samples=16)
        here, there = locate(alone, window), locate(together, window)
        assert there.chainage_m == pytest.approx(here.chainage_m, abs=1e-9)
        assert there.accuracy_m == pytest.approx(here.accuracy_m, rel=0.02)


def test_order_of_roads_moves_no_answer():
    """A map's roads in another order give the same fix."""
    models = gentle_models(530)
    index, turned = map_of(models), map_of(models[::-1])
    for seed in range(9):
        window = window_along(models[seed % 3], seed)
        here, there = locate(index, window), locate(turned, window)
        assert there.road_id == here.road_id
        assert there.chainage_m == pytest.approx(here.chainage_m, abs=1e-6)
        assert there.road_posterior == pytest.approx(here.road_posterior, abs=1e-6)


def test_many_roads_share_tapes_and_none_is_lost():
    """Of 80 roads of 300 m, windows find the exhaustive answer, whatever tape it lies on."""
    rng = np.random.default_rng(540)
    models = []
    for i in range(80):
        model = model_of(
            f"r{i}",
            seed=i,
            line=line_at(60.0 * (i % 20), length_m=300.0, x_m=400.0 * (i // 20)),
            cells=(f"{i % 7}", f"{i % 11}x"),
            step_m=1.0,
        )
        level_dbm = -95.0 + np.cumsum(rng.normal(0.0, 0.8, model.mean_dbm.shape), axis=0)
        models.append(
            replace(
                model,
                mean_dbm=level_dbm.astype(np.float32),
                spread_db=np.full_like(model.spread_db, 2.0),
                heard=np.full_like(model.heard, 0.9),
                length_m=len(level_dbm) - 1.0,
            )
        )
    index = map_of(tuple(models))
    assert len(index.tapes) > 1
    assert sorted(number for tape in index.tapes for number in tape.roads) == list(range(80))
    for number in range(0, 80, 7):
        window = window_along(models[number], number, samples=15)
        fix, slow = locate(index, window), locate_exhaustively(index, window)
        assert fix.road_id == slow.road_id
        # Of 48 km of places, unlikely ones hold some percent together, which no short list keeps.
        assert fix.road_posterior == pytest.approx(slow.road_posterior, abs=0.05)


def test_tapes_hold_all_cells_and_know_the_salient_ones():
    """The coarse scale compares by every cell, and looks where one that a mask names is heard."""
    models = gentle_models(550)
    index = map_of(models)
    for tape in index.tapes:
        roads = [models[number] for number in tape.roads]
        cells = sorted({cell for model in roads for cell in model.cells})
        assert tape.column.cell == columns_of(cells)
        assert tape.salient == {cell for model in roads for cell in salient_cells(model)}


def test_windows_of_any_length_are_served():
    """From one sample to beyond the coarsest tape's reach, every window has an answer."""
    models = gentle_models(560)
    index = map_of(models)
    rng = np.random.default_rng(560)
    for length_m in (0.0, 1.0, *(step * (GAP - 1) for step in COARSE_STEPS_M), 401.0, 5000.0):
        distance_m = np.linspace(0.0, length_m, 40)
        window = replace(
            window_along(models[0], 1),
            cells=("a", "b"),
            distance_m=distance_m,
            rsrp_dbm=rng.uniform(-110.0, -80.0, (40, 2)),
        )
        fix = locate(index, window)
        total = sum(one.posterior for one in fix.candidates) + fix.off_map_posterior
        assert total == pytest.approx(1.0, abs=1e-9)


def test_a_map_of_one_road_answers():
    """One road is a map, and off it is still a possibility."""
    model = gentle_models(570)[0]
    fix = locate(MapIndex.build(RadioMap(1, (model,), Calibration())), window_along(model, 4))
    assert fix.road_id == model.road_id
    assert fix.road_posterior == pytest.approx(1.0 - fix.off_map_posterior, abs=1e-9)
