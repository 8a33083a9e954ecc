"""
A build as a durable DBOS workflow: what a killed worker leaves is taken up where it stopped.

The build's workflow has the build's id, so that dispatching it twice starts it once. It finds the
roads of drives that name none, fans the build's roads out in batches through a queue that every
worker takes from, one batch at a time each, waits for them and publishes. DBOS remembers which
steps were done; the steps themselves
(`app.services.roadwork`) may all be run again, so a step that was cut off between its write and
DBOS's note of it does nothing twice either.

Only a worker imports this module: a serving process has no DBOS.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from dbos import DBOS, DBOSConfig, SetWorkflowID, StepOptions, WorkflowHandle
from dbos import error as dbos_error
from sqlalchemy.engine import Engine, make_url

from app.services import network, roadwork

# A workflow is only taken up by workers of the version that began it. Raise this when the order of
# steps below changes, and let the builds that are under way finish first.
STEPS_VERSION = "builds-2"

JOBS_FILE = "jobs.sqlite"
BUILDS, BATCHES = "builds", "batches"
MOST_BATCHES = 64  # of a build: one costs some 30 ms, and two workers share 64 evenly enough
LOOK_FOR_BUILDS_S = 0.4  # looking every 0.1 s everywhere cost an idle worker 7 % of a core
LOOK_FOR_BATCHES_S = 0.2
LOOK_FOR_RESULT_S = 0.2
KEEP_FINISHED = timedelta(days=1)
BROKEN = ("ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED", "SUCCESS")


@dataclass(frozen=True, slots=True)
class Jobs:
    """The launched engine of one worker process."""

    build: Callable[[str], None]

    def dispatch(self, build_id: str) -> None:
        """Enqueue a build; one that is enqueued, running or done already is left alone."""
        queue = DBOS.retrieve_queue(BUILDS)
        assert queue is not None  # noqa: S101 - `launch` registered it
        with SetWorkflowID(build_id):
            queue.enqueue(self.build, build_id)

    def call_off(self, build_id: str) -> None:
        """Take the batches of an ended build that nobody has begun out of the queue."""
        waiting = DBOS.list_workflows(
            status="ENQUEUED", workflow_id_prefix=f"{build_id}/", load_input=False
        )
        if waiting:
            DBOS.cancel_workflows([status.workflow_id for status in waiting])

    def state_of(self, build_id: str) -> str | None:
        """What DBOS says of a build's workflow; None when it knows none."""
        status = DBOS.get_workflow_status(build_id)
        return None if status is None else status.status

    def busy_workers(self) -> set[str]:
        """Ids of the workers that workflows are assigned to, dead ones included."""
        pending = DBOS.list_workflows(status="PENDING", load_input=False, load_output=False)
        return {status.executor_id for status in pending if status.executor_id is not None}

    def take_over(self, worker_id: str) -> None:
        """Put the workflows of a dead worker back into their queues; harmless to repeat."""
        DBOS._recover_pending_workflows([worker_id])  # noqa: SLF001 - public only over Conductor

    def forget_finished(self) -> None:
        """Drop what DBOS remembers of workflows that ended long ago."""
        before = (datetime.now(UTC) - KEEP_FINISHED).isoformat()
        old = DBOS.list_workflows(
            status=list(BROKEN), completed_before=before, load_input=False, load_output=False,
            limit=1000,
        )  # fmt: skip
        if old:
            DBOS.delete_workflows([status.workflow_id for status in old])

    def stop(self) -> None:
        """Stop taking work; what is under way is left to whoever takes it over."""
        DBOS.destroy(destroy_registry=True)


def jobs_url(store_url: str, data_dir: Path) -> str:
    """Where DBOS keeps its tables: beside the SQLite store, or a schema of the PostgreSQL one."""
    url = make_url(store_url)
    if url.get_backend_name() == "sqlite":
        return f"sqlite:///{data_dir.absolute() / JOBS_FILE}"
    return url.set(drivername="postgresql").render_as_string(hide_password=False)


def launch(
    engine: Engine,
    fit: roadwork.FitRoad,
    calibrate: roadwork.Calibrate,
    find: network.FindRoads,
    *,
    url: str,
    worker_id: str,
) -> Jobs:
    """Start this process's DBOS: it begins to take work from the queues at once."""
    config: DBOSConfig = {
        "name": "roadprint",
        "system_database_url": url,
        "application_version": STEPS_VERSION,
        "executor_id": worker_id,
        "log_level": "ERROR",
        "enable_otlp": False,
        "scheduler_polling_interval_sec": 3600.0,  # nothing is scheduled
    }
    DBOS(config=config)
    jobs = _register(engine, fit, calibrate, find)
    DBOS.launch()
    # One build at a time: what is posted meanwhile gathers in the next one.
    DBOS.register_queue(
        BUILDS,
        global_concurrency=1,
        polling_interval_sec=LOOK_FOR_BUILDS_S,
        on_conflict="always_update",
    )
    # One batch a process: a road's fit is Python and numpy, threads would only share one core.
    DBOS.register_queue(
        BATCHES,
        worker_concurrency=1,
        polling_interval_sec=LOOK_FOR_BATCHES_S,
        on_conflict="always_update",
    )
    return jobs


def _register(
    engine: Engine,
    fit: roadwork.FitRoad,
    calibrate: roadwork.Calibrate,
    find: network.FindRoads,
) -> Jobs:
    @DBOS.workflow(name="build_batch", max_recovery_attempts=None)
    def build_batch(build_id: str, first: int, end: int) -> None:
        listed = _step("list_roads")
        for road_id in DBOS.run_step(listed, roadwork.waiting_roads, engine, build_id, first, end):
            road = _step("build_road")
            if not DBOS.run_step(road, roadwork.build_road, engine, fit, build_id, road_id):
                return

    @DBOS.workflow(name="build", max_recovery_attempts=None)
    def build(build_id: str) -> None:
        DBOS.run_step(_step("begin"), roadwork.begin_build, engine, build_id)
        placed = _step("place_drives")
        road_count = DBOS.run_step(placed, network.place_drives, engine, find, build_id)
        if road_count:
            _wait_for(_fan_out(build_batch, build_id, road_count))
            DBOS.run_step(_step("publish"), roadwork.publish, engine, calibrate, build_id)
        else:
            DBOS.run_step(_step("no_roads"), network.end_without_roads, engine, build_id)
        DBOS.run_step(_step("clear"), roadwork.clear_leftovers, engine, build_id)

    return Jobs(build)


def _step(name: str) -> StepOptions:
    # The store's trouble (a lock held too long, a restarted PostgreSQL) is worth waiting for.
    return {"name": name, "retries_allowed": True, "max_attempts": 6, "interval_seconds": 1.0}


def _wait_for(batches: Sequence[WorkflowHandle[None]]) -> None:
    for batch in batches:
        try:
            batch.get_result(polling_interval_sec=LOOK_FOR_RESULT_S)
        except dbos_error.DBOSAwaitedWorkflowCancelledError:
            return  # `call_off`: the build was dismissed, and `publish` will see that it was


def _fan_out(
    build_batch: Callable[[str, int, int], None], build_id: str, road_count: int
) -> list[WorkflowHandle[None]]:
    size = math.ceil(road_count / MOST_BATCHES)
    queue = DBOS.retrieve_queue(BATCHES)
    assert queue is not None  # noqa: S101 - `launch` registered it
    handles = []
    for first in range(0, road_count, size):
        with SetWorkflowID(f"{build_id}/{first}"):
            handles.append(queue.enqueue(build_batch, build_id, first, first + size))
    return handles
