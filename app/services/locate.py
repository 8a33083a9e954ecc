"""Locating a window on a map that is in memory: no database, no clock."""

from __future__ import annotations

from app.domain import Fix, Window
from app.numerics import matching
from app.numerics.index import MapIndex


def locate(index: MapIndex, window: Window, *, confidence: float = 0.68) -> Fix:
    """Where the window's last sample was; `app.numerics.matching.locate` says how."""
    return matching.locate(index, window, confidence=confidence)
