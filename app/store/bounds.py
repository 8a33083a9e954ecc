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
    degrees = np.asarray(lon, dtype=float)
    ordered = np.sort(np.where(degrees >= 180.0, degrees - 360.0, degrees))  # one name a meridian
    gaps = np.diff(ordered, append=ordered[0] + 360.0)
    widest = int(np.argmax(gaps))
    west, east = ordered[(widest + 1) % len(ordered)], ordered[widest]
    parallels = np.asarray(lat, dtype=float)
    return Bounds(float(west), float(parallels.min()), float(east), float(parallels.max()))


def union(first: Bounds, second: Bounds) -> Bounds:
    """The smallest box about the corners of two boxes."""
    lon = [first.west, first.east, second.west, second.east]
    return bounds_of(lon, [first.south, first.north, second.south, second.north])


def touches(one: Bounds, other: Bounds) -> bool:
    """True where two boxes have a place in common; either may hold the antimeridian."""
    if one.south > other.north or other.south > one.north:
        return False
    return (other.west - one.west) % 360.0 <= _width_deg(one) or (
        one.west - other.west
    ) % 360.0 <= _width_deg(other)


def widened(box: Bounds, margin_deg: float) -> Bounds:
    """A box with so many degrees of latitude more on every side, as many metres of longitude."""
    poleward = max(abs(box.south), abs(box.north))
    scale = 1.0 / max(0.05, float(np.cos(np.radians(poleward))))  # meridians draw together
    west, east = box.west - margin_deg * scale, box.east + margin_deg * scale
    if _width_deg(box) + 2.0 * margin_deg * scale >= 360.0:
        west, east = -180.0, 180.0
    return Bounds(
        west + 360.0 if west < -180.0 else west,
        box.south - margin_deg,
        east - 360.0 if east > 180.0 else east,
        box.north + margin_deg,
    )


def overlap(
    box: Bounds,
    west: sa.ColumnElement[float],
    south: sa.ColumnElement[float],
    east: sa.ColumnElement[float],
    north: sa.ColumnElement[float],
) -> sa.ColumnElement[bool]:
    """True in SQL where a row's box touches ``box``; either may hold the antimeridian."""
    parts = [box] if box.west <= box.east < 180.0 else _halves(box)
    plain = sa.or_(*(sa.and_(west <= part.east, east >= part.west) for part in parts))
    wrapped = sa.or_(*(sa.or_(west <= part.east, east >= part.west) for part in parts))
    across = sa.case((west <= east, plain), else_=wrapped)
    return sa.and_(south <= box.north, north >= box.south, across)


def _width_deg(box: Bounds) -> float:
    whole = box.east - box.west >= 360.0
    return 360.0 if whole else (box.east - box.west) % 360.0


def _halves(box: Bounds) -> list[Bounds]:
    return [
        Bounds(box.west, box.south, 180.0, box.north),
        # A box that ends on the antimeridian holds it under its other name, too.
        Bounds(-180.0, box.south, box.east if box.east < 180.0 else -180.0, box.north),
    ]
