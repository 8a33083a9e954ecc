"""
`rwknn`: restricted weighted k nearest neighbours on absolute RSRP, k = 3.

Source: G. Chen, X. Guo, K. Liu, X. Li, J. Yang, "RWKNN: A modified WKNN algorithm specific for the
indoor localization problem", IEEE Sensors Journal 22, 2022. The vector of readings is compared with
every reference point's by Euclidean distance d; the position is the mean of the k nearest weighed
by 1 / d; the restriction leaves only the points that can be reached from the previous fix in the
elapsed distance.

What the sources leave open, and how it is chosen: a window is walked sample by sample, so that the
restriction works within it as well as from the drive's last window. How far beyond the travelled
distance a point still counts as reachable (``slack_m``: 3, 8, 20), over how much way readings are
averaged (``average_m``: 0, 4, 8; the lag of the mean, half of it, is put back along the walked
direction) and how much worse the best reachable point may be before the restriction is given up
(``restart``: 1.3 times, never) are chosen on held-out survey windows. A cell not heard counts as
the survey's faintest percent. The direction is that of the walk within the window.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from app.domain import Direction, Window
from app.evaluation.methods.base import Estimate, Previous, Survey
from app.evaluation.methods.references import (
    CENTRE_DBM,
    References,
    lay_references,
    recent_mean_dbm,
)
from app.evaluation.methods.tuning import choose
from app.numerics.geodesy import Floats

name = "rwknn"

NEIGHBOURS = 3
SAME_DB2_DIGITS = 6  # distances that agree so far are the same
LEAST_DB2 = 1.0  # two vectors nearer than this are the same
MOST_STEPS = 40  # a longer window is walked at this many of its samples


@dataclass(frozen=True, slots=True)
class Parameters:
    """What is chosen on the survey."""

    slack_m: float
    average_m: float
    restart: float


CHOICES = tuple(
    Parameters(slack_m, average_m, restart)
    for slack_m, average_m, restart in product((3.0, 8.0, 20.0), (0.0, 4.0, 8.0), (1.3, np.inf))
)


def fit(survey: Survey, seed: int) -> Rwknn:
    """Lay the reference points and choose the parameters."""
    best = choose(CHOICES, lambda train, each: Rwknn(lay_references(train), each), survey, seed)
    return Rwknn(lay_references(survey), best)


class Rwknn:
    """Reference points and parameters, ready to be asked."""

    def __init__(self, points: References, parameters: Parameters) -> None:
        self.parameters = parameters
        self._points = points
        self._levels = points.filled_db()
        self._norm = (self._levels**2).sum(axis=1)

    def locate(self, window: Window, previous: Previous | None) -> Estimate:
        """Walk the window from the previous fix, or from the best of all points."""
        distance_m = window.distance_m
        samples = np.unique(np.linspace(0, len(distance_m) - 1, MOST_STEPS).astype(int))
        readings = self._readings_db(window, samples)
        squared = self._squared_db2(readings)
        fixes: list[_Fix] = []
        known = previous.estimate.memory if previous is not None else None
        last = known if isinstance(known, _Fix) else None
        way_m = previous.since_m - (distance_m[-1] - distance_m[0]) if previous is not None else 0.0
        for step, sample in enumerate(samples):
            if step:
                way_m = distance_m[sample] - distance_m[samples[step - 1]]
            chosen = self._nearest(squared[step], last, abs(way_m))
            last = self._mean_of(chosen, readings[step])
            fixes.append(last)
        return self._tell(fixes)

    def _readings_db(
        self, window: Window, samples: Int[np.ndarray, " steps"]
    ) -> Float[np.ndarray, "steps cells"]:
        columns = self._points.columns(window)
        mean = recent_mean_dbm(columns, window.distance_m, self.parameters.average_m)[samples]
        return np.where(np.isnan(mean), self._points.floor_dbm, mean) - CENTRE_DBM

    def _squared_db2(
        self, readings: Float[np.ndarray, "steps cells"]
    ) -> Float[np.ndarray, "steps points"]:
        cross = readings @ self._levels.T
        squared = self._norm - 2.0 * cross + (readings**2).sum(axis=1)[:, None]
        # Whole decibels make many ties; without rounding, each processor would break its own.
        return np.maximum(squared.round(SAME_DB2_DIGITS), 0.0)

    def _nearest(self, squared_db2: Floats, last: _Fix | None, way_m: float) -> np.ndarray:
        """The nearest points that can be reached; of all where none fits well."""
        points = self._points
        if last is not None:
            reach_m = way_m + self.parameters.slack_m
            away = (points.x_m - last.x_m) ** 2 + (points.y_m - last.y_m) ** 2
            near = np.flatnonzero(away <= reach_m**2 + 1e-6)
            if len(near) >= NEIGHBOURS:
                inside = squared_db2[near]
                given_up = self.parameters.restart**2 * (squared_db2.min() + LEAST_DB2)
                if inside.min() <= given_up:
                    return np.asarray(near[_smallest(inside)])
        return _smallest(squared_db2)

    def _mean_of(self, chosen: np.ndarray, reading: Float[np.ndarray, " cells"]) -> _Fix:
        points = self._points
        # Anew from the differences: the products above lose the digits of a near match.
        distance_db = np.sqrt(((self._levels[chosen] - reading) ** 2).sum(axis=1))
        weight = 1.0 / (distance_db + 1e-3)
        weight /= weight.sum()
        road = int(points.road[chosen[np.argmax(weight)]])
        same = points.road[chosen] == road
        return _Fix(
            float(weight @ points.x_m[chosen]),
            float(weight @ points.y_m[chosen]),
            road,
            float(weight[same] @ points.chainage_m[chosen][same] / weight[same].sum()),
        )

    def _tell(self, fixes: list[_Fix]) -> Estimate:
        points, last = self._points, fixes[-1]
        walked_m = [fix.chainage_m for fix in fixes if fix.road == last.road]
        steps_m = np.sign(np.diff(walked_m)).sum() if len(walked_m) > 1 else 0.0
        direction = None
        chainage_m, x_m, y_m = last.chainage_m, last.x_m, last.y_m
        if steps_m:
            direction = Direction.FORWARD if steps_m > 0 else Direction.BACKWARD
            lag_m = 0.5 * self.parameters.average_m * direction.sign
            first, end = points.start[last.road], points.start[last.road + 1] - 1
            top_m = points.chainage_m[end]
            moved_m = float(np.clip(chainage_m + lag_m, 0.0, top_m)) - chainage_m
            x_m += moved_m * float(points.x_m[end] - points.x_m[first]) / max(top_m, 1.0)
            y_m += moved_m * float(points.y_m[end] - points.y_m[first]) / max(top_m, 1.0)
            chainage_m += moved_m
        place = points.frame.to_lonlat(x_m, y_m)
        road_id = points.road_ids[last.road]
        return Estimate(
            road_id, chainage_m, float(place.lon), float(place.lat), direction, memory=last
        )


@dataclass(frozen=True, slots=True)
class _Fix:
    """Where one sample was put."""

    x_m: float
    y_m: float
    road: int
    chainage_m: float


def _smallest(values: Floats) -> np.ndarray:
    """Indices of the `NEIGHBOURS` least values; the first ones among equals."""
    if len(values) <= NEIGHBOURS:
        return np.arange(len(values))
    bound = np.partition(values, NEIGHBOURS - 1)[NEIGHBOURS - 1]
    low = np.flatnonzero(values <= bound)
    return low[np.argsort(values[low], kind="stable")[:NEIGHBOURS]]
