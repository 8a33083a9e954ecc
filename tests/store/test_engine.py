"""The door to the database: one writer at a time, durable, and quiet about nothing."""

from __future__ import annotations

import sqlite3
import threading
import time
import warnings

import pytest
import sqlalchemy as sa

from app.store import checkpoint as checkpoints
from app.store.checkpoint import checkpoint, checkpoint_when_due
from app.store.columns import new_id, utc_now
from app.store.engine import (
    OldSQLiteWarning,
    create_store_engine,
    read,
    warn_of_old_sqlite,
    write,
)
from app.store.roads import note_cells
from app.store.tables import cells


def pragma(engine: sa.Engine, name: str) -> object:
    with read(engine) as connection:
        return connection.exec_driver_sql(f"PRAGMA {name}").scalar()


def count_cells(engine: sa.Engine) -> int:
    with read(engine) as connection:
        return connection.scalar(sa.select(sa.func.count()).select_from(cells))


def test_sqlite_is_durable_and_holds_its_foreign_keys(sqlite_engine):
    """Write-ahead log, fsync at every commit, foreign keys on, a busy timeout."""
    assert pragma(sqlite_engine, "journal_mode") == "wal"
    assert pragma(sqlite_engine, "synchronous") == 2  # FULL
    assert pragma(sqlite_engine, "foreign_keys") == 1
    assert pragma(sqlite_engine, "busy_timeout") == 10_000


def test_a_failed_transaction_leaves_nothing(engine):
    """What was written before an exception is taken back."""

    def fail() -> None:
        with write(engine) as connection:
            note_cells(connection, ["850:1"])
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert count_cells(engine) == 0


def test_a_writer_sees_what_the_writer_before_it_committed(engine):
    """Two read-then-write transactions at once lose no update: the second waits for the first."""
    inside, go = threading.Event(), threading.Event()

    def add_one(*, wait: bool) -> None:
        with write(engine) as connection:
            seen = connection.scalar(sa.select(sa.func.count()).select_from(cells))
            if wait:
                inside.set()
                assert go.wait(10)
            note_cells(connection, [f"850:{seen}"])

    first = threading.Thread(target=add_one, kwargs={"wait": True})
    first.start()
    assert inside.wait(10)
    second = threading.Thread(target=add_one, kwargs={"wait": False})
    second.start()
    time.sleep(0.1)
    assert second.is_alive()
    go.set()
    first.join()
    second.join()
    assert count_cells(engine) == 2


def test_readers_are_not_held_up_by_a_writer(engine):
    """A reader beside an open write transaction sees the state before it, at once."""
    with write(engine) as connection:
        note_cells(connection, ["850:1"])
        assert count_cells(engine) == 0
    assert count_cells(engine) == 1


@pytest.mark.parametrize("url", ["sqlite://", "sqlite:///:memory:", "mysql://localhost/x"])
def test_other_stores_are_refused(url):
    """A store that several processes cannot share is no store."""
    with pytest.raises(ValueError, match="store"):
        create_store_engine(url)


def test_an_old_library_is_named_at_start(monkeypatch):
    """Before 3.51.3 a warning names the version; from it on there is none."""
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 51, 2))
    with pytest.warns(OldSQLiteWarning, match=r"3\.51\.3"):
        warn_of_old_sqlite()
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 51, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_old_sqlite()


def test_the_log_does_not_grow_without_end(tmp_path, monkeypatch):
    """With automatic checkpoints off, our own keep the WAL near its limit and lose nothing."""
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 40, 1))
    monkeypatch.setattr(checkpoints, "CHECKPOINT_BYTES", 100_000)
    monkeypatch.setattr("app.store.engine.CHECKPOINT_BYTES", 100_000)
    done = []
    monkeypatch.setattr(checkpoints, "checkpoint", lambda path: done.append(checkpoint(path)))
    engine = create_store_engine(f"sqlite:///{tmp_path}/store.sqlite")
    with write(engine) as connection:
        connection.exec_driver_sql("CREATE TABLE pages (number INTEGER, body BLOB)")
    log = tmp_path / "store.sqlite-wal"
    highest = 0
    for number in range(100):
        with write(engine) as connection:
            connection.exec_driver_sql("INSERT INTO pages VALUES (?, randomblob(8000))", (number,))
        highest = max(highest, log.stat().st_size)
    assert highest < 200_000
    assert 4 < len(done) < 25  # 100 inserts of two or three pages each: one in eight or so
    with read(engine) as connection:
        assert connection.exec_driver_sql("SELECT count(*) FROM pages").scalar() == 100
        assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
    engine.dispose()


def test_nobody_checkpoints_while_somebody_writes(sqlite_engine):
    """The checkpoint gives way to a writer: a commit during a checkpoint is what corrupts."""
    path = sqlite_engine.url.database
    with write(sqlite_engine) as connection:
        note_cells(connection, ["850:1"])
        assert not checkpoint(path)
    assert checkpoint(path)
    assert not checkpoint_when_due(sqlite_engine)  # nothing is due now


def test_ids_sort_by_time():
    """Ids made one after another sort in that order, to a fraction of a millisecond."""
    made = []
    for _ in range(200):
        made.append(new_id())
        time.sleep(2e-6)
    assert made == sorted(made)
    assert len(set(made)) == len(made)


def test_moments_come_back_aware_and_in_utc(engine):
    """A moment survives the store to the microsecond, with its zone."""
    moment = utc_now()
    with write(engine) as connection:
        connection.execute(cells.insert().values(cell="850:1", first_seen_at=moment))
    with read(engine) as connection:
        assert connection.scalar(sa.select(cells.c.first_seen_at)) == moment
