"""Chains to centre lines: ends brought to the crossings they were cut for, jitter smoothed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, Point
from shapely.strtree import STRtree

from app.numerics.geodesy import Floats
from app.numerics.network.spurs import on_seeds
from app.numerics.network.steps import STEP_M

SHORTEST_M = 60.0  # of a road; less is a car park or a manoeuvre
PROLONGED_M = 45.0  # a turn is cut out some 20 m to either side of its crossing
WIDTH_M = 20.0  # of the smoothing along the line
SIMPLIFIED_TO_M = 0.5


def finish(
    chains: Sequence[Floats], given: Sequence[Floats] = (), seeds: Sequence[Floats] = ()
) -> list[Floats]:
    """
    Centre lines of the chains that are long enough, vertices in local metres.

    Args:
        given: Lines of other roads, to which ends may be brought.
        seeds: Stretches that are smooth already: smoothed each time they would creep.
    """
    smooth = [_smoothed(line, seeds) for line in chains if len(line) > 1]
    long = [line for line in smooth if LineString(line).length >= SHORTEST_M]
    return [
        np.array(LineString(line).simplify(SIMPLIFIED_TO_M).coords)
        for line in _meeting(long, given)
    ]


def _meeting(lines: Sequence[Floats], given: Sequence[Floats]) -> list[Floats]:
    """Each end prolonged to the first line, or prolonged line, that lies straight ahead."""
    rays = [[_ray(line[::-1]), _ray(line)] for line in lines]
    reaching = [
        LineString(np.concatenate([pair[0][1:], line, pair[1][1:]]))
        for line, pair in zip(lines, rays, strict=True)
    ] + [LineString(line) for line in given]
    tree = STRtree(reaching)
    met = []
    for number, line in enumerate(lines):
        parts = [line]
        for ray, at_start in zip(rays[number], (True, False), strict=True):
            hit = _first_hit(ray, [reaching[i] for i in tree.query(LineString(ray)) if i != number])
            if hit is not None:
                parts.insert(0 if at_start else len(parts), hit)
        met.append(np.concatenate(parts))
    return met


def _ray(line: Floats) -> Floats:
    """From the line's last vertex straight on."""
    back = line[max(-6, -len(line))]
    away = (line[-1] - back) / max(float(np.hypot(*(line[-1] - back))), 1e-9)
    return np.stack([line[-1], line[-1] + PROLONGED_M * away])


def _first_hit(ray: Floats, others: Sequence[LineString]) -> Floats | None:
    path, start = LineString(ray), Point(ray[0])
    hits = [shapely.intersection(path, other) for other in others]
    away_m = [shapely.distance(start, hit) for hit in hits if not hit.is_empty]
    if not away_m:
        return None
    nearest = path.interpolate(min(away_m))
    return np.array([[nearest.x, nearest.y]])


def _smoothed(line: Floats, seeds: Sequence[Floats] = ()) -> Floats:
    """Gaussian mean along the line in even steps; its ends stay where they are."""
    whole = LineString(line)
    count = max(2, round(whole.length / STEP_M) + 1)
    at_m = np.linspace(0.0, whole.length, count)
    even = shapely.get_coordinates(shapely.line_interpolate_point(whole, at_m))
    reach = min(int(3.0 * WIDTH_M / STEP_M), count - 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * STEP_M / WIDTH_M) ** 2)
    kernel /= kernel.sum()
    before, after = 2.0 * even[0] - even[reach:0:-1], 2.0 * even[-1] - even[-2 : -reach - 2 : -1]
    padded = np.concatenate([before, even, after])
    smooth = np.stack([np.convolve(padded[:, axis], kernel, "valid") for axis in (0, 1)], axis=1)
    return np.where(on_seeds(even, seeds)[:, None], even, smooth)
