"""
Places between the metres: where the posterior is narrower than the grid, look closer.

Between two grid positions the curve is taken as straight and its spread as constant, which makes the
terms of a profile interpolate linearly but for C, whose square is convex: at share ``f`` between two
positions, ``A mu^2`` is smaller by ``f (1 - f) A (mu_1 - mu_0)^2``.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from app.numerics.alignment import Aligned, score_positions, scoring_rows
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.observation import TERMS, coefficients, marginal_score
from app.numerics.posterior import Places, masses
from app.numerics.query import Query, choose, unmapped_score

PARTS = 5  # 0.2 m: an eighth of the narrowest posterior seen, 1.6 m from edge to edge
NARROW_M = 2.5  # wider posteriors are drawn well enough by their metres
AROUND = 3  # grid positions on either side of the best that are drawn anew


def refine(index: MapIndex, query: Query, places: Places) -> Places:
    """
    Draw the neighbourhood of the best place anew at a fifth of the grid, where that matters.

    The new places replace the old ones of the same metres, so that every metre keeps its weight.
    """
    best = int(np.argmax(places.score))
    road = index.roads[int(places.road[best])]
    near = (places.road == places.road[best]) & (places.sign == places.sign[best])
    near &= np.abs(places.chainage_m - places.chainage_m[best]) < (AROUND + 0.5) * road.step_m
    mass = masses(places, index.calibration.temperature)
    around = mass[near] / max(float(mass[near].sum()), 1e-300)
    mean_m = float(around @ places.chainage_m[near])
    spread_m = float(np.sqrt(around @ (places.chainage_m[near] - mean_m) ** 2))
    if spread_m * 2.0 > NARROW_M * road.step_m:
        return places
    closer = _closer(index, query, road, places.take(near))
    return Places.join([places.take(~near), closer])


def _closer(index: MapIndex, query: Query, road: RoadIndex, old: Places) -> Places:
    first = round(float(old.chainage_m.min()) / road.step_m)
    last = round(float(old.chainage_m.max()) / road.step_m)
    sign = int(old.sign[0])
    fit = _align_between(index, query, road, first, last, sign)
    count = len(fit.score)
    chainage_m = (first + (np.arange(count) - PARTS // 2) / PARTS) * road.step_m
    inside = (chainage_m >= 0.0) & (chainage_m <= road.length_m)
    return Places(
        np.full(count, old.road[0]),
        np.full(count, sign),
        chainage_m,
        np.full(count, road.step_m / PARTS),
        fit.score,
        fit.residual,
        fit.weight,
    ).take(inside)


def _align_between(
    index: MapIndex, query: Query, road: RoadIndex, first: int, last: int, sign: int
) -> Aligned:
    chosen = choose(query, road.column)
    behind = np.rint(query.fine.behind_m * (PARTS / road.step_m)).astype(np.intp)
    reach = int(behind[-1]) // PARTS + 2
    low, high = (first - reach, last + 1) if sign > 0 else (first - 1, last + reach)
    rows = between(scoring_rows(road.along, chosen.there, low, high))
    positions = (first - low) * PARTS + np.arange((last - first + 1) * PARTS) - PARTS // 2
    channels = score_positions(rows, coefficients(query.fine, chosen.here), behind, positions, sign)
    score = marginal_score(channels, index.calibration.offset_sd_db)
    score = score + unmapped_score(query.fine, chosen.missing)
    return Aligned(score, channels[1], channels[2])


def between(rows: Float32[np.ndarray, "rows stretch"]) -> Float32[np.ndarray, "rows finer"]:
    """Rows of a profile at `PARTS` places a step, from the first column to the last."""
    share = (np.arange(PARTS, dtype=np.float32) / PARTS)[:, None]
    left, right = rows[:, None, :-1], rows[:, None, 1:]
    finer = left + share * (right - left)
    precision, moment = rows[:-2:TERMS], rows[1:-2:TERMS]
    level = np.divide(moment, precision, out=np.zeros_like(moment), where=precision > 0)
    both = (precision[:, :-1] > 0) & (precision[:, 1:] > 0)
    step = np.where(both, np.diff(level, axis=1), 0.0).astype(np.float32)
    finer[2:-2:TERMS] -= (share * (1.0 - share)) * (finer[:-2:TERMS] * (step**2)[:, None])
    flat = finer.transpose(0, 2, 1).reshape(len(rows), -1)
    return np.concatenate([flat, rows[:, -1:]], axis=1)
