"""
The worker process: takes builds from the store, makes them durable jobs, takes over from the dead.

It ends without ceremony: whatever is under way when it goes, by a signal or by kill -9, is taken up
by another worker or by itself when it is started again.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NoReturn

from sqlalchemy.engine import Engine
from sqlalchemy.exc import SQLAlchemyError

from app.services import jobs, network, roadwork
from app.services.presence import Presence
from app.settings import Settings
from app.store import builds
from app.store.engine import create_store_engine, read
from app.store.migrate import migrate

log = logging.getLogger(__name__)

NICENESS = 10  # queries beside a build stay fast: their process always goes first
LOOK_S = 0.4  # how often the outbox is read
CHECK_S = 2.0  # how often dead workers and broken jobs are looked for
TIDY_S = 600.0


def run_worker(settings: Settings) -> NoReturn:
    """
    Be a worker until a signal comes (SIGTERM or SIGINT); ends the process.

    Meant for a process of its own: it lowers its priority and installs signal handlers.
    """
    from app.numerics.calibration import calibrate  # noqa: PLC0415 - see `fit`
    from app.numerics.network.finding import find_roads  # noqa: PLC0415 - see `fit`
    from app.numerics.roadfit import fit_road  # noqa: PLC0415 - scipy only where roads are built

    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    os.nice(NICENESS)
    work(settings, stop, fit_road, calibrate, find_roads)
    logging.shutdown()
    os._exit(0)  # threads within a fit are left behind: joining them would wait for the road


def work(
    settings: Settings,
    stop: threading.Event,
    fit: roadwork.FitRoad,
    calibrate: roadwork.Calibrate,
    find: network.FindRoads,
) -> None:
    """
    Be a worker until ``stop`` is set, with the given numerics.

    Its threads may still be within a road when this returns; the process is meant to end.
    """
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    engine = create_store_engine(settings.store_url, busy_timeout_ms=settings.busy_timeout_ms)
    migrate(engine)
    url = jobs.jobs_url(settings.store_url, settings.data_dir)
    with Presence(engine, settings.data_dir / "workers") as presence:
        launched = jobs.launch(engine, fit, calibrate, find, url=url, worker_id=presence.worker_id)
        log.info("worker %s takes builds", presence.worker_id)
        desk = Desk(engine, presence, launched)
        while not stop.wait(LOOK_S):
            try:
                desk.look()
            except SQLAlchemyError:
                log.exception("the store did not answer; trying again")


@dataclass
class Desk:
    """Brings the outbox, the jobs and the living together, a look at a time."""

    engine: Engine
    presence: Presence
    jobs: jobs.Jobs
    dispatched: set[str] = field(default_factory=set)
    checked_at_s: float = -CHECK_S
    tidied_at_s: float = field(default_factory=time.monotonic)

    def look(self) -> None:
        """Dispatch what is due; every now and then look for what the dead left behind."""
        with read(self.engine) as connection:
            due = [build_id for build_id, _ in builds.due_builds(connection)]
        for build_id in self.dispatched - set(due):
            self.jobs.call_off(build_id)  # it has ended; if it was dismissed, batches may wait
        self.dispatched &= set(due)
        for build_id in due:
            if build_id not in self.dispatched:
                self.jobs.dispatch(build_id)
                self.dispatched.add(build_id)
        now_s = time.monotonic()
        if now_s - self.checked_at_s >= CHECK_S:
            self.checked_at_s = now_s
            self._take_over()
            self._end_broken(due)
        if now_s - self.tidied_at_s >= TIDY_S:
            self.tidied_at_s = now_s
            self.jobs.forget_finished()

    def _take_over(self) -> None:
        dead = self.presence.dead()
        for worker_id in dead | self.presence.strangers(self.jobs.busy_workers()):
            log.warning("taking over from worker %s, which is gone", worker_id)
            self.jobs.take_over(worker_id)
            self.presence.bury(worker_id)

    def _end_broken(self, due: Sequence[str]) -> None:
        """A build whose job has ended without ending it would stay unfinished for ever."""
        for build_id in due:
            state = self.jobs.state_of(build_id)
            if state is None:
                self.dispatched.discard(build_id)  # the jobs' database is new: dispatch again
            elif state in jobs.BROKEN:
                detail = f"its job ended as {state}; ask for the build again"
                if roadwork.abandon(self.engine, build_id, "job-lost", detail):
                    roadwork.clear_leftovers(self.engine, build_id)
                    log.error("build %s broke off: %s", build_id, detail)
