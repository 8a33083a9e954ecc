"""Longitude and latitude in each other's place: found by ranges, and by the cells' countries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.formats.countries import Box, box_of


def looks_swapped(lon: NDArray[np.float64], lat: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where a latitude is none and both would be right in each other's place."""
    return (np.abs(lat) > 90.0) & (np.abs(lat) <= 180.0) & (np.abs(lon) <= 90.0)


def swapped_by_country(
    lon: NDArray[np.float64], lat: NDArray[np.float64], global_ids: list[str]
) -> bool:
    """
    Whether the positions lie outside their cells' countries and would lie inside them with
    longitude and latitude in each other's place.

    A city whose country holds both places (Lagos, say) is not found this way.
    """
    boxes = _boxes_of(global_ids)
    if not boxes or not len(lon):
        return False
    return not _inside(lon, lat, boxes).any() and bool(_inside(lat, lon, boxes).all())


def confirmed_by_country(
    lon: NDArray[np.float64], lat: NDArray[np.float64], global_ids: list[str]
) -> bool:
    """Whether the positions lie in their cells' countries and would not the other way round."""
    boxes = _boxes_of(global_ids)
    return bool(boxes and _inside(lon, lat, boxes).all() and not _inside(lat, lon, boxes).any())


def _boxes_of(global_ids: list[str]) -> list[Box]:
    """Boxes of all countries among ``mcc-mnc-...``; none when one of them is of no known place."""
    codes = {gid[:3] for gid in global_ids if gid[:3].isdigit() and gid[3:4] == "-"}
    boxes = [box for code in codes if (box := box_of(code)) is not None]
    return boxes if len(boxes) == len(codes) else []


def _inside(
    lon: NDArray[np.float64], lat: NDArray[np.float64], boxes: list[Box]
) -> NDArray[np.bool_]:
    found = np.zeros(len(lon), bool)
    for west, south, east, north in boxes:
        found |= (lon >= west) & (lon <= east) & (lat >= south) & (lat <= north)
    return found
