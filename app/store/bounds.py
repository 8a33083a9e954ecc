"""Boxes in degrees, the antimeridian included, as values and as SQL."""

from __future__ import annotations

import numpy as np
import sqlalchemy as sa
from numpy.typing import ArrayLike

from app.store.records import Bounds


def bounds_of(lon: ArrayLike, lat: ArrayLike) -> Bounds:
    """
    The smallest box about points; ``west > east`` when it runs across the antimeridian.

    The box is the whole circle less the widest gap between neighbouring longitudes.
    """
    ordered = np.sort(np.asarray(lon, dtype=float))
    gaps = np.diff(ordered, append=ordered[0] + 360.0)
    widest = int(np.argmax(gaps))
    west, east = ordered[(widest + 1) % len(ordered)], ordered[widest]
    parallels = np.asarray(lat, dtype=float)
    return Bounds(float(west), float(parallels.min()), float(east), float(parallels.max()))


def union(first: Bounds, second: Bounds) -> Bounds:
    """The smallest box about the corners of two boxes."""
    lon = [first.west, first.east, second.west, second.east]
    return bounds_of(lon, [first.south, first.north, second.south, second.north])


def overlap(
    box: Bounds,
    west: sa.ColumnElement[float],
    south: sa.ColumnElement[float],
    east: sa.ColumnElement[float],
    north: sa.ColumnElement[float],
) -> sa.ColumnElement[bool]:
    """True in SQL where a row's box touches ``box``; either may hold the antimeridian."""
    parts = [box] if box.west <= box.east else _halves(box)
    plain = sa.or_(*(sa.and_(west <= part.east, east >= part.west) for part in parts))
    wrapped = sa.or_(*(sa.or_(west <= part.east, east >= part.west) for part in parts))
    across = sa.case((west <= east, plain), else_=wrapped)
    return sa.and_(south <= box.north, north >= box.south, across)


def _halves(box: Bounds) -> list[Bounds]:
    return [
        Bounds(box.west, box.south, 180.0, box.north),
        Bounds(-180.0, box.south, box.east, box.north),
    ]
