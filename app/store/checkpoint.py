"""
Moving the WAL back into the database file without meeting the WAL-reset bug.

SQLite before 3.51.3 can lose pages when a checkpoint runs while another connection commits and
restarts the WAL (sqlite.org/wal.html#walresetbug). Nobody can commit while somebody holds the write
lock, so on those libraries automatic checkpoints are off and this module checkpoints from one
connection while another holds that lock.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from sqlalchemy.engine import Engine

SAFE_WAL_LIBRARY = (3, 51, 3)
CHECKPOINT_BYTES = 8 * 1024 * 1024  # a checkpoint of 8 MiB takes some 20 ms; SQLite's own is 4 MiB


def checkpoint_when_due(engine: Engine) -> bool:
    """Checkpoint when the WAL has grown past `CHECKPOINT_BYTES`; True when it was done."""
    if sqlite3.sqlite_version_info >= SAFE_WAL_LIBRARY:
        return False  # the library does it by itself
    path = str(engine.url.database)
    try:
        if Path(path + "-wal").stat().st_size < CHECKPOINT_BYTES:
            return False
    except FileNotFoundError:
        return False
    return checkpoint(path)


def checkpoint(path: str) -> bool:
    """
    Copy the WAL into the file while no one else can write; False when someone is writing.

    The next writer then starts the WAL anew, unless a reader still needs its old part.
    """
    with (
        closing(sqlite3.connect(path, timeout=0, isolation_level=None)) as holder,
        closing(sqlite3.connect(path, timeout=0, isolation_level=None)) as copier,
    ):
        copier.execute("PRAGMA synchronous = FULL")
        for connection in (holder, copier):
            connection.execute("PRAGMA wal_autocheckpoint = 0")
        try:
            holder.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError:
            return False  # a writer is at work; it will look when it is done
        copied = copier.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
        holder.execute("ROLLBACK")
    return bool(copied[0] == 0)
