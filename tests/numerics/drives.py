"""Drives for tracking laws: windows along one road, round corners and back, with their truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.domain import Direction, Window
from app.evaluation.scenario import City, drive
from app.numerics import tracking
from app.numerics.index import MapIndex
from app.numerics.lines import point_at, project


@dataclass(frozen=True, slots=True)
class Leg:
    """A stretch of a drive: from one chainage of a road to another."""

    road_id: str
    from_m: float
    to_m: float

    @property
    def sign(self) -> int:
        """+1 towards growing chainage, -1 against."""
        return 1 if self.to_m > self.from_m else -1


@dataclass(frozen=True, slots=True, eq=False)
class Tour:
    """A drive over several legs: odometer, readings, and the leg and chainage of each sample."""

    cells: tuple[str, ...]
    travelled_m: np.ndarray
    rsrp_dbm: np.ndarray
    leg: np.ndarray
    chainage_m: np.ndarray
    legs: tuple[Leg, ...]

    def window(self, first: int, last: int) -> Window:
        """Samples ``first`` to ``last``."""
        part = slice(first, last + 1)
        way_m = self.travelled_m[part] - self.travelled_m[first]
        return Window(self.cells, way_m, self.rsrp_dbm[part])


def tour_of(city: City, *legs: Leg, number: int = 0) -> Tour:
    """Drive the legs one after the other, each read off a fresh drive of its road."""
    rows, legs_of, chainages = [], [], []
    cells = tuple(sorted({cell for truth in city.roads for cell in truth.cells}))
    for place, leg in enumerate(legs):
        way = Direction.FORWARD if leg.sign > 0 else Direction.BACKWARD
        trace = drive(city, leg.road_id, way, number + place)
        chainage_m = project(city.by_id[leg.road_id].line, trace.lon, trace.lat).chainage_m
        low, high = sorted((leg.from_m, leg.to_m))
        inside = (chainage_m >= low) & (chainage_m <= high)
        readings = np.full((int(inside.sum()), len(cells)), np.nan)
        columns = [cells.index(cell) for cell in trace.cells]
        readings[:, columns] = trace.rsrp_dbm[inside]
        rows.append(readings)
        chainages.append(chainage_m[inside])
        legs_of.append(np.full(int(inside.sum()), place))
    leg, chainage_m = np.concatenate(legs_of), np.concatenate(chainages)
    steps_m = np.abs(np.diff(chainage_m))
    for after in (np.flatnonzero(np.diff(leg)) + 1).tolist():
        steps_m[after - 1] = _round(city, legs[leg[after] - 1], legs[leg[after]], chainage_m, after)
    travelled_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    return Tour(cells, travelled_m, np.concatenate(rows), leg, chainage_m, legs)


def _round(city: City, left: Leg, entered: Leg, chainage_m: np.ndarray, after: int) -> float:
    """Way from a leg's last sample to the next one's first, along both roads to where they meet."""
    if left.road_id == entered.road_id:
        return float(abs(chainage_m[after] - chainage_m[after - 1]))
    end_m = city.by_id[left.road_id].length_m if left.sign > 0 else 0.0
    start_m = 0.0 if entered.sign > 0 else city.by_id[entered.road_id].length_m
    return float(abs(end_m - chainage_m[after - 1]) + abs(chainage_m[after] - start_m))


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One window of a followed tour: what came out, where it really was."""

    last: int
    tracked: tracking.Tracked
    road_id: str
    sign: int
    chainage_m: float

    @property
    def right(self) -> bool:
        """Road and direction are those driven."""
        fix = self.tracked.fix
        on_road = fix.road_id == self.road_id and not fix.off_map
        return on_road and fix.direction.sign == self.sign

    @property
    def error_m(self) -> float:
        """Along the road where it is right, else 1000."""
        if self.tracked.fix.road_id != self.road_id:
            return 1000.0
        return abs(self.tracked.fix.chainage_m - self.chainage_m)

    def posterior_at_truth(self) -> float:
        """Of being on the right road, in the right direction, within 10 m of the truth."""
        near = [
            one.weight
            for one in self.tracked.belief.modes
            if abs(one.chainage_m - self.chainage_m) <= 10.0 and one.sign == self.sign
        ]
        return sum(near) if self.tracked.fix.road_id == self.road_id else 0.0


def follow_tour(
    index: MapIndex, tour: Tour, *, length_m: float, step_m: float, in_c: bool = False
) -> list[Step]:
    """Windows of ``length_m`` each ``step_m`` along the tour, each with the belief before."""
    steps: list[Step] = []
    end_m = length_m
    while end_m <= tour.travelled_m[-1] + 1e-9:
        last = int(np.searchsorted(tour.travelled_m, end_m, side="right")) - 1
        first = int(np.searchsorted(tour.travelled_m, tour.travelled_m[last] - length_m - 1e-9))
        window = tour.window(first, last)
        if steps:
            before = steps[-1]
            since_m = float(tour.travelled_m[last] - tour.travelled_m[before.last])
            belief, heard = before.tracked.belief, before.tracked.heard
            tracked = tracking.follow(index, window, belief, since_m, heard=heard, in_c=in_c)
        else:
            tracked = tracking.begin(index, window, in_c=in_c)
        leg = tour.legs[tour.leg[last]]
        truth_m = float(tour.chainage_m[last])
        steps.append(Step(last, tracked, leg.road_id, leg.sign, truth_m))
        end_m += step_m
    return steps


def without(window: Window, cells: int) -> Window:
    """The window with only its first cells heard."""
    readings = window.rsrp_dbm.copy()
    readings[:, cells:] = np.nan
    return replace(window, rsrp_dbm=readings)


def place_of(index: MapIndex, road_id: str, chainage_m: float) -> tuple[float, float]:
    """Degrees at a chainage of a mapped road."""
    place = point_at(index.lines[index.road_ids.index(road_id)], chainage_m)
    return float(place.lon), float(place.lat)
