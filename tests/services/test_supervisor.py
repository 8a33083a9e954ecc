"""A worker lives as long as its parent, comes back when it dies, and builds with the real fit."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from app.services import ingest, maps
from app.services.supervisor import WorkerHandle, start_worker_process
from app.settings import Settings
from tests.factories import line_at, trace_along
from tests.services.conftest import wait_until


def lives(pid: int) -> bool:
    """True while a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def handle(crew):
    """The real worker beside this process."""
    started = start_worker_process(Settings(data_dir=crew.data_dir))
    yield started
    started.stop()


def test_a_killed_worker_comes_back_and_builds(crew, handle):
    """The real worker is killed, another takes its place, and it builds the survey's road."""
    first = handle.pid
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: handle.pid != first)
    assert os.getpriority(os.PRIO_PROCESS, handle.pid) in (0, 10)
    drives = [trace_along(line_at(length_m=400.0), seed=n, road_id="r1") for n in range(3)]
    done = [ingest.accept_survey(crew.engine, drive) for drive in drives][-1]
    build = crew.finish(done.build_id)
    assert (build.status, build.failed_roads) == ("successful", ())
    assert os.getpriority(os.PRIO_PROCESS, handle.pid) == 10  # it makes way for queries
    (model,) = maps.load_radio_map(crew.engine, build.map_version).models
    assert model.length_m == pytest.approx(400.0, abs=5.0)
    assert model.segments


def test_a_stopped_worker_is_gone(handle):
    """Stopping ends the process and starts no other."""
    pid = handle.pid
    handle.stop()
    assert not lives(pid)
    assert not handle.is_alive()
    time.sleep(0.2)
    assert handle.pid == pid
    handle.stop()  # once more does no harm


def test_a_worker_ends_with_its_killed_parent(crew):
    """Kill -9 of the server leaves no worker behind."""
    parent = crew.start("parent_program.py")
    worker = int(parent.stdout.readline())
    assert lives(worker)
    crew.kill(parent)
    wait_until(lambda: not lives(worker), timeout_s=15.0)


def test_a_worker_that_cannot_live_is_not_started_in_a_hurry(tmp_path):
    """A program that dies at once is started again after pauses that double."""
    log = tmp_path / "starts"
    program = f"open({str(log)!r}, 'a').write('x')"
    handle = WorkerHandle(Settings(data_dir=tmp_path), (sys.executable, "-c", program))
    time.sleep(2.5)
    handle.stop()
    assert 1 <= len(log.read_text()) <= 3  # at 0, about 1 and 3 s
