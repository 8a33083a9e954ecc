"""
The door to the database: one engine, read transactions, and one writer at a time.

SQLite and PostgreSQL are told apart here and nowhere else (besides the spelling of upserts).
"""

from __future__ import annotations

import sqlite3
import time
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import URL, Connection, Engine, make_url

from app.store.checkpoint import CHECKPOINT_BYTES, SAFE_WAL_LIBRARY, checkpoint_when_due

DEFAULT_BUSY_TIMEOUT_MS = 10_000
WRITER_LOCK = 0x726F6164  # "road": PostgreSQL's advisory lock that makes it one writer at a time
_WRITES = "roadprint_writes"


class OldSQLiteWarning(UserWarning):
    """The SQLite library has the WAL-reset bug; roadprint works round it."""


def create_store_engine(url: str, *, busy_timeout_ms: int = DEFAULT_BUSY_TIMEOUT_MS) -> Engine:
    """
    An engine for a SQLite file or a PostgreSQL database.

    Args:
        url: ``sqlite:///path`` or ``postgresql://...`` (psycopg is used whether named or not).
        busy_timeout_ms: How long a SQLite connection waits for another's lock.

    Raises:
        ValueError: Another kind of database, or SQLite in memory (each connection would see its
            own).
    """
    parsed = make_url(url)
    if parsed.get_backend_name() == "postgresql":
        return sa.create_engine(parsed.set(drivername="postgresql+psycopg"), pool_pre_ping=True)
    if parsed.get_backend_name() != "sqlite":
        raise ValueError(f"roadprint keeps its store in SQLite or PostgreSQL, not {url!r}")
    if not parsed.database or parsed.database == ":memory:":
        raise ValueError("the store needs a SQLite file: several processes share it")
    return _sqlite_engine(parsed, busy_timeout_ms)


def warn_of_old_sqlite() -> None:
    """Say once at start that the SQLite library is older than the one without the WAL-reset bug."""
    if sqlite3.sqlite_version_info < SAFE_WAL_LIBRARY:
        safe = ".".join(map(str, SAFE_WAL_LIBRARY))
        warnings.warn(
            f"SQLite {sqlite3.sqlite_version} is older than {safe}, which mends a rare corruption "
            "of WAL files; roadprint checkpoints only under the write lock to stay clear of it",
            OldSQLiteWarning,
            stacklevel=2,
        )


@contextmanager
def read(engine: Engine) -> Iterator[Connection]:
    """A transaction that sees one moment of the store (SQLite) and writes nothing."""
    with engine.connect() as connection, connection.begin():
        yield connection


@contextmanager
def write(engine: Engine) -> Iterator[Connection]:
    """
    A transaction that alone writes, from its first statement to its commit.

    What it reads stays true until it commits, so "look, then write" needs no retry and no
    unique-key acrobatics, on both databases.
    """
    with (
        engine.connect().execution_options(**{_WRITES: True}) as connection,
        connection.begin(),
    ):
        if engine.dialect.name == "postgresql":
            connection.execute(sa.select(sa.func.pg_advisory_xact_lock(WRITER_LOCK)))
        yield connection
    if engine.dialect.name == "sqlite":
        checkpoint_when_due(engine)


def _sqlite_engine(url: URL, busy_timeout_ms: int) -> Engine:
    engine = sa.create_engine(url, connect_args={"timeout": busy_timeout_ms / 1000})
    own_checkpoints = sqlite3.sqlite_version_info < SAFE_WAL_LIBRARY

    @sa.event.listens_for(engine, "connect")
    def _prepare(connection: sqlite3.Connection, _record: Any) -> None:
        connection.isolation_level = None  # the driver begins nothing by itself: `_begin` does
        with closing(connection.cursor()) as cursor:
            cursor.execute(f"PRAGMA busy_timeout = {busy_timeout_ms}")
            _use_wal(cursor, busy_timeout_ms / 1000)
            cursor.execute("PRAGMA synchronous = FULL")  # an accepted survey survives a power cut
            cursor.execute("PRAGMA foreign_keys = ON")
            cursor.execute("PRAGMA cache_size = -65536")  # 64 MiB
            if own_checkpoints:
                cursor.execute("PRAGMA wal_autocheckpoint = 0")
                # A WAL that starts anew is cut to this, so that its size says what is due.
                cursor.execute(f"PRAGMA journal_size_limit = {CHECKPOINT_BYTES // 8}")

    @sa.event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        # IMMEDIATE takes the write lock at once: a read that turns into a write later could not
        # wait for another writer, it would fail at once however long the busy timeout.
        writes = connection.get_execution_options().get(_WRITES, False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN DEFERRED")

    return engine


def _use_wal(cursor: sqlite3.Cursor, patience_s: float) -> None:
    """Switch the file to WAL; the mode stays in the file, and the switch ignores busy_timeout."""
    deadline = time.monotonic() + patience_s
    while True:
        try:
            cursor.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.01)
        else:
            return
