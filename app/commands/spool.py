"""Drives kept aside on disk until the whole of their file is known to be sound."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from datetime import datetime
from types import TracebackType
from typing import Self

import numpy as np

from app.domain import Trace

ARRAYS = ("time_s", "lon", "lat", "rsrp_dbm")


class Spool:
    """
    Traces in a temporary file, in order; memory stays flat however many there are.

    Use as a context manager: the file is gone when it closes, also after a crash.
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="roadprint-import-")  # noqa: SIM115 - closed below
        self._count = 0

    def __enter__(self) -> Self:
        """Open for traces."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give the disk back."""
        self._file.close()

    def put(self, name: str, trace: Trace) -> None:
        """Keep one more."""
        words = {
            "name": name,
            "cells": trace.cells,
            "device": trace.device,
            "global_ids": dict(trace.global_ids),
            "recorded_at": trace.recorded_at.isoformat() if trace.recorded_at else None,
        }
        self._file.write(json.dumps(words).encode() + b"\n")
        for each in ARRAYS:
            np.save(self._file, getattr(trace, each), allow_pickle=False)
        self._count += 1

    def drain(self) -> Iterator[tuple[str, Trace]]:
        """Everything that was put in, in that order."""
        self._file.seek(0)
        for _ in range(self._count):
            words = json.loads(self._file.readline())
            arrays = {each: np.load(self._file, allow_pickle=False) for each in ARRAYS}
            moment = words["recorded_at"]
            trace = Trace(
                cells=tuple(words["cells"]),
                device=words["device"],
                global_ids=words["global_ids"],
                recorded_at=datetime.fromisoformat(moment) if moment else None,
                **arrays,
            )
            yield words["name"], trace
