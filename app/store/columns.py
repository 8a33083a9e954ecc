"""Column shapes: arrays as little-endian bytes, moments as UTC, ids that sort by time."""

from __future__ import annotations

import secrets
import time
import uuid
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
import sqlalchemy as sa
from numpy.typing import ArrayLike, NDArray
from sqlalchemy.engine import Dialect

Stored = Literal["<f2", "<f4", "<f8", "|b1"]
F2: Stored = "<f2"
F4: Stored = "<f4"
F8: Stored = "<f8"
B1: Stored = "|b1"


def pack(array: ArrayLike, stored: Stored) -> bytes:
    """The array as C-ordered bytes of the stored type; its shape lives in columns beside it."""
    return np.ascontiguousarray(array, dtype=np.dtype(stored)).tobytes()


def unpack(blob: bytes, stored: Stored, *shape: int) -> NDArray[Any]:
    """A read-only array over the blob; no copy. One dimension may be -1."""
    return np.frombuffer(blob, dtype=np.dtype(stored)).reshape(shape or (-1,))


class UtcMoment(sa.TypeDecorator[datetime]):
    """An aware datetime, kept as UTC; SQLite has no zones, so it gets the naive UTC one."""

    impl = sa.DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Aware datetime to what the database keeps."""
        if value is None:
            return None
        utc = value.astimezone(UTC)
        return utc.replace(tzinfo=None) if dialect.name == "sqlite" else utc

    def process_result_value(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """What the database keeps to an aware datetime in UTC."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


def utc_now() -> datetime:
    """The present moment, aware."""
    return datetime.now(UTC)


def new_id() -> str:
    """
    A UUID version 7 (RFC 9562, method 3): ids sort by the time they were made.

    48 bits of milliseconds, 12 bits of the fraction of a millisecond, 62 random bits.
    """
    milliseconds, rest_ns = divmod(time.time_ns(), 1_000_000)
    fraction = rest_ns * 4096 // 1_000_000
    value = milliseconds << 80 | 7 << 76 | fraction << 64 | 0b10 << 62 | secrets.randbits(62)
    return str(uuid.UUID(int=value))
