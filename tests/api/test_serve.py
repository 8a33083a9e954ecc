"""`roadprint serve` as a user starts it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

pytestmark = pytest.mark.end_to_end

ROADPRINT = [sys.executable, "-m", "app"]


@contextmanager
def served(
    folder: Path, *options: str, log: Path = Path(os.devnull)
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A running `roadprint serve` on a free port, and its address as it prints it."""
    command = [*ROADPRINT, "serve", "--data", str(folder), "--port", "0", *options]
    with log.open("w") as errors:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
    assert process.stdout is not None
    try:
        first = process.stdout.readline()
        assert " at http://" in first, first
        yield process, first.rsplit(" at ", maxsplit=1)[1].strip()
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def until(condition, patience_s: float = 20.0) -> None:
    deadline_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.05)


def children_of(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(child) for child in found.read_text().split()] if found.exists() else []


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", maxsplit=1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def answers(url: str) -> bool:
    try:
        return httpx.get(f"{url}/livez").is_success
    except httpx.TransportError:
        return False


def test_it_serves_where_it_says_and_ends_when_asked(tmp_path: Path):
    """The printed address answers; SIGTERM ends it with 0 and its worker with it; logs are JSON."""
    log = tmp_path / "log"
    with served(tmp_path / "new", log=log) as (process, url):
        assert httpx.get(f"{url}/readyz").json()["status"] == "ready"
        until(lambda: children_of(process.pid))
        workers = children_of(process.pid)
        process.terminate()
        assert process.wait(15) == 0
        until(lambda: not any(map(is_alive, workers)))
    for line in log.read_text().splitlines():
        assert {"event", "level", "timestamp"} <= set(json.loads(line))


def test_an_open_event_stream_does_not_hold_it_up(tmp_path: Path):
    """A reader of events is cut off when the service ends."""
    with served(tmp_path, "--no-worker") as (process, url):
        survey = {
            "cells": ["a"],
            "time_s": [0.0, 1],
            "lon": [8.0, 8],
            "lat": [50.0, 50.0001],
            "rsrp_dbm": [[-90.0]] * 2,
        }
        build_id = httpx.post(f"{url}/v1/surveys", json=survey).json()["build_id"]
        with httpx.stream("GET", f"{url}/v1/builds/{build_id}/events") as stream:
            next(stream.iter_lines())
            process.send_signal(signal.SIGINT)
            process.wait(15)


def test_a_taken_port_is_said_plainly(tmp_path: Path):
    """No traceback, a way out, and nothing is left in the folder."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        command = [*ROADPRINT, "serve", "--data", str(tmp_path / "data"), "--port", port]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=30)
    assert done.returncode == 1
    assert f"cannot listen on 127.0.0.1 port {port}" in done.stderr
    assert "--port 0" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "data").exists()


def test_a_wrong_setting_is_said_plainly(tmp_path: Path):
    """The variable and its value are named."""
    environment = {**os.environ, "ROADPRINT_MAX_BODY_BYTES": "lots"}
    command = [*ROADPRINT, "serve", "--data", str(tmp_path)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=30, env=environment
    )
    assert done.returncode == 2
    assert "ROADPRINT_MAX_BODY_BYTES" in done.stderr
    assert "'lots'" in done.stderr


def test_several_api_processes_are_one_service(tmp_path: Path):
    """They share the port and the metrics, and all end with a killed parent."""
    with served(tmp_path, "--workers", "2", "--no-worker") as (process, url):
        until(lambda: answers(url))
        for _ in range(20):
            assert httpx.get(f"{url}/readyz").is_success
        counted = [
            float(line.rsplit(" ", maxsplit=1)[1])
            for line in httpx.get(f"{url}/metrics").text.splitlines()
            if line.startswith("roadprint_requests_total") and "/readyz" in line
        ]
        assert sum(counted) == 20
        children = children_of(process.pid)
        process.kill()
        process.wait()
        until(lambda: not any(map(is_alive, children)))
    assert not answers(url)
