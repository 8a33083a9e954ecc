"""Surveys come back as they were posted, whatever the order of their cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sqlalchemy.exc import IntegrityError

from app.store import roads, surveys
from app.store.bounds import bounds_of
from app.store.engine import read, write
from app.store.surveys import PassRange, Receipt, content_hash
from tests.factories import line_at, trace_along


def stored(engine, trace, *, key=None, pieces=None):
    with write(engine) as connection:
        for piece in pieces or [PassRange(trace.road_id, 0, len(trace.time_s))]:
            roads.widen(connection, piece.road_id, bounds_of(trace.lon, trace.lat))
        along = pieces or [PassRange(trace.road_id, 0, len(trace.time_s))]
        receipt = Receipt(key, content_hash(trace), {"filler": 2})
        return surveys.insert_survey(connection, trace, along, receipt)


def assert_same(first, second):
    assert first.cells == second.cells
    for name in ("time_s", "lon", "lat", "rsrp_dbm"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)
    for name in ("road_id", "device", "recorded_at", "reference_cell"):
        assert getattr(first, name) == getattr(second, name)


def test_a_trace_comes_back_bit_for_bit(engine):
    """Samples, holes, cells, device and time survive the store; levels as float32."""
    trace = replace(trace_along(line_at(), seed=1, road_id="r1"), reference_cell="850:60")
    survey_id = stored(engine, trace)
    with read(engine) as connection:
        found = surveys.select_trace(connection, survey_id)
    assert_same(found, trace)
    assert found.rsrp_dbm.dtype == np.float32


def test_the_hash_does_not_know_the_order_of_the_cells():
    """Permuting cells with their columns is the same survey."""
    trace = trace_along(line_at(), seed=2, road_id="r1")
    order = [2, 0, 1]
    permuted = replace(
        trace, cells=tuple(trace.cells[i] for i in order), rsrp_dbm=trace.rsrp_dbm[:, order]
    )
    assert content_hash(permuted) == content_hash(trace)


def test_every_part_of_a_survey_is_in_its_hash():
    """Another level, place, time, road, device, cell or date is another survey."""
    trace = trace_along(line_at(), seed=3, road_id="r1")
    louder = trace.rsrp_dbm.copy()
    louder[5, 1] = -50.0
    others = [
        replace(trace, rsrp_dbm=louder),
        replace(trace, lon=trace.lon + 1e-7),
        replace(trace, lat=trace.lat + 1e-7),
        replace(trace, time_s=trace.time_s + 0.5),
        replace(trace, road_id="r2"),
        replace(trace, device=None),
        replace(trace, recorded_at=None),
        replace(trace, cells=("850:293", "850:60", "850:61")),
        replace(trace, reference_cell="850:60"),
    ]
    hashes = {content_hash(other) for other in [trace, *others]}
    assert len(hashes) == len(others) + 1


def test_a_key_and_a_content_are_stored_once(engine):
    """The database itself refuses a second survey of the same content or key."""
    trace = trace_along(line_at(), seed=4, road_id="r1")
    stored(engine, trace, key="k")
    with pytest.raises(IntegrityError):
        stored(engine, trace)
    with pytest.raises(IntegrityError):
        stored(engine, trace_along(line_at(), seed=5, road_id="r1"), key="k")


def test_a_road_gets_its_stretch_of_a_long_drive(engine):
    """A survey cut into passes gives each road its own samples, in order of arrival."""
    trace = trace_along(line_at(), seed=6, road_id="r1")
    stored(engine, trace, pieces=[PassRange("r1", 0, 60), PassRange("r2", 60, 101)])
    later = trace_along(line_at(), seed=7, road_id="r2")
    stored(engine, later)
    with read(engine) as connection:
        first, second = surveys.select_passes(connection, "r2")
        summary = surveys.select_page(connection, road_id="r1", limit=10, after=None).items[0]
    np.testing.assert_array_equal(first.rsrp_dbm, trace.rsrp_dbm[60:])
    np.testing.assert_array_equal(first.lon, trace.lon[60:])
    assert_same(second, later)
    assert summary.roads == ("r1", "r2")
    assert summary.dropped == {"filler": 2}


def test_a_forgotten_survey_is_gone_with_its_passes(engine):
    """Deleting tells which roads it touched, once."""
    survey_id = stored(engine, trace_along(line_at(), seed=8, road_id="r1"))
    with write(engine) as connection:
        assert surveys.delete(connection, survey_id) == ["r1"]
    with write(engine) as connection:
        assert surveys.delete(connection, survey_id) is None
        assert surveys.select_passes(connection, "r1") == []
        assert roads.surveyed_roads(connection) == []
