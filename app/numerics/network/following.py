"""
Which road a drive follows where: hidden Markov map matching after Newson and Krumm (2009).

A step of a piece is emitted by a place on a road with a Gaussian of their distance; going from one
place to the next costs as much as the way along the roads differs from the way driven. Off every
road is a state too, so that a car park or a road that nobody has drawn is not forced onto one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from jaxtyping import Float, Int
from shapely import LineString
from shapely.strtree import STRtree

from app.numerics.geodesy import Floats
from app.numerics.network.steps import STEP_M

EVERY = 2  # steps: 10 m between places is as fine as receivers are
REACH_M = 35.0  # from a road's line: GPS in a street canyon on the far lane of a wide street
EMISSION_SD_M = 8.0
DETOUR_M = 5.0  # mean difference of the way along the roads and the way driven
SWITCH_COST = 2.0  # of changing the road: a crossing street must not be visited for a moment
OFF_M = 30.0  # a road this far away is as good as none
OFF_COST = 6.0  # of leaving the roads and of coming back: some 50 m of driving beside one
JUNCTION_M = 30.0  # an end so close to another road meets it
OFF_ROAD = -1


@dataclass(frozen=True, slots=True, eq=False)
class Along:
    """
    The road under each step of a piece.

    Attributes:
        road: Its number, `OFF_ROAD` where there is none. Shape ``(steps,)``.
        chainage_m: Place along it, NaN off the roads. Shape ``(steps,)``.
    """

    road: Int[np.ndarray, " steps"]
    chainage_m: Float[np.ndarray, " steps"]


class Network:
    """Roads as polylines in local metres, and where one can change from one to another."""

    def __init__(self, lines: Sequence[Floats]) -> None:
        self.lines = [LineString(line) for line in lines]
        self._tree = STRtree(np.array(self.lines, dtype=object))
        self._junctions = self._find_junctions()

    def follow(self, xy_m: Float[np.ndarray, "steps 2"]) -> Along:
        """The most probable roads under the steps of a piece."""
        looked_at = np.unique(np.append(np.arange(0, len(xy_m), EVERY), len(xy_m) - 1))
        candidates = self._candidates(xy_m[looked_at])
        way_m = np.diff(looked_at) * STEP_M
        chosen = self._viterbi(candidates, way_m)
        road = np.array([c.road[k] for c, k in zip(candidates, chosen, strict=True)])
        nearest = np.minimum((np.arange(len(xy_m)) + EVERY // 2) // EVERY, len(looked_at) - 1)
        under = road[nearest]
        chainage_m = np.full(len(xy_m), np.nan)
        for number in np.unique(under[under != OFF_ROAD]).tolist():
            there = np.flatnonzero(under == number)
            at = shapely.points(xy_m[there])
            chainage_m[there] = shapely.line_locate_point(self.lines[number], at)
        return Along(under, chainage_m)

    def _candidates(self, xy_m: Floats) -> list[_Candidates]:
        points = np.asarray(shapely.points(xy_m))
        step, road = self._tree.query(points, predicate="dwithin", distance=REACH_M)
        lines = np.array(self.lines, dtype=object)[road]
        away_m = np.asarray(shapely.distance(lines, points[step]))
        along_m = np.asarray(shapely.line_locate_point(lines, points[step]))
        order = np.lexsort((road, step))
        edges = np.searchsorted(step[order], np.arange(len(xy_m) + 1))
        return [
            _Candidates.of(road[part], along_m[part], away_m[part])
            for part in (order[a:b] for a, b in pairwise(edges))
        ]

    def _viterbi(self, candidates: Sequence[_Candidates], way_m: Floats) -> list[int]:
        """Index of the best candidate of each step."""
        cost = candidates[0].cost
        back: list[Int[np.ndarray, " now"]] = []
        for before, now, driven_m in zip(
            candidates[:-1], candidates[1:], way_m.tolist(), strict=True
        ):
            total = cost[:, None] + self._changes(before, now, driven_m)
            best = np.argmin(total, axis=0)
            back.append(best)
            cost = total[best, np.arange(len(best))] + now.cost
        chosen = [int(np.argmin(cost))]
        for best in reversed(back):
            chosen.append(int(best[chosen[-1]]))
        return chosen[::-1]

    def _changes(
        self, before: _Candidates, now: _Candidates, driven_m: float
    ) -> Float[np.ndarray, "before now"]:
        same = before.road[:, None] == now.road
        route_m = np.abs(before.along_m[:, None] - now.along_m)
        cost = np.where(same, np.abs(route_m - driven_m) / DETOUR_M, np.inf)
        off = (before.road[:, None] == OFF_ROAD) | (now.road == OFF_ROAD)
        cost = np.where(off, np.where(same, 0.0, OFF_COST), cost)
        for i, j in np.argwhere(~same & ~off).tolist():
            met = self._junctions.get((int(before.road[i]), int(now.road[j])))
            if met is not None:
                ways_m = np.abs(before.along_m[i] - met[:, 0]) + np.abs(now.along_m[j] - met[:, 1])
                detour_m = abs(float(ways_m.min()) - driven_m)
                cost[i, j] = SWITCH_COST + detour_m / DETOUR_M
        return cost

    def _find_junctions(self) -> dict[tuple[int, int], Floats]:
        """Chainages on both roads of the places where two roads meet."""
        junctions: dict[tuple[int, int], Floats] = {}
        one, other = self._tree.query(
            np.array(self.lines, dtype=object), predicate="dwithin", distance=JUNCTION_M
        )
        for a, b in zip(one.tolist(), other.tolist(), strict=True):
            if a < b:
                places = self._meeting_places(self.lines[a], self.lines[b])
                if len(places):
                    met = np.array([[line.project(p) for line in (self.lines[a], self.lines[b])]
                                    for p in places])  # fmt: skip
                    junctions[a, b], junctions[b, a] = met, met[:, ::-1]
        return junctions

    @staticmethod
    def _meeting_places(one: LineString, other: LineString) -> list[shapely.Point]:
        ends = [shapely.Point(line.coords[i]) for line in (one, other) for i in (0, -1)]
        places = [p for p in ends if max(one.distance(p), other.distance(p)) <= JUNCTION_M]
        crossing = one.intersection(other)
        parts = getattr(crossing, "geoms", [crossing])
        return places + [part.centroid for part in parts if not part.is_empty]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidates:
    """Places on roads near a step, and last the state of being on none."""

    road: Int[np.ndarray, " places"]
    along_m: Float[np.ndarray, " places"]
    cost: Float[np.ndarray, " places"]

    @classmethod
    def of(cls, road: Int[np.ndarray, " n"], along_m: Floats, away_m: Floats) -> _Candidates:
        return cls(
            np.append(road, OFF_ROAD),
            np.append(along_m, 0.0),
            0.5 * (np.append(away_m, OFF_M) / EMISSION_SD_M) ** 2,
        )
