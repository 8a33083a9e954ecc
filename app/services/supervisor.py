"""
Keeping a worker process beside a server: started, restarted when it dies, ended with its parent.

The parent holds the writing end of the worker's standard input. It hands the settings over as the
first line, and when the parent ends, however it ends, the kernel closes the pipe and the worker
goes too.
"""

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

from app.settings import Settings

log = logging.getLogger(__name__)

WORKER = (sys.executable, "-m", "app.services.worker_process")
SHORT_LIFE_S = 10.0  # a worker that dies sooner is not started again at once
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 30.0
PATIENCE_S = 5.0  # for a worker to end by itself


class WorkerHandle:
    """A worker process that is kept running until `stop`."""

    def __init__(self, settings: Settings, command: tuple[str, ...] = WORKER) -> None:
        self._settings = settings
        self._command = command
        self._stopped = threading.Event()
        self._process = self._spawn()
        self._keeper = threading.Thread(target=self._keep, name="worker-keeper", daemon=True)
        self._keeper.start()

    @property
    def pid(self) -> int:
        """Process id of the present worker."""
        return self._process.pid

    def is_alive(self) -> bool:
        """False between the death of a worker and the start of the next."""
        return self._process.poll() is None

    def stop(self) -> None:
        """End the worker and start no other; what it was at is taken up by whoever comes next."""
        self._stopped.set()
        self._hang_up(self._process)
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._keeper.join()

    def _keep(self) -> None:
        pause_s = FIRST_PAUSE_S
        while True:
            started_s = time.monotonic()
            status = self._process.wait()
            self._hang_up(self._process)
            if self._stopped.is_set():
                return
            lived_s = time.monotonic() - started_s
            pause_s = FIRST_PAUSE_S if lived_s > SHORT_LIFE_S else min(2 * pause_s, LONGEST_PAUSE_S)
            log.warning(
                "worker %d ended with %s; another starts in %.1f s", self.pid, status, pause_s
            )
            if self._stopped.wait(pause_s):
                return
            self._process = self._spawn()
            if self._stopped.is_set():  # `stop` may have looked at the one before
                self._hang_up(self._process)

    def _spawn(self) -> subprocess.Popen[str]:
        root = str(Path(__file__).resolve().parents[2])
        path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
        process = subprocess.Popen(  # noqa: S603 - our own program
            self._command,
            stdin=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C is for the parent, which then hangs up
        )
        assert process.stdin is not None  # noqa: S101 - it was asked for
        try:
            process.stdin.write(self._settings.model_dump_json() + "\n")
            process.stdin.flush()
        except BrokenPipeError:
            log.warning("worker %d died before it was told what to do", process.pid)
        return process

    @staticmethod
    def _hang_up(process: subprocess.Popen[str]) -> None:
        if process.stdin is not None and not process.stdin.closed:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()


def start_worker_process(settings: Settings) -> WorkerHandle:
    """
    Start a worker process for these settings and keep one running until the handle is stopped.

    The process has low priority, ends when this one does, and is no thread: a build beside a query
    costs the query next to nothing.
    """
    return WorkerHandle(settings)
