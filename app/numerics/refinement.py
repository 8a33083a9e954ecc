"""
Places between the metres: where the posterior is narrower than the grid, look closer.

Between two grid positions the curve is taken as straight and its precision ``A`` as constant. Then
the residual and weight channels are straight, too, and the score, being a square of the level, lies
above the straight line: at share ``f`` by ``f (1 - f)`` times the sum of the profile's ``bend``
over all readings. No finer profile is needed.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from app.numerics.index import MapIndex
from app.numerics.observation import offset_gain
from app.numerics.posterior import Places
from app.numerics.query import Query

PARTS = 5  # 0.2 m: an eighth of the narrowest posteriors seen, from edge to edge
NARROW_M = 1.25  # standard deviation; wider posteriors are drawn well enough by their metres
AROUND = 3  # grid positions on either side of the best that are drawn anew
SHARES = np.arange(PARTS) / PARTS


def refine(index: MapIndex, query: Query, places: Places) -> Places:
    """
    Draw the neighbourhood of the best place anew at a fifth of the grid, where that matters.

    The new places replace those of the same metres, so that every metre keeps its weight.
    """
    best = int(places.score.argmax())
    road, sign = int(places.road[best]), int(places.sign[best])
    step_m = index.roads[road].step_m
    # Places of one road and direction stand in a row, one grid step apart.
    first, last = _run(places, best, step_m)
    if last - first < 2 or _spread_m(places, first, last, index) > NARROW_M * step_m:
        return places
    grid = np.rint(places.chainage_m[first : last + 1] / step_m).astype(np.intp)
    bend = _bend(index, query, road, grid[:-1], sign)
    finer = _between(places, first, last, bend, index.calibration.offset_sd_db)
    kept = np.ones(len(places), dtype=bool)
    kept[first : last + 1] = False
    return Places.join([places.take(kept), finer])


def _run(places: Places, best: int, step_m: float) -> tuple[int, int]:
    """The row of places about the best one, at most `AROUND` to either side."""
    low, high = max(best - AROUND, 0), min(best + AROUND, len(places) - 1)
    part = slice(low, high + 1)
    same = (places.road[part] == places.road[best]) & (places.sign[part] == places.sign[best])
    steps = np.arange(low - best, high - best + 1)
    same &= np.abs(places.chainage_m[part] - places.chainage_m[best] - steps * step_m) < step_m / 2
    row = np.flatnonzero(same)
    return low + int(row[0]), low + int(row[-1])


def _spread_m(places: Places, first: int, last: int, index: MapIndex) -> float:
    score = places.score[first : last + 1]
    weight = np.exp((score - score.max()) / index.calibration.temperature)
    weight /= weight.sum()
    chainage_m = places.chainage_m[first : last + 1]
    mean_m = float(weight @ chainage_m)
    return float(np.sqrt(weight @ (chainage_m - mean_m) ** 2))


def _bend(
    index: MapIndex, query: Query, road: int, grid: np.ndarray, sign: int
) -> Float[np.ndarray, " intervals"]:
    """How far the score lies above the straight line, from each grid position to the next."""
    bend, aim = index.roads[road].along.bend, query.aim_at(index, road)
    counted = query.fine.heard[:, aim.here] * query.fine.weight[:, None]
    at = grid - sign * aim.behind[:, None]
    low, high = max(int(at.min()), 0), min(int(at.max()), bend.shape[1] - 1)
    each = np.zeros((len(at), high - low + 2))  # the last column stands for "off the road"
    each[:, :-1] = counted @ bend[aim.cells, low : high + 1]
    at[(at < low) | (at > high)] = high + 1
    starts = np.arange(0, each.size, each.shape[1])[:, None] - low
    return np.asarray(each.ravel().take(at + starts).sum(axis=0))


def _between(
    places: Places,
    first: int,
    last: int,
    bend: Float[np.ndarray, " intervals"],
    offset_sd_db: float,
) -> Places:
    residual, weight = places.residual[first : last + 1], places.weight[first : last + 1]
    gain = offset_gain(residual, weight, offset_sd_db)
    plain = places.score[first : last + 1] - gain
    corners = np.stack([places.chainage_m[first : last + 1], plain, residual, weight])
    sides = corners[:, :-1, None] + SHARES * (corners[:, 1:] - corners[:, :-1])[:, :, None]
    fine = np.concatenate([sides.reshape(4, -1), corners[:, -1:]], axis=1)
    fine[1, :-1] += (bend[:, None] * (SHARES * (1.0 - SHARES))).ravel()
    fine[1] += offset_gain(fine[2], fine[3], offset_sd_db)
    count, step_m = fine.shape[1], places.width_m[first]
    width_m = np.full(count, step_m / PARTS)
    width_m[0] = width_m[-1] = step_m / 2.0 * (1.0 + 1.0 / PARTS)  # an end keeps its outer half
    return Places(
        np.full(count, places.road[first]),
        np.full(count, places.sign[first]),
        fine[0],
        width_m,
        fine[1],
        fine[2],
        fine[3],
    )
