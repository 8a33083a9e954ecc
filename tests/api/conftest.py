"""A real service on a free loopback port: uvicorn with httptools, a migrated SQLite file."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import sqlalchemy as sa
import structlog
import uvicorn

from app.domain import Calibration, RoadModel, Trace
from app.main import Application, create_app
from app.services import roadwork
from app.services.builds import request_build
from app.settings import Settings
from app.store.engine import create_store_engine
from app.store.migrate import migrate
from tests.factories import line_at, model_of, trace_along

# One line a record: the default for terminals draws tracebacks for seconds.
structlog.configure(
    processors=[structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
)

PROBLEM_MEMBERS = {"type", "title", "status", "detail", "instance", "code", "errors"}
SMALL_LIMITS = {
    "max_body_bytes": 200_000,
    "max_window_samples": 100,
    "max_window_cells": 20,
    "max_batch_windows": 10,
    "map_poll_interval_s": 0.05,
    "event_poll_interval_s": 0.02,
    "event_keep_alive_s": 0.1,
}


@dataclass(frozen=True)
class Service:
    """A running service, a client of it, and its store from the inside."""

    client: httpx.Client
    engine: sa.Engine
    app: Application
    settings: Settings

    def build(self, *road_ids: str, activate: bool = True) -> int:
        """Build roads as a worker would, with models made without a fit; the map's version."""
        build = request_build(self.engine, list(road_ids) or None, activate=activate)
        return self.work_on(build.id)

    def work_on(self, build_id: str) -> int:
        """Do a build that was asked for; the version of its map."""
        count = roadwork.begin_build(self.engine, build_id)
        for road_id in roadwork.waiting_roads(self.engine, build_id, 0, count):
            roadwork.build_road(self.engine, made_up_model, build_id, road_id)
        roadwork.publish(self.engine, lambda _models: Calibration(), build_id)
        found = self.client.get(f"/v1/builds/{build_id}").json()
        assert found["status"] == "successful", found
        return int(found["map_version"])

    def wait_for_map(self, version: int) -> None:
        """Until the service serves this version."""
        deadline_s = time.monotonic() + 10
        while self.client.get("/readyz").json()["map_version"] != version:
            assert time.monotonic() < deadline_s
            time.sleep(0.01)


def made_up_model(road: Any, passes: Any) -> RoadModel:
    cells = tuple(sorted({cell for trace in passes for cell in trace.cells}))
    seed = sum(map(ord, road.road_id))
    line = road.line or line_at(10.0 * (seed % 50))
    return model_of(road.road_id, seed=seed, line=line, cells=cells)


@contextmanager
def serving(folder: Path, **changed: Any) -> Iterator[Service]:
    settings = Settings(data_dir=folder, **{**SMALL_LIMITS, **changed})
    engine = create_store_engine(settings.store_url)
    migrate(engine)
    app = create_app(settings)
    config = uvicorn.Config(
        app, port=0, loop="uvloop", http="httptools", log_config=None, timeout_graceful_shutdown=2
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, name="service")
    thread.start()
    try:
        while not server.started:
            assert thread.is_alive()
            time.sleep(0.005)
        port = server.servers[0].sockets[0].getsockname()[1]
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=20) as client:
            yield Service(client, engine, app, settings)
    finally:
        server.should_exit = True
        thread.join()
        engine.dispose()


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    """A service of its own, empty."""
    with serving(tmp_path) as running:
        yield running


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service that a module's tests share, with two roads in its map and one survey of each."""
    with serving(tmp_path_factory.mktemp("shared")) as running:
        for number, road_id in enumerate(("north", "south")):
            trace = trace_along(line_at(40.0 * number), seed=number, road_id=road_id)
            posted = running.client.post("/v1/surveys?build=false", json=survey_json(trace))
            assert posted.status_code == 202, posted.text
        running.wait_for_map(running.build())
        yield running


def survey_json(trace: Trace, **changed: Any) -> dict[str, Any]:
    """A trace as it is posted."""
    document = {
        "road_id": trace.road_id,
        "device": trace.device,
        "recorded_at": trace.recorded_at.isoformat() if trace.recorded_at else None,
        "cells": list(trace.cells),
        "time_s": trace.time_s.tolist(),
        "lon": trace.lon.tolist(),
        "lat": trace.lat.tolist(),
        "rsrp_dbm": nulls(trace.rsrp_dbm),
    }
    return {**document, **changed}


def nulls(matrix: np.ndarray) -> list[list[float | None]]:
    """Rows as JSON has them: NaN is null."""
    rows = np.asarray(matrix, dtype=float).tolist()
    return [[None if value != value else value for value in row] for row in rows]  # noqa: PLR0124


def window_json(samples: int = 12, *, seed: int = 1, **changed: Any) -> dict[str, Any]:
    """A plausible locate request over the cells of `tests.factories`."""
    rng = np.random.default_rng(seed)
    document = {
        "cells": ["850:293", "850:60", "5110:17"],
        "distance_m": (2.5 * np.arange(samples)).tolist(),
        "rsrp_dbm": np.round(rng.uniform(-120, -60, (samples, 3))).tolist(),
    }
    return {**document, **changed}


def assert_problem(
    answer: httpx.Response, status: int, code: str, pointers: set[str] | None = None
) -> dict[str, Any]:
    """The answer is the problem document that is meant, whole; the document."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["x-request-id"]
    document: dict[str, Any] = answer.json()
    assert set(document) == PROBLEM_MEMBERS
    assert document["status"] == status
    assert document["code"] == code
    assert document["type"] == f"urn:roadprint:problem:{code}"
    assert document["instance"] == answer.request.url.path
    assert document["title"]
    assert document["detail"]
    assert all(set(fault) == {"pointer", "detail"} for fault in document["errors"])
    if pointers is not None:
        assert {fault["pointer"] for fault in document["errors"]} == pointers, document["errors"]
    return document
