"""
Windows laid along ways of several roads: ways are the roads of a small map of their own.

There they are laid, drawn anew between metres and laid under other odometers as windows along
single roads are; the places found are told as places on the last road of each way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from app.numerics.index import MapIndex
from app.numerics.motion import Branch
from app.numerics.newcomers import Columns
from app.numerics.odometer import under_other_factors
from app.numerics.odometer_prior import FARTHER_REACH, SCALE_SD, scale_sd_of
from app.numerics.paths import Way, as_road, profile_along
from app.numerics.posterior import CHAINAGE, Known, Places
from app.numerics.query import Query
from app.numerics.refinement import refine
from app.numerics.stretches import Stretch, lay

REACH_SDS = 3.5  # of a branch's spread: where along its road its end is looked for


class Reached(NamedTuple):
    """
    A way, and where past the beginning of its last road windows may end.

    Attributes:
        first_m, last_m: Where they are laid at their word.
        least_m, most_m: Where they may be looked for at all.
    """

    way: Way
    first_m: int
    last_m: int
    least_m: int
    most_m: int

    @classmethod
    def only(cls, way: Way, span: tuple[int, int]) -> Reached:
        """Nowhere else."""
        return cls(way, *span, *span)


@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """
    Places round corners.

    Attributes:
        known: Of all of them, that a window has turned left out.
        together: The log prior of all factors of the distance together, against that of 1.
    """

    places: Places
    known: Known
    together: float


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """
    Ways as a map.

    Attributes:
        index: Whose roads are the ways; but for these and their grid it is the map they are of.
        query: The window, for this map.
        before: Grid positions of each way before its last road was entered.
    """

    reached: Sequence[Reached]
    index: MapIndex
    query: Query
    before: list[int]

    @classmethod
    def of(cls, index: MapIndex, query: Query, reached: Sequence[Reached]) -> Ways:
        """Ways as long as the window may be by its odometer, its cells alone on them."""
        number_of = {cell: number for number, cell in enumerate(query.cells)}
        column = Columns(number_of, len(number_of), {}, np.zeros(0, dtype=np.int32))
        longest = 1.0 + FARTHER_REACH * max(scale_sd_of(query.distance_error), SCALE_SD)
        reach = math.ceil(longest * query.length_m) + 1
        before = [max(reach - one.least_m, 1) for one in reached]
        roads = []
        for number, (one, behind) in enumerate(zip(reached, before, strict=True)):
            along = profile_along(index, query.cells, one.way, (-behind, one.most_m))
            roads.append(replace(as_road(index, one.way, column, along), number=number))
        small = copy(index)
        small.roads = tuple(roads)
        size = np.array([road.grid_size for road in roads], dtype=np.int64)
        nowhere, step_m = np.zeros(len(roads) + 1, dtype=np.int64), np.ones(len(roads))
        small.atlas = replace(
            index.atlas, start=nowhere[1:], size=size, step_m=step_m, first_edge=nowhere
        )
        return cls(reached, small, replace(query, _aims={}), before)

    @property
    def stretches(self) -> list[Stretch]:
        """Where windows are laid at their word; along ways all go forward."""
        every = enumerate(zip(self.reached, self.before, strict=True))
        return [(at, 1, n + one.first_m, n + one.last_m) for at, (one, n) in every]

    def past_m(self, places: Places) -> Float[np.ndarray, " places"]:
        """Metres past where its way's last road was entered, of each place."""
        return np.asarray(places.chainage_m - np.array(self.before)[places.road])

    def within(self, places: Places) -> Bool[np.ndarray, " places"]:
        """Which places lie where windows may be looked for."""
        least_m, most_m = np.array([one[3:] for one in self.reached]).T[:, places.road]
        past_m = self.past_m(places)
        return np.asarray((past_m >= least_m) & (past_m <= most_m))

    def told(self, places: Places) -> Places:
        """The places as they lie on the last roads."""
        ways = [one.way for one in self.reached]
        ends = [(one.road, one.sign, one.entered_m) for one in ways]
        road, sign, entered_m = np.array(ends, dtype=float).T[:, places.road]
        values = places.values.copy()
        values[CHAINAGE] = entered_m + sign * self.past_m(places)
        where = np.stack((road, sign)).astype(np.int64)
        return Places(where, values)


def places_along(index: MapIndex, query: Query, way: Way, span: tuple[int, int]) -> Places:
    """
    Every metre of a part of a way's last road, the window laid along all of the way at its word.

    Args:
        span: First and last metre past where the last road was entered.
    """
    ways = Ways.of(index, query, [Reached.only(way, span)])
    return _inside(index, ways.told(lay(ways.index, ways.query, ways.stretches)))


def places_round_corners(
    index: MapIndex, query: Query, reached: Sequence[Reached], worth: float
) -> Turned:
    """
    Where the window may end after each of the ways.

    Args:
        worth: Score from which the odometer is worth a thought.
    """
    ways = Ways.of(index, query, reached)
    laid = refine(ways.index, ways.query, lay(ways.index, ways.query, ways.stretches))
    others = None
    if float(laid.score.max()) >= worth:
        others = under_other_factors(ways.index, ways.query, laid, laid)
    if others is None:
        known = Known(np.zeros(len(laid)), np.ones(len(laid)))
        return Turned(_inside(index, ways.told(laid)), known, 0.0)
    before = np.zeros(len(laid)), np.ones(len(laid))
    kept = ways.within(others.places)
    parts = zip(before, others.known, strict=True)
    known = Known(*(np.concatenate(part)[kept] for part in parts))
    places = ways.told(others.places.take(kept))
    return Turned(_inside(index, places), known, others.together)


def _inside(index: MapIndex, places: Places) -> Places:
    """The places, on their roads to the last micrometre."""
    np.clip(places.chainage_m, 0.0, index.lengths_m[places.road], out=places.values[CHAINAGE])
    return places


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


def turns_within(branch: Branch, length_m: float) -> bool:
    """Whether a window of this length, ending where the branch does, may hold a turn."""
    if branch.entered_m is None:
        return False
    since_m = abs(branch.mode.chainage_m - branch.entered_m)
    return since_m < length_m + REACH_SDS * branch.mode.sd_m
