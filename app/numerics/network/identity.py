"""Roads keep their names: lines found anew are laid over the lines that were known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float
from shapely import LineString

from app.numerics.geodesy import Floats

NEAR_M = 20.0
PARALLEL_COS = float(np.cos(np.radians(30.0)))
SAMPLED_M = 10.0
LEAST_SHARED_M = 40.0
MOVED_M = 5.0  # a line that moved less, and whose ends did, is the same line
END_MOVED_M = 15.0


@dataclass(frozen=True, slots=True, eq=False)
class Named:
    """A line with the name it keeps, None when it is new; ``same`` when nothing changed."""

    name: str | None
    line: Float[np.ndarray, "vertices 2"]
    same: bool


def name_lines(
    lines: Sequence[Floats],
    known: Mapping[str, Floats],
) -> list[Named]:
    """
    Give each line the name of the known line that it shares most metres with.

    A name is given once. A line that keeps its name keeps its direction too, and the known line
    itself where it has hardly moved, so that chainages stay what they were.
    """
    shared = sorted(
        (
            (-abs(metres), name, number, metres < 0.0)
            for number, line in enumerate(lines)
            for name, other in known.items()
            if abs(metres := _shared_m(other, line)) >= LEAST_SHARED_M
        ),
        key=lambda row: row[:3],
    )
    named: dict[int, Named] = {}
    taken: set[str] = set()
    for _, name, number, against in shared:
        if number in named or name in taken:
            continue
        line = lines[number][::-1] if against else lines[number]
        same = _is_same(known[name], line)
        named[number] = Named(name, known[name] if same else line, same)
        taken.add(name)
    return [named.get(number, Named(None, line, same=False)) for number, line in enumerate(lines)]


def _shared_m(known: Floats, line: Floats) -> float:
    """Metres of the known line along the other; negative when they run against each other."""
    one, other = LineString(known), LineString(line)
    if one.distance(other) > NEAR_M:
        return 0.0
    at_m = np.arange(0.0, one.length, SAMPLED_M)
    points = shapely.line_interpolate_point(one, at_m)
    near = shapely.distance(other, points) <= NEAR_M
    foot_m = shapely.line_locate_point(other, points)
    cos = (_headings(one, at_m) * _headings(other, foot_m)).sum(axis=1)
    along = near & (np.abs(cos) >= PARALLEL_COS)
    sign = 1.0 if cos[along].sum() >= 0.0 else -1.0
    return sign * float(along.sum()) * SAMPLED_M


def _headings(line: LineString, at_m: Floats) -> Floats:
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, at_m + SAMPLED_M))
    behind = shapely.get_coordinates(
        shapely.line_interpolate_point(line, np.maximum(at_m - SAMPLED_M, 0.0))
    )
    away = ahead - behind
    return away / np.maximum(np.hypot(*away.T), 1e-9)[:, None]


def _is_same(known: Floats, line: Floats) -> bool:
    if np.hypot(*(known[[0, -1]] - line[[0, -1]]).T).max() > END_MOVED_M:
        return False
    return bool(shapely.hausdorff_distance(LineString(known), LineString(line), 0.1) <= END_MOVED_M
                and np.quantile(_off_m(known, line), 0.9) <= MOVED_M)  # fmt: skip


def _off_m(known: Floats, line: Floats) -> Floats:
    one = LineString(known)
    points = shapely.line_interpolate_point(one, np.arange(0.0, one.length, SAMPLED_M))
    return np.asarray(shapely.distance(LineString(line), points))
