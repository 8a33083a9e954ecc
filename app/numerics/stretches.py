"""Windows laid metre by metre along stretches of road: a place for every grid position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.numerics import native
from app.numerics.alignment import align
from app.numerics.index import MapIndex
from app.numerics.offsets import take_offsets
from app.numerics.posterior import APART, CHAINAGE, RESIDUAL, SCORE, VALUES, WEIGHT, WIDTH, Places
from app.numerics.query import Query
from app.numerics.tapes import BOTH

Stretch = tuple[int, int, int, int]
"""Number of the road, +1 or -1 for the direction of travel, first and last grid position."""


def lay(index: MapIndex, query: Query, stretches: Sequence[Stretch]) -> Places:
    """Every grid position of the stretches."""
    if query.told is not None:
        return _lay(index, query, query.told, stretches)
    parts = [along(index, query, *one) for one in stretches]
    return parts[0] if len(parts) == 1 else Places.join(parts)


def _lay(index: MapIndex, query: Query, told: native.Told, stretches: Sequence[Stretch]) -> Places:
    """The same with the kernels in C."""
    places = native.no_places(sum([last + 1 - first for _, _, first, last in stretches]))
    at, terms = 0, query.likelihood(index)
    for one in stretches:
        road = index.roads[one[0]]
        aimed, metres = query.aimed(told, road.column), (road.step_m, road.length_m)
        native.score_stretch(aimed, road.along.rows, one, metres, terms, places, at)
        at += one[3] + 1 - one[2]
    return places


def whole_roads(index: MapIndex, query: Query) -> Places:
    """Every metre of every road in both directions: what `app.numerics.exhaustive` looks at."""
    return Places.join(
        [
            along(index, query, number, sign, 0, road.grid_size - 1)
            for number, road in enumerate(index.roads)
            for sign in BOTH
        ]
    )


def along(index: MapIndex, query: Query, number: int, sign: int, first: int, last: int) -> Places:
    """One stretch, with numpy: the definition."""
    road, aim = index.roads[number], query.aim_at(index, number)
    score, *sums = align(road.along, aim, first + 1, last + 1, sign)
    taken = take_offsets(np.array(sums), query.prior(index))
    values = np.empty((VALUES, last + 1 - first))
    values[CHAINAGE] = np.arange(first, last + 1) * road.step_m
    values[WIDTH] = road.step_m
    values[SCORE] = score + taken.gain
    values[RESIDUAL], values[WEIGHT], values[APART] = taken.residual, taken.weight, taken.apart
    if last == road.grid_size - 1:
        values[CHAINAGE, -1] = road.length_m
    return Places(np.full((2, last + 1 - first), ((number,), (sign,))), values)
