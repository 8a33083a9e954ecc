"""The key of tracking states is one for all who share a store."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import sqlalchemy as sa

from app.services.keys import KEY_BYTES, state_key
from app.store.engine import create_store_engine, read
from app.store.keys import select_key
from app.store.migrate import migrate


def test_all_that_start_at_once_share_one_key(empty_url):
    """Eight processes' worth of first starts end up with the same key, on both databases."""
    engines = [create_store_engine(empty_url) for _ in range(8)]
    migrate(engines[0])
    together = threading.Barrier(len(engines))

    def start(engine: sa.Engine) -> bytes:
        together.wait()
        return state_key(engine, None)

    with ThreadPoolExecutor(len(engines)) as pool:
        found = set(pool.map(start, engines))
    assert len(found) == 1
    assert len(found.pop()) == KEY_BYTES
    for engine in engines:
        engine.dispose()


def test_a_key_survives_a_restart_and_stores_differ(engine, tmp_path):
    """It lies in the store, and no two stores have the same."""
    first = state_key(engine, None)
    assert state_key(engine, "") == first
    other = create_store_engine(f"sqlite:///{tmp_path / 'other.sqlite'}")
    migrate(other)
    assert state_key(other, None) != first
    other.dispose()


def test_a_told_key_is_used_and_not_stored(engine):
    """What the operator tells rules, everywhere the same, and leaves no trace."""
    assert state_key(engine, "a secret") == state_key(engine, "a secret")
    assert state_key(engine, "a secret") != state_key(engine, "another")
    with read(engine) as connection:
        assert select_key(connection, "state") is None
