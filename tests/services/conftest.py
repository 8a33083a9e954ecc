"""Processes for the tests of workers: started, watched, killed, and never left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.services import builds
from app.store.engine import create_store_engine
from app.store.migrate import migrate

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
ENDED = ("successful", "failed", "dismissed")


def wait_until(holds: Callable[[], object], timeout_s: float = 30.0) -> None:
    """Wait for something that must come; fail when it does not."""
    deadline_s = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < deadline_s, "it did not happen in time"
        time.sleep(0.02)


@dataclass
class Crew:
    """Worker processes on one data folder."""

    data_dir: Path
    engine: sa.Engine
    database_url: str | None = None
    processes: list[subprocess.Popen] = field(default_factory=list)

    def start(self, program: str = "worker_program.py", *words: object) -> subprocess.Popen:
        """Run one of the programs beside this file on the data folder."""
        command = [sys.executable, str(HERE / program), str(self.data_dir), *map(str, words)]
        process = subprocess.Popen(
            command, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, text=True
        )
        self.processes.append(process)
        return process

    def start_worker(self, seconds_a_road: float) -> subprocess.Popen:
        """A worker whose fits take so long."""
        also = [self.database_url] if self.database_url else []
        return self.start("worker_program.py", seconds_a_road, *also)

    def kill(self, process: subprocess.Popen) -> None:
        """SIGKILL: the process gets no chance to say anything."""
        process.send_signal(signal.SIGKILL)
        process.wait()

    def fits(self) -> list[str]:
        """Road ids in the order in which fits began, repeated when a fit was."""
        log = self.data_dir / "fits.log"
        return [line.split()[1] for line in log.read_text().splitlines()] if log.exists() else []

    def workers_that_fitted(self) -> set[str]:
        """Process ids of the workers that began a fit."""
        return {line.split()[0] for line in (self.data_dir / "fits.log").read_text().splitlines()}

    def finish(self, build_id: str, timeout_s: float = 40.0) -> builds.BuildState:
        """The build once it has ended."""
        wait_until(lambda: builds.get_build(self.engine, build_id).status in ENDED, timeout_s)
        return builds.get_build(self.engine, build_id)


@pytest.fixture
def crew(tmp_path: Path) -> Iterator[Crew]:
    """No worker yet, on a SQLite store."""
    engine = create_store_engine(f"sqlite:///{tmp_path}/roadprint.sqlite")
    migrate(engine)
    yield (made := Crew(tmp_path, engine))
    for process in made.processes:
        made.kill(process)
        process.stdout.close()
    engine.dispose()


@pytest.fixture
def postgres_crew(tmp_path: Path, postgres_url: str) -> Iterator[Crew]:
    """No worker yet, on a PostgreSQL store."""
    engine = create_store_engine(postgres_url)
    migrate(engine)
    yield (made := Crew(tmp_path, engine, postgres_url))
    for process in made.processes:
        made.kill(process)
        process.stdout.close()
    engine.dispose()
