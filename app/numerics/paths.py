"""
A window laid round a corner: the roads driven one after the other, read as one profile.

Matching lays windows along single roads. Of a tracked vehicle it is known which turns it may have
taken, so its window is laid along the way it came by: columns of the road behind, then columns of
the road it is on now.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from app.numerics.alignment import score_positions
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.motion import Branch
from app.numerics.observation import HEARD_FLOOR, TERMS, offset_gain
from app.numerics.posterior import CHAINAGE, RESIDUAL, SCORE, VALUES, WEIGHT, WIDTH, Places
from app.numerics.query import FINE_STEP_M, Query

REACH_SDS = 3.5  # of a branch's spread: where along its road its end is looked for
UNHEARD_LOGIT = float(np.log(HEARD_FLOOR / (1.0 - HEARD_FLOOR)))  # of a cell that a road lacks


def turns_within(branch: Branch, length_m: float) -> bool:
    """Whether a window of this length, ending where the branch does, may hold a turn."""
    if branch.entered_m is None:
        return False
    since_m = abs(branch.mode.chainage_m - branch.entered_m)
    return since_m < length_m + REACH_SDS * branch.mode.sd_m


def places_round(index: MapIndex, query: Query, branch: Branch) -> Places:
    """
    Every metre of the branch's road where it may end, the window laid along the way it came by.

    Args:
        query: A window prepared for numpy.
        branch: One that has turned.
    """
    mode = branch.mode
    road, entered_m = index.roads[mode.road], _entered(branch)
    room_m = (road.length_m - entered_m) if mode.sign > 0 else entered_m
    since_m = abs(mode.chainage_m - entered_m)
    reach_m = REACH_SDS * mode.sd_m
    first = max(int(since_m - reach_m), 0)
    last = max(min(int(np.ceil(since_m + reach_m)), int(room_m)), first)
    ends = np.arange(first, last + 1)
    rows = _rows_along(index, query, branch, last)
    behind = np.rint(query.fine.behind_m / FINE_STEP_M).astype(np.intp)
    before = rows.shape[1] - 1 - last  # columns before the road was entered
    columns = np.maximum(before + ends - behind[:, None], 0)
    score, residual, weight = score_positions(rows, query.factors, columns)
    values = np.empty((VALUES, len(ends)))
    values[CHAINAGE] = np.clip(entered_m + mode.sign * ends, 0.0, road.length_m)
    values[WIDTH] = FINE_STEP_M
    values[SCORE] = score + offset_gain(residual, weight, index.offset_prior)
    values[RESIDUAL], values[WEIGHT] = residual, weight
    return Places(np.full((2, len(ends)), ((mode.road,), (mode.sign,))), values)


def _entered(branch: Branch) -> float:
    if branch.entered_m is None:
        raise ValueError("the branch stayed on its road")
    return branch.entered_m


def _rows_along(
    index: MapIndex, query: Query, branch: Branch, last: int
) -> Float[np.ndarray, "rows columns"]:
    """Profile rows of the query's cells, metre by metre along the way, up to ``last``."""
    reach = int(np.ceil(float(query.fine.behind_m[-1]))) + 1
    mode = branch.mode
    parts = [_stretch(index.roads[mode.road], query, _entered(branch), mode.sign, (0, last))]
    for number, leg in enumerate(reversed(branch.legs)):
        if reach <= 0:
            break
        oldest = number == len(branch.legs) - 1
        driven = reach if oldest else min(round(abs(leg.end_m - leg.start_m)), reach)
        parts.append(_stretch(index.roads[leg.road], query, leg.end_m, leg.sign, (-driven, -1)))
        reach -= driven
    return np.concatenate(parts[::-1], axis=1)


def _stretch(
    road: RoadIndex, query: Query, from_m: float, sign: int, span: tuple[int, int]
) -> Float[np.ndarray, "rows columns"]:
    """Rows of the query's cells at metres ``span`` of travel from a chainage."""
    at_m = from_m + sign * np.arange(span[0], span[1] + 1) * FINE_STEP_M
    columns = np.clip(np.rint(at_m / road.step_m).astype(np.intp) + 1, 0, road.along.columns - 1)
    rows = road.along.rows[:, columns].astype(np.float64)
    out = np.zeros((TERMS * len(query.cells) + 2, len(columns)))
    out[TERMS - 1 : -2 : TERMS] = UNHEARD_LOGIT
    here, there = _shared(road, query)
    out[here] = rows[there]
    out[-2:] = rows[-2:]
    return out


def _shared(
    road: RoadIndex, query: Query
) -> tuple[Int[np.ndarray, " rows"], Int[np.ndarray, " rows"]]:
    """Rows of the query's cells that the road knows: in the query's order, and in the road's."""
    pairs = [(i, road.column[c]) for i, c in enumerate(query.cells) if c in road.column]
    numbers = np.array(pairs, dtype=np.intp).reshape(-1, 2, 1) * TERMS + np.arange(TERMS)
    return numbers[:, 0].ravel(), numbers[:, 1].ravel()
