"""
Neighbourhoods of roads: within one a single plane serves, between two only "far away" is told.

One degree of longitude is 96 km at Santa Monica and 39 km at Tromso. A map of both needs a plane
for either, and the roads of one town must share one, or distances across a seam would be wrong.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.domain import Line
from app.numerics.geodesy import XY, LocalFrame, LonLat, mean_longitude_deg, wrap_longitude_deg

TILE_DEG = 0.2  # of latitude, some 22 km: roads nearer than that are always of one neighbourhood

Tile = tuple[int, int]  # band of latitude, and how manieth of it eastward from the antimeridian


@dataclass(frozen=True, slots=True)
class Plane:
    """A local frame, and where its origin lies in the plane that all neighbourhoods share."""

    frame: LocalFrame
    east_m: float = 0.0
    north_m: float = 0.0

    def to_xy(self, place: LonLat) -> XY:
        """Metres in the shared plane: true within the neighbourhood, roughly so to others."""
        xy = self.frame.to_xy(place.lon, place.lat)
        if not self.east_m and not self.north_m:
            return xy
        return XY(xy.x_m + self.east_m, xy.y_m + self.north_m)


def neighbourhoods(lines: Sequence[Line]) -> list[list[int]]:
    """
    Numbers of lines that belong together, in the order of their first lines.

    Lines less than `TILE_DEG` apart always do; so do those that others in between join. One that
    reaches over hundreds of kilometres has its eastward metres off by the change of scale in it.
    """
    tiles = _tiles(lines)
    on_tile: dict[Tile, list[int]] = defaultdict(list)
    for number, some in enumerate(tiles):
        for tile in some:
            on_tile[tile].append(number)
    left = [True] * len(lines)
    groups = []
    for first in range(len(lines)):
        if not left[first]:
            continue
        left[first] = False
        group, open_lines, seen = [], [first], set[Tile]()
        while open_lines:
            number = open_lines.pop()
            group.append(number)
            for tile in {near for own in tiles[number] for near in _around(own)} - seen:
                seen.add(tile)
                for other in on_tile.get(tile, ()):
                    if left[other]:
                        left[other] = False
                        open_lines.append(other)
        groups.append(sorted(group))
    return groups


def planes(lines: Sequence[Line]) -> list[Plane]:
    """The plane of each line: one a neighbourhood, about the mean of its lines' first vertices."""
    found = [Plane(LocalFrame(0.0, 0.0))] * len(lines)
    middle = None
    for group in neighbourhoods(lines):
        plane = Plane(
            LocalFrame(
                mean_longitude_deg([lines[number].lon[0] for number in group]),
                float(np.mean([lines[number].lat[0] for number in group])),
            )
        )
        if middle is None:
            middle = plane.frame
        else:  # placed by its own scale of longitude, so that it lies about as far as it does
            away = replace(middle, lat0=plane.frame.lat0).to_xy(plane.frame.lon0, middle.lat0)
            plane = Plane(plane.frame, float(away.x_m), -float(away.y_m))
        for number in group:
            found[number] = plane
    return found


def _tiles(lines: Sequence[Line]) -> list[set[Tile]]:
    """The tiles that each line's vertices lie on."""
    if not lines:
        return []
    lat = np.concatenate([line.lat for line in lines])
    lon = wrap_longitude_deg(np.concatenate([line.lon for line in lines]))
    band = np.floor(lat / TILE_DEG).astype(int)
    column = np.floor((lon + 180.0) / 360.0 * _columns(band)).astype(int)
    owner = np.repeat(np.arange(len(lines)), [len(line.lon) for line in lines])
    rows = np.unique(np.stack([owner, band, column], axis=1), axis=0)
    found: list[set[Tile]] = [set() for _ in lines]
    for number, north, east in rows.tolist():
        found[number].add((north, east))
    return found


def _columns(band: np.ndarray) -> np.ndarray:
    """How many tiles go round the earth, none of them narrower than `TILE_DEG` of latitude."""
    poleward = np.maximum(np.abs(band), np.abs(band + 1)) * TILE_DEG
    narrow = np.maximum(np.cos(np.radians(np.minimum(poleward, 90.0))), 1e-9)
    return np.asarray(np.maximum(np.floor(360.0 / TILE_DEG * narrow), 1.0).astype(int))


def _around(tile: Tile) -> set[Tile]:
    """A tile and all that touch it or lie beyond a corner of it."""
    band, column = tile
    own, *counts = _columns(np.array([band, band - 1, band, band + 1])).tolist()
    found = set()
    for north, count in zip((band - 1, band, band + 1), counts, strict=True):
        west, east = (column - 1) * count // own, -(-(column + 2) * count // own)
        found |= {(north, each % count) for each in range(west, east)}
    return found
