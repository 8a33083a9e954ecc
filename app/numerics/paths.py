"""
A window laid round a corner: the roads driven one after the other, read as one profile.

Matching lays windows along single roads. Of a tracked vehicle it is known which turns it may have
taken, so its window is laid along the way it came by: columns of the road behind, then columns of
the road it is on now.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Int

from app.numerics import native
from app.numerics.alignment import Between, score_positions
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.motion import Branch, Leg
from app.numerics.newcomers import Columns
from app.numerics.observation import TERMS, Profile
from app.numerics.offsets import take_offsets
from app.numerics.posterior import APART, CHAINAGE, RESIDUAL, SCORE, VALUES, WEIGHT, WIDTH, Places
from app.numerics.query import FINE_STEP_M, Query, columns_behind

REACH_SDS = 3.5  # of a branch's spread: where along its road its end is looked for


def turns_within(branch: Branch, length_m: float) -> bool:
    """Whether a window of this length, ending where the branch does, may hold a turn."""
    if branch.entered_m is None:
        return False
    since_m = abs(branch.mode.chainage_m - branch.entered_m)
    return since_m < length_m + REACH_SDS * branch.mode.sd_m


@dataclass(frozen=True, slots=True)
class Way:
    """
    Roads driven one after the other.

    Attributes:
        legs: What was driven before the last road, oldest first.
        road, sign, entered_m: The last road, the direction of travel on it, and where it began.
    """

    legs: tuple[Leg, ...]
    road: int
    sign: int
    entered_m: float


def places_round(index: MapIndex, query: Query, branch: Branch) -> Places:
    """
    Every metre of the branch's road where it may end, the window laid along the way it came by.

    Args:
        branch: One that has turned.
    """
    mode = branch.mode
    if branch.entered_m is None:
        raise ValueError("the branch stayed on its road")
    way = Way(branch.legs, mode.road, mode.sign, branch.entered_m)
    length_m = index.roads[mode.road].length_m
    room_m = (length_m - way.entered_m) if mode.sign > 0 else way.entered_m
    since_m = abs(mode.chainage_m - way.entered_m)
    reach_m = REACH_SDS * mode.sd_m
    first = max(int(since_m - reach_m), 0)
    last = max(min(int(np.ceil(since_m + reach_m)), int(room_m)), first)
    return places_along(index, query, way, (first, last))


def places_along(index: MapIndex, query: Query, way: Way, span: tuple[int, int]) -> Places:
    """
    Places on the last road of a way, the window laid along all of it.

    Args:
        span: First and last metre past where the last road was entered.
    """
    first, last = span
    ends = np.arange(first, last + 1)
    reach = int(np.ceil(float(query.fine.behind_m[-1]))) + 1
    rows = _rows_along(index, query.cells, way, (min(first - reach, -1), last))
    before = rows.shape[1] - 1 - last  # columns before the road was entered
    values = np.empty((VALUES, len(ends)))
    where = np.full((2, len(ends)), ((way.road,), (way.sign,)))
    if query.told is not None:
        places = Places(where, values)
        _lay(index, query, query.told, rows, (before + first, before + last), places)
    else:
        behind, share = columns_behind(query.fine.behind_m, FINE_STEP_M)
        columns = np.maximum(before + ends - behind[:, None], 0)
        between = Between(np.maximum(columns - 1, 0), share)
        score, *sums = score_positions(rows.astype(float), query.factors, columns, between)
        taken = take_offsets(np.array(sums), query.prior(index))
        values[SCORE] = score + taken.gain
        values[RESIDUAL], values[WEIGHT] = taken.residual, taken.weight
        values[APART] = taken.apart
    road = index.roads[way.road]
    values[CHAINAGE] = np.clip(way.entered_m + way.sign * ends, 0.0, road.length_m)
    values[WIDTH] = FINE_STEP_M
    return Places(where, values)


def _lay(
    index: MapIndex,
    query: Query,
    told: native.Told,
    rows: Float32[np.ndarray, "rows columns"],
    span: tuple[int, int],
    places: Places,
) -> None:
    """Twin of the numpy code above: the way is a road whose profile is ``rows``."""
    profile = np.concatenate((rows[:, :1], rows, rows[:, -1:]), axis=1)
    aimed = native.Aimed(told.block, told.samples, list(range(len(query.cells))), told.group)
    metres = (FINE_STEP_M, float(rows.shape[1]))
    road, sign = places.where[:, 0].tolist()
    terms = query.likelihood(index)
    native.score_stretch(aimed, profile, (road, 1, *span), metres, terms, places, 0)
    places.where[1] = sign  # along the way all windows go forward


def road_along(
    index: MapIndex, way: Way, span: tuple[int, int], heard: tuple[str, ...]
) -> RoadIndex:
    """
    A way as a road of its own: chainage 0 is ``-span[0]`` metres before the last road was entered.

    Slow, for explanations; its sub-segments and salient features are those of the last road.

    Args:
        heard: Cells of the window: what each road says of those that it lacks is laid out, too.
    """
    roads = [index.roads[leg.road] for leg in way.legs] + [index.roads[way.road]]
    cells = tuple(sorted(set().union(*(road.cells for road in roads))))
    column = Columns.plain(sorted({*cells, *heard}), index.carriers)
    rows = _rows_along(index, tuple(column.cell), way, span)
    outside = np.zeros((len(rows), 1), dtype=np.float32)
    outside[-1] = 1.0
    rows = np.ascontiguousarray(np.concatenate((outside, rows, outside), axis=1))
    bend = np.zeros((len(column), rows.shape[1]), dtype=np.float32)  # all places are whole metres
    return replace(
        roads[-1],
        length_m=float(rows.shape[1] - 3),
        step_m=FINE_STEP_M,
        cells=cells,
        column=column,
        along=Profile(rows, bend),
    )


def _rows_along(
    index: MapIndex, cells: tuple[str, ...], way: Way, span: tuple[int, int]
) -> Float32[np.ndarray, "rows columns"]:
    """Profile rows of cells metre by metre along the way, 0 where the last road was entered."""
    reach = -span[0]
    parts = [_stretch(index.roads[way.road], cells, way.entered_m, way.sign, (0, span[1]))]
    for number, leg in enumerate(reversed(way.legs)):
        if reach <= 0:
            break
        oldest = number == len(way.legs) - 1
        driven = reach if oldest else min(round(abs(leg.end_m - leg.start_m)), reach)
        parts.append(_stretch(index.roads[leg.road], cells, leg.end_m, leg.sign, (-driven, -1)))
        reach -= driven
    return np.concatenate(parts[::-1], axis=1)


def _stretch(
    road: RoadIndex, names: tuple[str, ...], from_m: float, sign: int, span: tuple[int, int]
) -> Float32[np.ndarray, "rows columns"]:
    """Rows of cells and stand-ins at metres ``span`` of travel from a chainage."""
    at_m = from_m + sign * np.arange(span[0], span[1] + 1) * FINE_STEP_M
    columns = np.clip(np.rint(at_m / road.step_m).astype(np.intp) + 1, 0, road.along.columns - 1)
    low, high = sorted((int(columns[0]), int(columns[-1])))
    here, there = _shared(road, names)
    part = road.along.rows[np.append(there, -1), low : high + 1]  # whole rows: faster than places
    out = np.zeros((TERMS * len(names) + 1, len(columns)), dtype=np.float32)
    out[np.append(here, -1)] = part.take(columns - low, axis=1)
    return out


def _shared(
    road: RoadIndex, names: tuple[str, ...]
) -> tuple[Int[np.ndarray, " rows"], Int[np.ndarray, " rows"]]:
    """Rows of the names that the road has, or a stand-in for: in their own order, in the road's."""
    pairs = [(i, at) for i, at in enumerate(road.column.numbers(names)) if at >= 0]
    numbers = np.array(pairs, dtype=np.intp).reshape(-1, 2, 1) * TERMS + np.arange(TERMS)
    return numbers[:, 0].ravel(), numbers[:, 1].ravel()
