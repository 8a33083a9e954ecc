"""Drives round corners: several roads of a city one after the other, with their truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.domain import Direction, Window
from app.evaluation.scenario.city import City
from app.evaluation.scenario.drives import drive
from app.numerics.lines import project


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
    """
    A drive over several legs.

    Attributes:
        travelled_m: The odometer.
        leg, chainage_m: Where each sample was taken.
    """

    cells: tuple[str, ...]
    travelled_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    leg: Int[np.ndarray, " samples"]
    chainage_m: Float[np.ndarray, " samples"]
    legs: tuple[Leg, ...]

    def window(self, first: int, last: int) -> Window:
        """Samples ``first`` to ``last``."""
        part = slice(first, last + 1)
        way_m = self.travelled_m[part] - self.travelled_m[first]
        return Window(self.cells, way_m, self.rsrp_dbm[part])


def tour_of(city: City, *legs: Leg, number: int = 0) -> Tour:
    """
    Drive the legs one after the other, each read off a fresh drive of its road.

    Positions and the odometer are true; the device's offset is another on every leg.

    Args:
        number: Of the first leg's drive; tells tours apart.
    """
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
    of, chainage_m = np.concatenate(legs_of), np.concatenate(chainages)
    steps_m = np.abs(np.diff(chainage_m))
    for after in (np.flatnonzero(np.diff(of)) + 1).tolist():
        steps_m[after - 1] = _round(city, legs[of[after] - 1], legs[of[after]], chainage_m, after)
    travelled_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    return Tour(cells, travelled_m, np.concatenate(rows), of, chainage_m, legs)


def _round(city: City, left: Leg, entered: Leg, chainage_m: np.ndarray, after: int) -> float:
    """Way from a leg's last sample to the next one's first, along both roads to where they meet."""
    if left.road_id == entered.road_id:
        return float(abs(chainage_m[after] - chainage_m[after - 1]))
    end_m = city.by_id[left.road_id].length_m if left.sign > 0 else 0.0
    start_m = 0.0 if entered.sign > 0 else city.by_id[entered.road_id].length_m
    return float(abs(end_m - chainage_m[after - 1]) + abs(chainage_m[after] - start_m))
