"""
Places between the metres: where the posterior is narrower than the grid, look closer.

Between two grid positions the curve is taken as straight and its precision ``A`` as constant. Then
the residual and weight channels are straight, too, and the score, being a square of the level, lies
above the straight line: at share ``f`` by ``f (1 - f)`` times the sum of the profile's ``bend``
over all readings. No finer profile is needed.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from app.numerics import native
from app.numerics.index import MapIndex
from app.numerics.observation import TERMS, OffsetPrior
from app.numerics.posterior import RESIDUAL, SCORE, WEIGHT, WIDTH, Places
from app.numerics.query import Aim, Query

PARTS = 5  # 0.2 m: an eighth of the narrowest posteriors seen, from edge to edge
AROUND = 3  # grid positions on either side of the best that are drawn anew
MIN_ROW = 3  # grid positions that a neighbourhood needs
SHARES = np.arange(PARTS) / PARTS


def refine(index: MapIndex, query: Query, places: Places) -> Places:
    """
    Draw the neighbourhood of the best place anew at a fifth of the grid.

    The new places replace those of the same metres, so that every metre keeps its weight.
    """
    if query.told is not None:
        return _refine(index, query, query.told, places)
    best = int(places.score.argmax())
    road = int(places.where[0, best])
    step_m = index.roads[road].step_m
    row = _row(places, best, step_m)
    if row is None:
        return places
    finer = _between(row, _bend(index, query, row, road), index.offset_prior, step_m)
    first = max(best - AROUND, 0)
    before, after = places.slice(0, first), places.slice(first + len(row), len(places))
    return Places.join((before, finer, after))


def _refine(index: MapIndex, query: Query, told: native.Told, places: Places) -> Places:
    """The same with the kernels in C."""
    found = native.unbroken_row(places, index.atlas.step_m, AROUND, MIN_ROW)
    if found is None:
        return places
    number, first, end = found
    road, like_db2 = index.roads[number], index.offset_prior.like_db2
    aimed, bend = query.aimed(told, road.column), road.along.bend
    return native.redrawn(aimed, bend, places, (first, end), PARTS, road.step_m, like_db2)


def _row(places: Places, best: int, step_m: float) -> Places | None:
    """The best place and its neighbours; None where they are not one unbroken row."""
    first, end = max(best - AROUND, 0), min(best + AROUND + 1, len(places))
    ends = places.where[:, [first, end - 1]].tolist()
    if end - first < MIN_ROW or ends[0][0] != ends[0][1] or ends[1][0] != ends[1][1]:
        return None
    chainage_m = places.chainage_m
    length_m = float(chainage_m[end - 1] - chainage_m[first])
    whole = abs(length_m - (end - first - 1) * step_m) < 1e-6
    return places.slice(first, end) if whole else None


def _bend(index: MapIndex, query: Query, row: Places, road: int) -> Float[np.ndarray, " intervals"]:
    """How far the score lies above the straight line, from each grid position to the next."""
    target, aim = index.roads[road], query.aim_at(index, road)
    start = round(float(row.chainage_m[0]) / target.step_m) + 1
    columns = np.arange(start, start + len(row) - 1) - int(row.sign[0]) * aim.behind[:, None]
    columns = np.minimum(np.maximum(columns, 0), target.along.columns - 1)
    low, high = int(columns.min()), int(columns.max())
    bend = target.along.bend[:, low : high + 1]
    heard = query.fine.heard
    if aim.here is not None:
        bend, heard = bend[_cells_of(aim)], heard[:, aim.here]
    each = (heard * query.fine.weight[:, None]) @ bend
    starts = np.arange(0, each.size, each.shape[1])[:, None] - low
    return np.asarray(each.ravel().take(columns + starts).sum(axis=0))


def _cells_of(aim: Aim) -> Int[np.ndarray, " chosen"]:
    assert aim.rows is not None  # noqa: S101  # rows and here are given together
    return aim.rows[:-2:TERMS] // TERMS


def _between(
    row: Places, bend: Float[np.ndarray, " intervals"], prior: OffsetPrior, step_m: float
) -> Places:
    """Places at every share of the way between neighbours, the last neighbour included."""
    left = row.values[:, :-1]
    steps = row.values[:, 1:] - left
    count = PARTS * (len(row) - 1) + 1
    values = np.empty((len(row.values), count))
    values[:, :-1] = (left[:, :, None] + SHARES * steps[:, :, None]).reshape(len(values), -1)
    values[:, -1] = row.values[:, -1]
    # The offset takes up a common residual, whose square is convex: so much less is the bend.
    taken = 0.5 * steps[RESIDUAL] ** 2 / (left[WEIGHT] + 1.0 / prior.like_db2)
    values[SCORE, :-1] += ((bend - taken)[:, None] * (SHARES * (1.0 - SHARES))).ravel()
    values[WIDTH] = step_m / PARTS
    values[WIDTH, [0, -1]] = step_m / 2.0 * (1.0 + 1.0 / PARTS)  # an end keeps its outer half
    return Places(np.repeat(row.where[:, :1], count, axis=1), values)
