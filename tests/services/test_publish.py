"""The map in memory follows the active version, by one assignment, off the request path."""

from __future__ import annotations

import threading

import pytest
from sqlalchemy.exc import OperationalError

from app.domain import Window
from app.numerics.calibration import calibrate
from app.numerics.roadfit import fit_road
from app.services import builds, ingest, maps, roadwork, surveys
from app.services.locate import locate
from app.services.publish import MapHolder
from tests.factories import line_at, trace_along
from tests.services.conftest import wait_until


def run(engine, build_id):
    count = roadwork.begin_build(engine, build_id)
    for road_id in roadwork.waiting_roads(engine, build_id, 0, count):
        roadwork.build_road(engine, fit_road, build_id, road_id)
    roadwork.publish(engine, calibrate, build_id)
    return builds.get_build(engine, build_id)


def drive(engine, seed, road_id="r1"):
    trace = trace_along(line_at(length_m=300.0), seed=seed, road_id=road_id)
    return ingest.accept_survey(engine, trace)


def test_before_the_first_map_there_is_none(sqlite_engine):
    """An empty store gives no index, and looking again changes nothing."""
    holder = MapHolder()
    assert not holder.refresh(sqlite_engine)
    assert holder.current is None


def test_the_holder_follows_activation_and_rollback(sqlite_engine):
    """Each change of the active version brings another index; no change leaves the very same."""
    holder = MapHolder()
    drive(sqlite_engine, 1)
    assert run(sqlite_engine, drive(sqlite_engine, 2).build_id).status == "successful"
    assert holder.refresh(sqlite_engine)
    first = holder.current
    assert first.version == 1
    assert not holder.refresh(sqlite_engine)
    assert holder.current is first
    run(sqlite_engine, drive(sqlite_engine, 3).build_id)
    assert holder.refresh(sqlite_engine)
    assert holder.current.version == 2
    maps.activate(sqlite_engine, 1)
    assert holder.refresh(sqlite_engine)
    assert holder.current.version == 1


def test_a_map_without_roads_is_no_map(sqlite_engine):
    """When the last road leaves, there is nothing to locate on."""
    holder = MapHolder()
    only = drive(sqlite_engine, 1)
    run(sqlite_engine, only.build_id)
    holder.refresh(sqlite_engine)
    assert holder.current is not None
    run(sqlite_engine, surveys.delete_survey(sqlite_engine, only.survey_id))
    assert holder.refresh(sqlite_engine)
    assert holder.current is None
    assert holder.version == 2


def test_polling_survives_a_store_that_does_not_answer(sqlite_engine, monkeypatch):
    """A fault of the store leaves the present map in place, and the next look succeeds."""
    run(sqlite_engine, drive(sqlite_engine, 1).build_id)
    holder, stop, asked = MapHolder(), threading.Event(), []

    def first_failing(engine):
        asked.append(engine)
        if len(asked) == 1:
            raise OperationalError("SELECT", {}, Exception("disk I/O error"))
        return maps.active_version(engine)

    monkeypatch.setattr("app.services.publish.active_version", first_failing)
    poller = threading.Thread(target=holder.poll, args=(sqlite_engine, 0.01, stop))
    poller.start()
    try:
        wait_until(lambda: holder.current is not None)
    finally:
        stop.set()
        poller.join()
    assert len(asked) > 1


def test_a_window_of_the_survey_is_located_on_its_road(sqlite_engine):
    """From traces to a fix through every service: the end of a 100 m window within 15 m."""
    for seed in (1, 2):
        done = drive(sqlite_engine, seed)
    run(sqlite_engine, done.build_id)
    holder = MapHolder()
    holder.refresh(sqlite_engine)
    fresh = trace_along(line_at(length_m=300.0), seed=77)
    part = slice(60, 111)  # chainage 120..220 m, a sample every 2 m
    window = Window(fresh.cells, fresh.time_s[part] * 8.0, fresh.rsrp_dbm[part])
    fix = locate(holder.current, window)
    assert (fix.road_id, fix.direction) == ("r1", "forward")
    assert fix.chainage_m == pytest.approx(220.0, abs=15.0)
    assert fix.map_version == 1
