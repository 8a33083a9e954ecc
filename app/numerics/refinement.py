"""
Places between the metres: where the posterior is narrower than the grid, look closer.

Between two grid positions the curve is taken as straight and its precision ``A`` as constant. Then
the residual and weight channels are straight, too, and the score, being a square of the level, lies
above the straight line: at share ``f`` by ``f (1 - f)`` times the sum of the profile's ``bend`` over
all readings. No finer profile is needed.
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
    first = last = best
    near = range(1, AROUND + 1)
    for back in near:
        if not _neighbours(places, best - back, best - back + 1, step_m):
            break
        first = best - back
    for on in near:
        if not _neighbours(places, best + on - 1, best + on, step_m):
            break
        last = best + on
    return first, last


def _neighbours(places: Places, left: int, right: int, step_m: float) -> bool:
    return (
        left >= 0
        and right < len(places)
        and bool(places.road[left] == places.road[right])
        and bool(places.sign[left] == places.sign[right])
        and 0.0 < places.chainage_m[right] - places.chainage_m[left] < 1.5 * step_m
    )


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
    along, aimed = index.roads[road].along, query.aim(index, road)
    at = grid - sign * aimed.behind[:, None]
    inside = (at >= 0) & (at < along.bend.shape[1])
    low, high = max(int(at.min()), 0), min(int(at.max()), along.bend.shape[1] - 1)
    each = aimed.counted @ along.bend[aimed.cells, low : high + 1]
    rows = np.arange(len(at))[:, None]
    laid = each[rows, np.clip(at - low, 0, each.shape[1] - 1)]
    return np.asarray(np.where(inside, laid, 0.0).sum(axis=0))


def _between(
    places: Places,
    first: int,
    last: int,
    bend: Float[np.ndarray, " intervals"],
    offset_sd_db: float,
) -> Places:
    def straight(values: np.ndarray) -> np.ndarray:
        left, right = values[first:last, None], values[first + 1 : last + 1, None]
        return np.append((left + SHARES * (right - left)).ravel(), values[last])

    plain = places.score - offset_gain(places.residual, places.weight, offset_sd_db)
    residual, weight = straight(places.residual), straight(places.weight)
    above = np.append((bend[:, None] * (SHARES * (1.0 - SHARES))).ravel(), 0.0)
    score = straight(plain) + above + offset_gain(residual, weight, offset_sd_db)
    chainage_m = straight(places.chainage_m)
    width_m = np.full(len(score), float(np.diff(chainage_m[:2])[0]))
    width_m[0] = width_m[-1] = places.width_m[first] / 2.0 + width_m[1] / 2.0
    return Places(
        np.full(len(score), places.road[first]),
        np.full(len(score), places.sign[first]),
        chainage_m,
        width_m,
        score,
        residual,
        weight,
    )
