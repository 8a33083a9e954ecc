"""Road models come back as they were built, and a serving process reads blobs only."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import sqlalchemy as sa

from app.domain import Calibration, Reliability, Road
from app.store import builds, catalog, models, roads, versions
from app.store.columns import utc_now
from app.store.engine import read, write
from app.store.records import Bounds
from app.store.tables import map_versions
from tests.factories import CELLS, line_at, model_of

ARRAYS = ("mean_dbm", "spread_db", "heard", "features", "evidence", "unseen")
CALIBRATION = Calibration(0.3, 0.05, reliability=Reliability(9, curve=((0.9, 1.0, 9),), ece=0.1))


@pytest.fixture
def build_id(engine):
    """A build under way of the roads r1 and r2."""
    with write(engine) as connection:
        roads.note_cells(connection, CELLS)
        for road_id in ("r1", "r2"):
            roads.put_road(connection, Road(road_id))
        made = builds.insert_build(connection, activate=True, due_at=utc_now())
        builds.add_roads(connection, made, ["r1", "r2"])
        builds.begin(connection, made)
    return made


def publish(engine, build_id, *built):
    with write(engine) as connection:
        numbers = {
            model.road_id: models.insert_model(connection, build_id, model) for model in built
        }
        return versions.insert_version(connection, build_id, numbers, CALIBRATION)


def assert_same_salience(first, second):
    np.testing.assert_array_equal(first.mask, second.mask)
    assert (first.gain_bits, first.full_gain_bits) == (second.gain_bits, second.full_gain_bits)
    assert first.search == second.search


def assert_same_days(first, second):
    assert sorted(first.heard_on) == sorted(second.heard_on)
    for day, heard in second.heard_on.items():
        np.testing.assert_array_equal(first.heard_on[day], heard)


def assert_same_segment(first, second):
    for name in ("index", "start_m", "end_m", "mid_lon", "mid_lat"):
        assert getattr(first, name) == getattr(second, name)
    np.testing.assert_array_equal(first.features, second.features)
    assert_same_salience(first.salience, second.salience)


def assert_same_curves(first, second):
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.knots_m, other.knots_m)
        np.testing.assert_array_equal(one.coefficients_dbm, other.coefficients_dbm)
        for name in ("cell", "degree", "residual_db", "pass_count"):
            assert getattr(one, name) == getattr(other, name)


def test_a_model_comes_back_bit_for_bit(engine, build_id):
    """Grids, line, features, masks, segments and fits survive the store unchanged."""
    model = model_of("r1", seed=1, days=("2021-05-08", "2021-05-17", ""))
    with write(engine) as connection:
        model_id = models.insert_model(connection, build_id, model)
    with read(engine) as connection:
        found = models.load_model(connection, model_id)
    assert_same_days(found, model)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(found, name), getattr(model, name), err_msg=name)
    np.testing.assert_array_equal(found.line.lon, model.line.lon)
    np.testing.assert_array_equal(found.line.lat, model.line.lat)
    assert_same_salience(found.salience, model.salience)
    for name in ("road_id", "length_m", "cells", "step_m", "pass_count", "sample_count"):
        assert getattr(found, name) == getattr(model, name)
    assert len(found.segments) == len(model.segments)
    for one, other in zip(found.segments, model.segments, strict=True):
        assert_same_segment(one, other)
        assert_same_curves(one.curves, other.curves)


def test_a_served_model_is_the_built_one_without_curves_and_evidence(engine, build_id):
    """What matching reads equals what was built; nothing is read from segments or fits."""
    dated = model_of("r1", seed=3, segment_count=5, days=("2021-05-08",))
    built = [model_of("r2", seed=2), dated]
    version = publish(engine, build_id, *built)
    said: list[str] = []
    sa.event.listen(engine, "before_cursor_execute", lambda *args: said.append(args[2]))
    with read(engine) as connection:
        served = models.load_models(connection, version)
    assert not any("fits" in statement or "FROM segments" in statement for statement in said)
    assert [model.road_id for model in served] == ["r1", "r2"]
    for found, model in zip(served, reversed(built), strict=True):
        for name in ARRAYS[:-2]:
            np.testing.assert_array_equal(getattr(found, name), getattr(model, name))
        assert_same_days(found, model)
        assert found.evidence.shape == (0, model.evidence.shape[1])
        assert found.unseen.shape == (0, *model.unseen.shape[1:])
        for one, other in zip(found.segments, model.segments, strict=True):
            assert_same_segment(one, other)
            assert one.curves == ()


def test_a_calibration_reads_the_evidence(engine, build_id):
    """Models by number carry their held-out windows, by road id."""
    two = model_of("r2", seed=2, days=("2021-05-07", "")), model_of("r1", seed=3)
    built = {model.road_id: model for model in two}
    version = publish(engine, build_id, *built.values())
    with read(engine) as connection:
        numbers = versions.model_ids(connection, version)
        found = models.load_by_id(connection, list(numbers.values()))
        assert versions.select_calibration(connection, version) == CALIBRATION
    assert [model.road_id for model in found] == ["r1", "r2"]
    for model in found:
        np.testing.assert_array_equal(model.evidence, built[model.road_id].evidence)
        np.testing.assert_array_equal(model.unseen, built[model.road_id].unseen)
        assert_same_days(model, built[model.road_id])


def test_a_calibration_from_before_sub_segments_were_blurred_is_read(engine, build_id):
    """Their position error is the radius's, and what was not measured is None."""
    version = publish(engine, build_id, model_of("r1", seed=3))
    stored = dataclasses.asdict(dataclasses.replace(CALIBRATION, position_sd_m=4.5))
    del stored["segment_sd_m"], stored["reliability"]["segment_right"]
    del stored["reliability"]["segment_ece"]
    with write(engine) as connection:
        connection.execute(map_versions.update().values(calibration=stored))
        found = versions.select_calibration(connection, version)
    assert found is not None
    assert (found.position_sd_m, found.segment_sd_m) == (4.5, 4.5)
    assert (found.reliability.segment_right, found.reliability.segment_ece) == (None, None)


