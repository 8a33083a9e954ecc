"""
Ways round a corner: off one road at a junction, onto another, found once for a whole map.

A window that holds a turn lies along no single road. Where the road graph links two roads, each way
of coming to the junction and of leaving it on the other road is such a *turn*. The coarse scale
lays windows round all of them at once: of every junction's *arms*, columns of a tape before or
behind the junction, any two of different roads make a way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from app.numerics.graph import REACH_M, RoadGraph
from app.numerics.tapes import BOTH, COARSE_STEPS_M, Tape

ROOM_M = 20.0  # of road before and behind a corner; shorter stubs are how lines were drawn
SHARPEST_DEG = 135.0  # a sharper way back is hardly ever driven
STRAIGHT_DEG = 45.0  # a way that bends less is none, unless a road begins or ends there


@dataclass(frozen=True, slots=True, eq=False)
class Arms:
    """
    Where turns come onto a tape's roads and go off them; one entry an arm.

    Attributes:
        where: Column of the junction, direction of travel, and 1 for an arm that is driven onto,
            0 for one that is come by.
        first: Number of the first of them among the arms of all tapes.
    """

    where: Int[np.ndarray, "3 arms"]
    first: int

    @property
    def count(self) -> int:
        """How many arms there are."""
        return self.where.shape[1]


@dataclass(frozen=True, slots=True, eq=False)
class TurnLevel:
    """
    All turns at one coarse step.

    Attributes:
        arms: Of each tape.
        onto, off: Number of the arm that each turn goes onto, and of the one it comes by.
        room: Columns of road beyond the junction, of each turn.
        past_m: How far past the junction the column lies that counts as the junction's, of each.
        total: Number of arms of all tapes.
    """

    arms: tuple[Arms, ...]
    onto: Int[np.ndarray, " turns"]
    off: Int[np.ndarray, " turns"]
    room: Int[np.ndarray, " turns"]
    past_m: Float[np.ndarray, " turns"]
    total: int


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """
    From one road onto another, one entry each.

    Attributes:
        from_road, from_sign, left_m: The road that is left, the direction of travel on it, and the
            chainage where it is left.
        road, sign, entered_m: The same of the road that is driven onto.
    """

    from_road: Int[np.ndarray, " ways"]
    from_sign: Int[np.ndarray, " ways"]
    left_m: Float[np.ndarray, " ways"]
    road: Int[np.ndarray, " ways"]
    sign: Int[np.ndarray, " ways"]
    entered_m: Float[np.ndarray, " ways"]

    def __len__(self) -> int:
        return len(self.road)

    def take(self, kept: Bool[np.ndarray, " ways"]) -> Ways:
        """Those that a mask names."""
        return Ways(
            self.from_road[kept],
            self.from_sign[kept],
            self.left_m[kept],
            self.road[kept],
            self.sign[kept],
            self.entered_m[kept],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """
    All turns of a map.

    Attributes:
        from_tape, tape: Numbers of the tapes that hold each turn's roads.
        levels: The turns at each of `COARSE_STEPS_M`.
        left_m: Where turns leave each road and direction.
    """

    ways: Ways
    from_tape: Int[np.ndarray, " turns"]
    tape: Int[np.ndarray, " turns"]
    levels: tuple[TurnLevel, ...]
    left_m: Mapping[tuple[int, int], frozenset[float]]

    def __len__(self) -> int:
        return len(self.ways)

    def away_m(self, road: int, sign: int, chainage_m: float) -> float:
        """How far a place is from where the nearest turn leaves its road, driven that way."""
        there_m = self.left_m.get((road, sign), ())
        return min([abs(at_m - chainage_m) for at_m in there_m], default=np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Grounds:
    """What `find_turns` needs to know of the roads: one entry a road, headings of all grids."""

    length_m: Float[np.ndarray, " roads"]
    step_m: Float[np.ndarray, " roads"]
    start: Int[np.ndarray, " roads"]
    size: Int[np.ndarray, " roads"]
    heading_deg: Float[np.ndarray, " grid"]

    def heading(
        self, road: np.ndarray, sign: np.ndarray, at_m: np.ndarray
    ) -> Float[np.ndarray, " places"]:
        """Of travel, a little away from a junction, so that a bend in it misleads nobody."""
        grid = (np.maximum(at_m, 0.0) / self.step_m[road]).astype(np.intp)
        grid = np.minimum(grid, self.size[road] - 1)
        return np.asarray(self.heading_deg[self.start[road] + grid] + np.where(sign > 0, 0, 180.0))


def find_turns(graph: RoadGraph, grounds: Grounds, tapes: Sequence[Tape]) -> Turns:
    """The turns of a map whose roads meet as the graph says."""
    every = _all_ways(graph)
    ways = every.take(_drivable(grounds, every))
    tape_of = np.zeros(len(grounds.length_m), dtype=np.intp)
    for number, tape in enumerate(tapes):
        tape_of[list(tape.roads)] = number
    from_tape, tape_onto = tape_of[ways.from_road], tape_of[ways.road]
    levels = tuple(
        _level(ways, from_tape, tape_onto, tapes, size) for size in range(len(COARSE_STEPS_M))
    )
    left_m: dict[tuple[int, int], set[float]] = {}
    for road, sign, at_m in zip(
        ways.from_road.tolist(), ways.from_sign.tolist(), ways.left_m.tolist(), strict=True
    ):
        left_m.setdefault((road, sign), set()).add(at_m)
    places_m = {way: frozenset(each) for way, each in left_m.items()}
    return Turns(ways, from_tape, tape_onto, levels, places_m)


def _all_ways(graph: RoadGraph) -> Ways:
    """Both directions of coming to each link, and both of going on."""
    links = [
        (road, link.road, link.at_m, link.there_m)
        for road, own in enumerate(graph.links)
        for link in own
    ]
    table = np.array(links, dtype=float).reshape(-1, 4)
    from_road, road, left_m, entered_m = np.repeat(table, 4, axis=0).T
    from_sign = np.tile(np.repeat(np.array(BOTH), 2), len(table))
    sign = np.tile(np.array(BOTH), 2 * len(table))
    return Ways(from_road.astype(np.intp), from_sign, left_m, road.astype(np.intp), sign, entered_m)


def _drivable(grounds: Grounds, ways: Ways) -> Bool[np.ndarray, " ways"]:
    """Which ways have room, are no way back, and are not just the same road under two names."""
    from_length_m, length_m = grounds.length_m[ways.from_road], grounds.length_m[ways.road]
    before_m = np.where(ways.from_sign > 0, ways.left_m, from_length_m - ways.left_m)
    behind_m = np.where(ways.sign > 0, length_m - ways.entered_m, ways.entered_m)
    after = grounds.heading(ways.road, ways.sign, ways.entered_m + ways.sign * ROOM_M)
    before = grounds.heading(ways.from_road, ways.from_sign, ways.left_m - ways.from_sign * ROOM_M)
    bend = np.abs(after - before) % 360.0
    bend = np.minimum(bend, 360.0 - bend)
    ends = (from_length_m - before_m <= REACH_M) | (length_m - behind_m <= REACH_M)
    room = (before_m >= ROOM_M) & (behind_m >= ROOM_M)
    return np.asarray(room & (bend <= SHARPEST_DEG) & (ends | (bend >= STRAIGHT_DEG)))


def _level(
    ways: Ways,
    from_tape: Int[np.ndarray, " turns"],
    tape: Int[np.ndarray, " turns"],
    tapes: Sequence[Tape],
    size: int,
) -> TurnLevel:
    """Columns of the junctions on the tapes, each arm once however many turns share it."""
    step_m, (first, count) = COARSE_STEPS_M[size], _columns_of_roads(tapes, size)
    onto = np.clip(np.rint(ways.entered_m / step_m).astype(np.intp), 0, count[ways.road] - 1)
    # Both roads' columns are so chosen that the way past the junction is right to half a column.
    past_m = ways.sign * (onto * step_m - ways.entered_m)
    off = np.rint((ways.left_m + ways.from_sign * past_m) / step_m).astype(np.intp)
    off = np.clip(off, 0, count[ways.from_road] - 1)
    room = np.where(ways.sign > 0, count[ways.road] - 1 - onto, onto)
    rows = [
        np.stack([tape, first[ways.road] + onto, ways.sign, np.ones_like(onto)]),
        np.stack([from_tape, first[ways.from_road] + off, ways.from_sign, np.zeros_like(off)]),
    ]
    every, number = np.unique(np.concatenate(rows, axis=1), axis=1, return_inverse=True)
    starts = np.searchsorted(every[0], np.arange(len(tapes) + 1)).tolist()
    arms = tuple(
        Arms(np.ascontiguousarray(every[1:, low:high], dtype=np.int64), low)
        for low, high in pairwise(starts)
    )
    number = np.ascontiguousarray(number.ravel(), dtype=np.int64)
    half = len(ways)
    room = room.astype(np.int64)
    return TurnLevel(arms, number[:half], number[half:], room, past_m, every.shape[1])


def _columns_of_roads(
    tapes: Sequence[Tape], size: int
) -> tuple[Int[np.ndarray, " roads"], Int[np.ndarray, " roads"]]:
    """First column of each road on its tape, and how many it has."""
    roads = 1 + max((road for tape in tapes for road in tape.roads), default=-1)
    first, count = np.zeros(roads, dtype=np.intp), np.zeros(roads, dtype=np.intp)
    for tape in tapes:
        level = tape.levels[size]
        numbers, start, own = np.unique(
            level.places.road[: len(level.positions)], return_index=True, return_counts=True
        )
        first[numbers], count[numbers] = level.positions[start], own
    return first, count
