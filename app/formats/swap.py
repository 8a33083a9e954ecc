"""Longitude and latitude in each other's place: found by ranges, and by the cells' countries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# West, south, east, north of each first digit of the mobile country code (ITU-T E.212): wide boxes
# round all of its countries, so that a position outside is certainly wrong.
ZONES = {
    "2": (-75.0, 12.0, 180.0, 83.0),  # Europe with its outlying parts, Russia, Turkey
    "3": (-180.0, 5.0, -10.0, 84.0),  # North America, Greenland, the Caribbean
    "4": (19.0, -12.0, 155.0, 56.0),  # Asia, the Middle East
    "6": (-35.0, -48.0, 80.0, 38.0),  # Africa and its islands
    "7": (-120.0, -60.0, -25.0, 34.0),  # Central and South America
}


def looks_swapped(lon: NDArray[np.float64], lat: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where a latitude is none and both would be right in each other's place."""
    return (np.abs(lat) > 90.0) & (np.abs(lat) <= 180.0) & (np.abs(lon) <= 90.0)


def swapped_by_country(
    lon: NDArray[np.float64], lat: NDArray[np.float64], global_ids: list[str]
) -> bool:
    """
    Whether the positions lie outside the zones of their cells' countries and would lie inside them
    with longitude and latitude in each other's place.

    A city whose zone holds both places (Dakar, say) is not found this way.
    """
    zones = {gid[0] for gid in global_ids if gid[:3].isdigit() and gid[3:4] == "-"}
    boxes = [ZONES[zone] for zone in zones if zone in ZONES]
    if not boxes or len(boxes) != len(zones) or not len(lon):
        return False
    return not _any_inside(lon, lat, boxes) and _all_inside(lat, lon, boxes)


def _inside(
    lon: NDArray[np.float64],
    lat: NDArray[np.float64],
    boxes: list[tuple[float, float, float, float]],
) -> NDArray[np.bool_]:
    found = np.zeros(len(lon), bool)
    for west, south, east, north in boxes:
        found |= (lon >= west) & (lon <= east) & (lat >= south) & (lat <= north)
    return found


def _any_inside(
    lon: NDArray[np.float64],
    lat: NDArray[np.float64],
    boxes: list[tuple[float, float, float, float]],
) -> bool:
    return bool(_inside(lon, lat, boxes).any())


def _all_inside(
    lon: NDArray[np.float64],
    lat: NDArray[np.float64],
    boxes: list[tuple[float, float, float, float]],
) -> bool:
    return bool(_inside(lon, lat, boxes).all())
