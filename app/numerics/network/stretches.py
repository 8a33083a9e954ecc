"""Passes of a drive: the maximal stretches along one road in one direction."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from app.numerics.geodesy import Floats
from app.numerics.network.following import OFF_ROAD, Along
from app.numerics.network.steps import Piece

SHORTEST_M = 50.0  # of a pass: less holds no window and says little of the road
TURNED_M = 20.0  # back along the road: more than jitter, so the car turned
BLINK_STEPS = 10  # 50 m on another road between two stretches of one were on this one


class Stretch(NamedTuple):
    """
    Along the road of this number, from ``first`` to before ``end``.

    Steps of a piece from `stretches_along`, samples of its drive from `passes_of`.
    """

    road: int
    first: int
    end: int


def stretches_along(along: Along) -> list[Stretch]:
    """The steps of a piece that run along a road in one direction, long enough for a pass."""
    road = _steadied(along.road)
    found = []
    for first, end in _same(road):
        if road[first] == OFF_ROAD:
            continue
        for start, stop in _one_way(along.chainage_m[first:end]):
            a, b = first + start, first + stop
            if abs(along.chainage_m[b - 1] - along.chainage_m[a]) >= SHORTEST_M:
                found.append(Stretch(int(road[first]), a, b))
    return found


def passes_of(piece: Piece, along: Along) -> list[Stretch]:
    """The passes of a piece in driving order, as samples of its drive."""
    passes = []
    for road, first, end in stretches_along(along):
        low = int(np.ceil(piece.sample[first]))
        high = int(np.floor(piece.sample[end - 1])) + 1
        if high - low > 1:
            passes.append(Stretch(road, low, high))
    return passes


def _same(road: np.ndarray) -> Iterator[tuple[int, int]]:
    edges = [0, *(np.flatnonzero(np.diff(road)) + 1).tolist(), len(road)]
    yield from pairwise(edges)


def _steadied(road: np.ndarray) -> np.ndarray:
    """The roads without short visits to another one between two stretches of the same."""
    steady = road.copy()
    parts = list(_same(road))
    for before, (first, end), after in zip(parts[:-2], parts[1:-1], parts[2:], strict=True):
        if end - first < BLINK_STEPS and steady[before[0]] == road[after[0]] != OFF_ROAD:
            steady[first:end] = road[after[0]]
    return steady


def _one_way(chainage_m: Floats) -> Iterator[tuple[int, int]]:
    """Parts between the places where the car turned round."""
    start, turn, sign = 0, 0, 0
    for at in range(1, len(chainage_m)):
        if np.isnan(chainage_m[at]):
            continue
        gone_m = chainage_m[at] - chainage_m[turn]
        if sign == 0 and abs(gone_m) > TURNED_M:
            sign = 1 if gone_m > 0 else -1
            turn = at
        elif sign * gone_m >= 0.0:
            turn = at if sign else turn
        elif -sign * gone_m > TURNED_M:
            yield start, turn + 1
            start, turn, sign = turn, at, -sign
    yield start, len(chainage_m)
