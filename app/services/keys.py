"""The key that signs what clients keep for us: given by the operator, or made once and kept."""

from __future__ import annotations

import hashlib
import secrets

from sqlalchemy.engine import Engine

from app.store.engine import read, write
from app.store.keys import insert_key, select_key

STATE_KEY = "state"
KEY_BYTES = 32


def state_key(engine: Engine, told: str | None) -> bytes:
    """
    The key of tracking states.

    It lies in the store unless it is told: what shares the store shares the key, on one machine or
    many, before and after a restart.

    Args:
        told: ``ROADPRINT_STATE_KEY``; None or empty: the store's own, made by whoever comes first.
    """
    if told:
        return hashlib.sha256(told.encode()).digest()
    with read(engine) as connection:
        found = select_key(connection, STATE_KEY)
    if found is not None:
        return found
    with write(engine) as connection:  # alone: of several that start together one makes it
        found = select_key(connection, STATE_KEY)
        if found is None:
            found = secrets.token_bytes(KEY_BYTES)
            insert_key(connection, STATE_KEY, found)
    return found
