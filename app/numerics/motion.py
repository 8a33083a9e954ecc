"""
How a belief moves: the travelled distance shifts every mode, junctions and road ends split it.

Straight on is most probable, a turn is possible wherever the road graph allows one, a U-turn is
rare. The odometer says how far, so each branch ends at one place with the same spread.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.numerics.belief import LIGHTEST, Belief, Mode
from app.numerics.graph import REACH_M, Link
from app.numerics.index import MapIndex
from app.numerics.offmap import OFF_MAP_PRIOR

ODOMETER_ERROR = 0.02  # of the way, where nobody said: tyres, slip, phones that integrate speed
FLOOR_M = 1.0  # of a step: the readings' clock against the odometer's
MAP_ERROR_REACH_M = 150.0  # over which the map's errors of position are alike
TURN = 0.02  # of the vehicles at a junction take each way off; few, see docs/algorithms/tracking.md
SHARP = 0.2  # how much less a way back at an acute angle is taken
AHEAD = 8.0  # how much rather a vehicle at a road's end goes straight on than turns
LEAVE_AT_END = 0.1  # of the vehicles at a road's end go where the map has no road
BACK_AT_END = 0.03  # turn round there
U_TURN = 0.001  # turn round anywhere else, per step
LOST = 0.002  # per step: whatever this model does not know
OFF_MAP_MEMORY_M = 1_000.0  # way after which being off the map is forgotten, back to the prior
FARTHEST_M = 3_000.0  # a longer way between windows leaves nothing of a track
MOST_BRANCHES = 160
ROOM_M = 5.0  # a way that ends sooner leads nowhere


@dataclass(frozen=True, slots=True)
class Leg:
    """A stretch driven: onto ``road`` at ``start_m`` with ``sign``, off it at ``end_m``."""

    road: int
    sign: int
    start_m: float
    end_m: float


@dataclass(frozen=True, slots=True)
class Branch:
    """
    A mode after the motion, and the turns it took on the way, oldest first.

    Attributes:
        legs: What it drove before its present road; empty when it stayed on it.
        entered_m: Where it came onto the present road; None when it stayed on it.
    """

    mode: Mode
    legs: tuple[Leg, ...] = ()
    entered_m: float | None = None


@dataclass(frozen=True, slots=True)
class Predicted:
    """Branches, heaviest first; their weights, ``anywhere`` and ``off_map`` sum to 1."""

    branches: tuple[Branch, ...]
    anywhere: float
    off_map: float


def predict(
    index: MapIndex, belief: Belief, travelled_m: float, distance_error: float | None = None
) -> Predicted:
    """
    The belief after ``travelled_m`` more metres, before anything new was heard.

    Args:
        travelled_m: From the last sample of the belief's window to the last of the new one.
        distance_error: Of that way, see `app.domain.Window`; None = `ODOMETER_ERROR`.
    """
    forgotten = 1.0 - math.exp(-travelled_m / OFF_MAP_MEMORY_M)
    back, away = belief.off_map * forgotten, OFF_MAP_PRIOR * forgotten
    off_map = belief.off_map - back * (1.0 - OFF_MAP_PRIOR)
    on_map = 1.0 - belief.off_map
    off_map += on_map * away
    if travelled_m > FARTHEST_M:
        return Predicted((), 1.0 - off_map, off_map)
    error = ODOMETER_ERROR if distance_error is None else distance_error
    error_m2 = (error * travelled_m) ** 2 + (FLOOR_M if travelled_m > 0 else 0.0) ** 2
    error_m2 += _map_error_m2(index, travelled_m)
    ways = _Ways(index, travelled_m)
    kept = (1.0 - away) * (1.0 - (LOST if travelled_m > 0 else 0.0))
    for mode in belief.modes:
        moved = replace(
            mode,
            sd_m=math.sqrt(mode.sd_m**2 + error_m2),
            moved_sd_m=math.sqrt(error_m2),
            weight=mode.weight * kept,
        )
        ways.drive(moved, travelled_m)
    branches = sorted(ways.done, key=lambda branch: -branch.mode.weight)[:MOST_BRANCHES]
    placed = sum(branch.mode.weight for branch in branches)
    off_map += ways.left * 0.5  # the other half may have gone on by a road that no line reaches
    return Predicted(tuple(branches), max(1.0 - off_map - placed, 0.0), off_map)


def _map_error_m2(index: MapIndex, travelled_m: float) -> float:
    """Of the map's own errors of position here and there: alike nearby, unlike far apart."""
    alike = math.exp(-travelled_m / MAP_ERROR_REACH_M)
    return 2.0 * index.calibration.position_sd_m**2 * (1.0 - alike)


