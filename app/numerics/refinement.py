"""
Places between the metres: where the posterior is narrower than the grid, look closer.

Between two grid positions the curve is taken as straight and its precision ``A`` as constant. Then
the residual and weight channels are straight, too, and the score, being a square of the level, lies
above the straight line: at share ``f`` by ``f (1 - f)`` times the sum of the profile's ``bend``
over all readings. No finer profile is needed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from app.numerics import native
from app.numerics.index import MapIndex
from app.numerics.observation import Evidence, Profile
from app.numerics.posterior import RESIDUAL, SCORE, WEIGHT, WIDTH, Places
from app.numerics.query import Aim, Query, columns_behind

PARTS = 5  # 0.2 m: an eighth of the narrowest posteriors seen, from edge to edge
AROUND = 3  # grid positions on either side of the best that are drawn anew
MIN_ROW = 3  # grid positions that a neighbourhood needs
MOST_ROWS = 6  # peaks that are drawn anew: bounds the time of a window that fits everywhere
LIGHTEST = 7.0  # peaks under e^-7 of the highest's density share too little to be drawn
SHARES = np.arange(PARTS) / PARTS


def refine(index: MapIndex, query: Query, places: Places) -> Places:
    """
    Draw the neighbourhoods of the peaks that matter anew at a fifth of the grid.

    The new places replace those of the same metres, so that every metre keeps its weight.
    """
    return refine_each(index, (query,), places)[0]


def refine_each(
    index: MapIndex, queries: Sequence[Query], places: Places
) -> tuple[Places, list[int]]:
    """
    `refine` for the places of several queries at once, the highest peaks of all.

    Args:
        places: Of one query after the other, as many of each.

    Returns:
        The places, and how many of them are each query's now.
    """
    lowest = LIGHTEST * queries[0].temperature(index.calibration)
    prior, size = queries[0].prior(index), len(places) // len(queries)
    like_db2 = prior.like_db2 / prior.temperature
    count = [size] * len(queries)
    for number, first, end in _peaks(index, queries[0], places, lowest):
        which = first // size
        query, road = queries[which], index.roads[number]
        if query.told is not None:
            aimed, bend = query.aimed(query.told, road.column), road.along.bend
            limits = (first, end)
            places = native.redrawn(aimed, bend, places, limits, PARTS, road.step_m, like_db2)
        else:
            row = places.slice(first, end)
            bend = bend_along(road.along, query.aim_at(index, number), query.fine, row, road.step_m)
            finer = between(row, bend, like_db2, road.step_m)
            places = Places.join((places.slice(0, first), finer, places.slice(end, len(places))))
        count[which] += (PARTS - 1) * (end - first - 1)
    return places, count


def _peaks(
    index: MapIndex, query: Query, places: Places, lowest: float
) -> list[tuple[int, int, int]]:
    """Road, first and end of each row."""
    if query.told is not None:
        return native.rows(places, index.atlas.step_m, lowest, (AROUND, MIN_ROW, MOST_ROWS))
    rows = _rows(places, index.atlas.step_m[places.road], lowest)
    return [(int(places.road[first]), first, end) for first, end in rows]


def _rows(
    places: Places, step_m: Float[np.ndarray, " places"], lowest: float
) -> list[tuple[int, int]]:
    """
    First and end of the unbroken rows about the peaks that matter, the last row first.

    Higher peaks choose first, the first of equals; rows never overlap.

    Args:
        step_m: Of the grid of each place's road.
        lowest: How far under the highest score a peak may lie.
    """
    score = places.score
    near = np.abs(np.diff(places.chainage_m) - step_m[1:]) < 1e-6
    joined = near & (places.where[:, 1:] == places.where[:, :-1]).all(axis=0)
    nothing = np.array([-np.inf])
    before = np.concatenate((nothing, np.where(joined, score[:-1], -np.inf)))
    after = np.concatenate((np.where(joined, score[1:], -np.inf), nothing))
    peaks = (score > before) & (score >= after) & (score >= score.max() - lowest)
    found = peaks.nonzero()[0]
    free, rows = np.ones(len(score), dtype=bool), []
    for peak in found[(-score[found]).argsort(kind="stable")].tolist():
        first, end = peak, peak + 1
        if not free[peak]:
            continue
        while first > max(peak - AROUND, 0) and joined[first - 1] and free[first - 1]:
            first -= 1
        while end < min(peak + AROUND + 1, len(score)) and joined[end - 1] and free[end]:
            end += 1
        if end - first >= MIN_ROW:
            free[first:end] = False
            rows.append((first, end))
        if len(rows) == MOST_ROWS:
            break
    return sorted(rows, reverse=True)


def bend_along(
    along: Profile, aim: Aim, seen: Evidence, row: Places, step_m: float
) -> Float[np.ndarray, " intervals"]:
    """
    How far the score lies above the straight line, from each grid position to the next: samples
    bend as if they lay at the nearest ones.
    """
    start = round(float(row.chainage_m[0]) / step_m) + 1
    behind, _ = columns_behind(seen.behind_m, step_m, nearest=True)
    columns = np.arange(start, start + len(row) - 1) - int(row.sign[0]) * behind[:, None]
    columns = np.minimum(np.maximum(columns, 0), along.columns - 1)
    low, high = int(columns.min()), int(columns.max())
    bend = along.bend[:, low : high + 1]
    heard = seen.heard
    if aim.here is not None:
        bend, heard = bend[aim.cells(len(bend))], heard[:, aim.here]
    each = (heard * seen.weight[:, None]) @ bend
    starts = np.arange(0, each.size, each.shape[1])[:, None] - low
    return np.asarray(each.ravel().take(columns + starts).sum(axis=0))


def between(
    row: Places, bend: Float[np.ndarray, " intervals"], like_db2: float, step_m: float
) -> Places:
    """
    Places at every share of the way between neighbours, the last neighbour included.

    Args:
        like_db2: Variance of the device offset that the row's scores already hold, over the
            window's temperature; 0 = none.
    """
    left = row.values[:, :-1]
    steps = row.values[:, 1:] - left
    count = PARTS * (len(row) - 1) + 1
    values = np.empty((len(row.values), count))
    values[:, :-1] = (left[:, :, None] + SHARES * steps[:, :, None]).reshape(len(values), -1)
    values[:, -1] = row.values[:, -1]
    # The offset takes up a common residual, whose square is convex: so much less is the bend.
    taken = 0.5 * steps[RESIDUAL] ** 2 * like_db2 / (1.0 + left[WEIGHT] * like_db2)
    values[SCORE, :-1] += ((bend - taken)[:, None] * (SHARES * (1.0 - SHARES))).ravel()
    values[WIDTH] = step_m / PARTS
    values[WIDTH, [0, -1]] = step_m / 2.0 * (1.0 + 1.0 / PARTS)  # an end keeps its outer half
    return Places(np.repeat(row.where[:, :1], count, axis=1), values)
