"""The real service: its own process, its own worker, a folder of its own, any free port."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 20.0


@contextmanager
def running_service(folder: Path) -> Iterator[str]:
    """The address of `roadprint serve` on a folder, until the block ends; it must end well."""
    command = [sys.executable, "-m", "app", "serve", "--data", str(folder), "--port", "0"]
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "serve.log"
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
    try:
        yield _address(process, log)
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            status = process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise
    assert status == 0, log.read_text()


def _address(process: subprocess.Popen[bytes], log: Path) -> str:
    deadline_s = time.monotonic() + START_TIMEOUT_S
    while process.poll() is None and time.monotonic() < deadline_s:
        found = re.search(r"serves .* at (http://\S+)", log.read_text())
        if found:
            return found[1]
        time.sleep(0.05)
    pytest.fail(f"the service did not start:\n{log.read_text()}")


@pytest.fixture(scope="module")
def start_service(tmp_path_factory) -> Iterator[Callable[[], str]]:
    """Starts a further service on an empty folder at each call; all end with the module."""
    with ExitStack() as running:
        yield lambda: running.enter_context(
            running_service(tmp_path_factory.mktemp("data") / "store")
        )