def test_a_build_builds_a_road_once(engine, build_id):
    """The database itself refuses a second model of the same road and build."""
    with write(engine) as connection:
        models.insert_model(connection, build_id, model_of("r1", seed=1))
    with pytest.raises(sa.exc.IntegrityError), write(engine) as connection:
        models.insert_model(connection, build_id, model_of("r1", seed=1))


def test_dropping_a_builds_models_drops_all_of_them(engine, build_id):
    """Segments, fits and cells of a dropped model go with it."""
    with write(engine) as connection:
        model = model_of("r1", seed=1, days=("2021-05-08",))
        model_id = models.insert_model(connection, build_id, model)
        models.delete_of_build(connection, build_id)
        assert models.of_build(connection, build_id) == {}
        assert models.select_segments(connection, model_id) == []
        for table in ("fits", "model_cells", "model_days"):
            assert connection.scalar(sa.text(f"SELECT count(*) FROM {table}")) == 0  # noqa: S608


def test_one_segment_can_be_read_alone(engine, build_id):
    """Asking for an index gives that segment with its own fits, or nothing."""
    model = model_of("r1", seed=4)
    with write(engine) as connection:
        model_id = models.insert_model(connection, build_id, model)
        (found,) = models.select_segments(connection, model_id, index=2)
        assert models.select_segments(connection, model_id, index=3) == []
    assert_same_segment(found, model.segments[2])
    assert_same_curves(found.curves, model.segments[2].curves)


def test_a_model_without_segments_cells_or_evidence_is_still_a_model(engine, build_id):
    """Empty matrices keep their shapes."""
    bare = model_of("r1", seed=5, cells=(), segment_count=0)
    with write(engine) as connection:
        model_id = models.insert_model(connection, build_id, bare)
        found = models.load_model(connection, model_id)
    assert found.mean_dbm.shape == bare.mean_dbm.shape
    assert found.features.shape == (5, 0)
    assert found.segments == ()


def test_cells_are_counted_over_the_roads_of_a_version(engine, build_id):
    """A cell's summary covers its roads and segments; levels are those of the grids."""
    one = model_of("r1", seed=6, cells=CELLS[:2])
    two = model_of("r2", seed=7, cells=CELLS[1:], segment_count=4)
    version = publish(engine, build_id, one, two)
    with read(engine) as connection:
        found = {cell.cell: cell for cell in catalog.select_cells(connection, version)}
        assert catalog.select_cells(connection, None) == []
    shared = found[CELLS[1]]
    levels = np.concatenate([one.mean_dbm[:, 1], two.mean_dbm[:, 0]]).astype(float)
    assert (shared.road_count, shared.segment_count) == (2, 7)
    assert shared.min_rsrp_dbm == pytest.approx(np.nanmin(levels))
    assert shared.max_rsrp_dbm == pytest.approx(np.nanmax(levels))
    assert shared.mean_rsrp_dbm == pytest.approx(np.nanmean(levels))
    assert list(found) == sorted(CELLS)


def test_roads_are_found_by_their_box_and_paged_by_their_id(engine, build_id):
    """A page holds at most its limit, says how to go on, and keeps to the box."""
    version = publish(engine, build_id, model_of("r1", seed=8, line=line_at(0.0)))
    with write(engine) as connection:
        roads.put_road(connection, Road("r3", "Far Street", line_at(5_000.0)))
    everything = {"version": version, "box": None}
    with read(engine) as connection:
        first = catalog.select_roads(connection, **everything, limit=2, after=None)
        rest = catalog.select_roads(connection, **everything, limit=2, after=first.next_cursor)
        box = Bounds(-118.50, 34.00, -118.48, 34.02)
        near = catalog.select_roads(connection, version=version, box=box, limit=9, after=None)
    assert [road.road_id for road in (*first.items, *rest.items)] == ["r1", "r2", "r3"]
    assert rest.next_cursor is None
    assert [road.road_id for road in near.items] == ["r1"]
    assert (near.items[0].segment_count, near.items[0].pass_count) == (3, 2)
    assert rest.items[0].name == "Far Street"
    assert rest.items[0].length_m is None
