"""Tours followed window by window, each step beside its truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.domain import Window
from app.evaluation.scenario.tours import Tour
from app.numerics import tracking
from app.numerics.index import MapIndex
from app.numerics.lines import point_at


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
