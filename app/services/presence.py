"""
Who of the workers is alive.

Two signs. A worker holds a lock on a file of its own in the data folder; the kernel drops it in the
instant the process dies, however it dies, so that another worker on the same folder takes over at
once. Across machines, and for a process that hangs, there are beats: a counter in the store that
stands still. Beats are compared with one's own monotonic clock, so that no clocks need agree.
"""

from __future__ import annotations

import fcntl
import os
import socket
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self, TextIO

from sqlalchemy.engine import Engine
from sqlalchemy.exc import SQLAlchemyError

from app.store import workers
from app.store.columns import new_id
from app.store.engine import read, write

BEAT_S = 2.0
SILENT_S = 15.0  # seven beats missed


@dataclass
class Presence:
    """This worker among the others. Use as a context manager."""

    engine: Engine
    folder: Path
    worker_id: str = field(default_factory=new_id)
    _heard: dict[str, tuple[int, float]] = field(default_factory=dict)
    _stop: threading.Event = field(default_factory=threading.Event)
    _lock: TextIO | None = None

    def __enter__(self) -> Self:
        """Enter this worker and begin to beat."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = self._lock_file(self.worker_id).open("w")
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        self._beat()
        threading.Thread(target=self._keep_beating, name="heart", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop beating and let go; the others see at once that this worker is gone."""
        self._stop.set()
        if self._lock is not None:
            self._lock.close()

    def dead(self) -> set[str]:
        """Ids of entered workers that live no more."""
        with read(self.engine) as connection:
            beats = workers.select_beats(connection)
        others = {other: count for other, count in beats.items() if other != self.worker_id}
        self._heard = {
            other: self._heard[other]
            if other in self._heard and self._heard[other][0] == count
            else (count, time.monotonic())
            for other, count in others.items()
        }
        return {other for other in others if self._is_dead(other)}

    def strangers(self, worker_ids: set[str]) -> set[str]:
        """Which of these ids are entered nowhere: workers struck off before their work was done."""
        with read(self.engine) as connection:
            return worker_ids - set(workers.select_beats(connection)) - {self.worker_id}

    def bury(self, worker_id: str) -> None:
        """Strike off a dead worker whose work was taken over."""
        with write(self.engine) as connection:
            workers.forget(connection, worker_id)
        self._lock_file(worker_id).unlink(missing_ok=True)
        self._heard.pop(worker_id, None)

    def _is_dead(self, worker_id: str) -> bool:
        return self._has_let_go(worker_id) or self._is_silent(worker_id)

    def _has_let_go(self, worker_id: str) -> bool:
        try:
            with self._lock_file(worker_id).open("r+") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except FileNotFoundError:
            return False  # it lives on another machine; only its beats can tell
        except BlockingIOError:
            return False
        return True

    def _is_silent(self, worker_id: str) -> bool:
        return time.monotonic() - self._heard[worker_id][1] > SILENT_S

    def _lock_file(self, worker_id: str) -> Path:
        return self.folder / f"{worker_id}.lock"

    def _beat(self) -> None:
        with write(self.engine) as connection:
            workers.beat(connection, self.worker_id, host=socket.gethostname(), pid=os.getpid())

    def _keep_beating(self) -> None:
        while not self._stop.wait(BEAT_S):
            try:
                self._beat()
            except SQLAlchemyError:
                continue  # a missed beat; the next one will do
