"""Towns for the tests of found roads: straight streets, and drives with a receiver's error."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

import numpy as np
import shapely

from app.numerics.geodesy import LocalFrame
from app.numerics.network.finding import find_roads
from app.numerics.network.nouns import Driven, Findings, KnownRoad

HERE = LocalFrame(-118.49, 34.01)
SPEED_MPS = 9.0
BLOCK_M = 150.0


def way(*corners: tuple[float, float], every_m: float = SPEED_MPS) -> np.ndarray:
    """Places along a polyline, ``every_m`` apart."""
    line = shapely.LineString(corners)
    at_m = np.append(np.arange(0.0, line.length, every_m), line.length)
    return shapely.get_coordinates(shapely.line_interpolate_point(line, at_m))


def drive(
    places: np.ndarray,
    *,
    seed: int,
    noise_m: float = 3.0,
    frame: LocalFrame = HERE,
    name: str | None = None,
    new: bool = True,
) -> Driven:
    """A drive through places, one a second, with a receiver's error that changes slowly."""
    rng = np.random.default_rng(seed)
    error_m = rng.normal(0.0, noise_m / 3.0, places.shape) + rng.normal(0.0, noise_m / 2.0, 2)
    at = frame.to_lonlat(*(places + error_m).T)
    time_s = np.arange(len(places), dtype=float)
    return Driven(name or f"drive-{seed}", np.asarray(at.lon), np.asarray(at.lat), time_s, new)


def grid_drives(size: int = 4, *, frame: LocalFrame = HERE, noise_m: float = 3.0) -> list[Driven]:
    """Two drives along every street of a grid and beyond, and some that turn at crossings."""
    end = (size - 1) * BLOCK_M + 60.0
    ways = []
    for street in range(size):
        at = street * BLOCK_M
        ways += [way((-60.0, at), (end, at)), way((at, end), (at, -60.0))]
        ways += [way((end, at), (-60.0, at)), way((at, -60.0), (at, end))]
    for turn in range(1, size - 1):
        at = turn * BLOCK_M
        ways.append(way((-60.0, at), (at, at), (at, end)))
        ways.append(way((at, -60.0), (at, at), (end, at)))
    return [
        drive(places, seed=seed, frame=frame, noise_m=noise_m) for seed, places in enumerate(ways)
    ]


def find(drives: Sequence[Driven], known: Sequence[KnownRoad] = (), prefix: str = "r") -> Findings:
    return find_roads(drives, known, (f"{prefix}{number}" for number in count()))


def lines_of(found: Findings, frame: LocalFrame = HERE) -> dict[str, shapely.LineString]:
    """Found lines in local metres."""
    return {
        road_id: shapely.LineString(np.stack([xy.x_m, xy.y_m], axis=1))
        for road_id, line in found.lines.items()
        for xy in [frame.to_xy(line.lon, line.lat)]
    }


def lies_on(
    street: Sequence[tuple[float, float]], line: shapely.LineString, within_m: float
) -> float:
    """Share of a street that lies so close to a line."""
    places = shapely.points(way(*street, every_m=5.0))
    return float(np.mean(shapely.distance(line, places) <= within_m))


def grid_streets(size: int = 4) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    end = (size - 1) * BLOCK_M + 60.0
    at = [street * BLOCK_M for street in range(size)]
    return [((-60.0, y), (end, y)) for y in at] + [((x, -60.0), (x, end)) for x in at]
