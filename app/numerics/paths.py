"""
A way of several roads driven one after the other, read as one profile: columns of the road behind,
then columns of the road it is on now. `app.numerics.ways` lays windows along such.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Int

from app.numerics.index import MapIndex, RoadIndex
from app.numerics.motion import Leg
from app.numerics.newcomers import Columns
from app.numerics.observation import TERMS, Profile
from app.numerics.query import FINE_STEP_M


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
    along = profile_along(index, tuple(column.cell), way, span)
    return replace(as_road(index, way, column, along), cells=cells)


def as_road(index: MapIndex, way: Way, column: Columns, along: Profile) -> RoadIndex:
    """A way's profile as that of a road; its number is that of the last road."""
    return replace(
        index.roads[way.road],
        length_m=float(along.columns - 3),
        step_m=FINE_STEP_M,
        column=column,
        along=along,
    )


def profile_along(
    index: MapIndex, cells: tuple[str, ...], way: Way, span: tuple[int, int]
) -> Profile:
    """Profile of cells metre by metre along the way, 0 where the last road was entered."""
    reach = -span[0]
    parts = [_stretch(index.roads[way.road], cells, way.entered_m, way.sign, (0, span[1]))]
    for number, leg in enumerate(reversed(way.legs)):
        if reach <= 0:
            break
        oldest = number == len(way.legs) - 1
        driven = reach if oldest else min(round(abs(leg.end_m - leg.start_m)), reach)
        parts.append(_stretch(index.roads[leg.road], cells, leg.end_m, leg.sign, (-driven, -1)))
        reach -= driven
    rows, bend = zip(*reversed(parts), strict=True)
    outside = np.zeros((len(rows[0]), 1), dtype=np.float32)
    outside[-1] = 1.0
    level = np.zeros((len(cells), 1), dtype=np.float32)
    return Profile(
        np.concatenate((outside, *rows, outside), axis=1),
        np.concatenate((level, *bend, level), axis=1),
    )


def _stretch(
    road: RoadIndex, names: tuple[str, ...], from_m: float, sign: int, span: tuple[int, int]
) -> tuple[Float32[np.ndarray, "rows columns"], Float32[np.ndarray, "cells columns"]]:
    """
    Rows of cells and stand-ins at metres ``span`` of travel from a chainage, and the bend from each
    of these to the next.
    """
    at_m = from_m + sign * np.arange(span[0], span[1] + 1) * FINE_STEP_M
    columns = np.clip(np.rint(at_m / road.step_m).astype(np.intp) + 1, 0, road.along.columns - 1)
    numbers = np.array(road.column.numbers(names), dtype=np.intp)
    here = numbers.clip(min=0)
    part = slice(int(columns.min()), int(columns.max()) + 1)
    terms = np.append(_rows_of(here), -1)
    rows = road.along.rows[terms, part].take(columns - part.start, axis=1)  # faster than at once
    bend = road.along.bend[here].take(np.maximum(columns - (sign < 0), 0), axis=1)
    if numbers.min(initial=0) < 0:
        rows[_rows_of(np.flatnonzero(numbers < 0))], bend[numbers < 0] = 0.0, 0.0
    return rows, bend


def _rows_of(numbers: Int[np.ndarray, " cells"]) -> Int[np.ndarray, " rows"]:
    return (numbers[:, None] * TERMS + np.arange(TERMS)).ravel()
