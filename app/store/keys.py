"""Keys of the store's own making: one value a name, the same for every process."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from app.store.tables import keys


def select_key(connection: Connection, name: str) -> bytes | None:
    """The key of that name, None before there is one."""
    found: bytes | None = connection.scalar(sa.select(keys.c.value).where(keys.c.name == name))
    return found


def insert_key(connection: Connection, name: str, value: bytes) -> None:
    """Keep a key; its name must be new."""
    connection.execute(sa.insert(keys).values(name=name, value=value))