class _Ways:
    """Drives modes along the graph and collects where they end."""

    def __init__(self, index: MapIndex, travelled_m: float) -> None:
        self._index = index
        self._travelled_m = travelled_m
        self.done: list[Branch] = []
        self.left = 0.0  # weight that drove off the map at a road's end

    def drive(
        self, mode: Mode, way_m: float, legs: tuple[Leg, ...] = (), entered_m: float | None = None
    ) -> None:
        """Move a mode ``way_m`` on, splitting it at every link that it may have reached."""
        if mode.weight < LIGHTEST or len(legs) > 4:
            return
        road = self._index.roads[mode.road]
        to_end_m = road.length_m - mode.chainage_m if mode.sign > 0 else mode.chainage_m
        at_end: list[Link] = []
        weight = mode.weight
        for link in self._ahead(mode, way_m, entered_m):
            off_m = mode.sign * (link.at_m - mode.chainage_m)
            if to_end_m - off_m <= REACH_M:
                at_end.append(link)
                continue
            reached = _passed(way_m - off_m, mode.sd_m)
            for turned, pull in self._turns(mode, link):
                share = TURN * min(pull, 1.0) * reached * weight
                weight -= share
                self._turn(mode, link, turned, (share, way_m - off_m), legs)
        beyond_m = way_m - max(to_end_m, 0.0)
        gone = weight * _passed(beyond_m, mode.sd_m) if way_m > 0 else 0.0
        if gone > LIGHTEST:
            self._end(replace(mode, weight=gone), beyond_m, at_end, (legs, entered_m))
        rest = weight - (gone if gone > LIGHTEST else 0.0)
        chainage_m = mode.chainage_m + mode.sign * way_m
        chainage_m = min(max(chainage_m, 0.0), road.length_m)
        turn_back = U_TURN * rest if not legs and self._travelled_m > 0 else 0.0
        self.done.append(
            Branch(replace(mode, chainage_m=chainage_m, weight=rest - turn_back), legs, entered_m)
        )
        if turn_back > 0.0:
            spread_m = math.hypot(mode.sd_m, way_m / math.sqrt(3.0))
            back = replace(mode, sign=-mode.sign, sd_m=spread_m, weight=turn_back)
            self.done.append(Branch(back))

    def _ahead(self, mode: Mode, way_m: float, entered_m: float | None) -> list[Link]:
        """Links that the mode may have reached, nearest first; not the one it came by."""
        reach_m = way_m + 2.0 * mode.sd_m
        found = [
            link
            for link in self._index.graph.links[mode.road]
            if -REACH_M < mode.sign * (link.at_m - mode.chainage_m) <= reach_m
            and (entered_m is None or abs(link.at_m - entered_m) > REACH_M)
            and (mode.sign * (link.at_m - mode.chainage_m) > 0 or self._is_end(mode, link))
        ]
        return found if mode.sign > 0 else found[::-1]

    def _is_end(self, mode: Mode, link: Link) -> bool:
        end_m = self._index.roads[mode.road].length_m if mode.sign > 0 else 0.0
        return abs(link.at_m - end_m) <= REACH_M

    def _turns(self, mode: Mode, link: Link) -> list[tuple[int, float]]:
        """Ways off by a link: the direction on the other road, and how it draws by its angle."""
        room_m = self._index.roads[link.road].length_m
        ways = []
        for sign in (1, -1):
            if (room_m - link.there_m if sign > 0 else link.there_m) < ROOM_M:
                continue
            bend = abs(
                self._heading(link.road, sign, link.there_m)
                - self._heading(mode.road, mode.sign, link.at_m)
            )
            bend = min(bend % 360.0, 360.0 - bend % 360.0)
            ways.append((sign, AHEAD if bend < 45.0 else SHARP if bend > 135.0 else 1.0))
        return ways

    def _heading(self, road: int, sign: int, at_m: float) -> float:
        """Of travel, degrees, a little way off the link so that a bend in it misleads nobody."""
        atlas = self._index.atlas
        step = int(min(max(at_m + sign * ROOM_M, 0.0) / atlas.step_m[road], atlas.size[road] - 1))
        heading = float(atlas.plane[4, atlas.start[road] + step])
        return heading if sign > 0 else heading + 180.0

    def _turn(
        self, mode: Mode, link: Link, sign: int, share: tuple[float, float], legs: tuple[Leg, ...]
    ) -> None:
        weight, rest_m = share
        if weight < LIGHTEST:
            return
        leg = Leg(mode.road, mode.sign, mode.chainage_m, link.at_m)
        turned = Mode(link.road, sign, link.there_m, mode.sd_m, weight, mode.moved_sd_m)
        self.drive(turned, max(rest_m, 0.0), (*legs, leg), link.there_m)

    def _end(
        self,
        mode: Mode,
        beyond_m: float,
        links: Sequence[Link],
        before: tuple[tuple[Leg, ...], float | None],
    ) -> None:
        """Share out what has driven past its road's end: on, round, or off the map."""
        legs, _ = before
        length_m = self._index.roads[mode.road].length_m
        end_m = length_m if mode.sign > 0 else 0.0
        ways = [(link, sign, pull) for link in links for sign, pull in self._turns(mode, link)]
        drawn = sum(pull for _, _, pull in ways)
        leaves = LEAVE_AT_END if ways else 0.5
        self.left += leaves * mode.weight
        back = BACK_AT_END if ways else 0.2
        round_ = Link(end_m, mode.road, end_m)
        self._turn(mode, round_, -mode.sign, (back * mode.weight, beyond_m), legs)
        stays = mode.weight * (1.0 - leaves - back)
        if not ways:  # the map's line may end before the road does: it may still be there
            self.done.append(Branch(replace(mode, chainage_m=end_m, weight=stays), legs, before[1]))
            return
        for link, sign, pull in ways:
            share = stays * pull / drawn
            self._turn(mode, link, sign, (share, beyond_m + _gap_m(end_m, link, mode)), legs)


def _gap_m(end_m: float, link: Link, mode: Mode) -> float:
    """Metres from a link to the end of its road, ahead of the mode."""
    return mode.sign * (end_m - link.at_m)


def _passed(beyond_m: float, sd_m: float) -> float:
    """Probability of having come past a place, when the mean lies ``beyond_m`` past it."""
    return 0.5 * (1.0 + math.erf(beyond_m / (max(sd_m, 1e-6) * math.sqrt(2.0))))
