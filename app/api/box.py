"""Boxes in queries."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from app.api.faults import Faults
from app.services.roads import Bounds

BBOX: Any = Field(
    default=None,
    description="`west,south,east,north` in degrees; west > east holds the antimeridian.",
    examples=["-118.50,34.00,-118.48,34.03"],
)


def bounds_of_query(bbox: str) -> Bounds:
    """
    The box of a ``bbox`` parameter.

    Raises:
        InvalidInput: It is no box on the earth.
    """
    faults = Faults()
    try:
        west, south, east, north = (float(edge) for edge in bbox.split(","))
    except ValueError:
        faults.add("", f"query parameter bbox: {bbox[:60]!r} is not west,south,east,north")
        raise faults.error() from None
    # Written so that NaN fails.
    if not (abs(west) <= 180 and abs(east) <= 180 and -90 <= south <= north <= 90):
        faults.add("", f"query parameter bbox: {bbox[:60]!r} is no box on the earth")
    faults.raise_if_any()
    return Bounds(west, south, east, north)
