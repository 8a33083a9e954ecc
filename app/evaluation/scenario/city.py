"""A city as it is once built: its roads on the earth and the true mean RSRP along each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from app.domain import Line, Road
from app.evaluation.scenario.layout import Layout
from app.evaluation.scenario.params import Scenario


@dataclass(frozen=True, slots=True, eq=False)
class RoadTruth:
    """
    One road with what a perfect receiver would measure on it.

    Attributes:
        index: Place of the road in the city: part of the key of its random streams.
        line: The centre line, from chainage 0 to ``length_m``.
        cells: Cells that can be heard on it, in the city's order.
        survey_dbm: True mean at survey time, on an even grid from end to end, its last place the
            line's end. Shape ``(grid, cells)``.
        drive_dbm: The same when the vehicles drive: with the drift since the survey.
        median_dbm: The mean without its shadowing, on the same grid: what the plan alone tells.
        shadowing_db: Standard deviation of that shadowing.
    """

    road_id: str
    index: int
    line: Line
    length_m: float
    cells: tuple[str, ...]
    survey_dbm: Float[np.ndarray, "grid cells"]
    drive_dbm: Float[np.ndarray, "grid cells"]
    median_dbm: Float[np.ndarray, "grid cells"]
    shadowing_db: Float[np.ndarray, "grid cells"]

    @property
    def road(self) -> Road:
        """The road as a map would be told of it."""
        return Road(self.road_id, self.road_id, self.line)

    def mean_dbm(
        self, chainage_m: Float[np.ndarray, " points"], *, drifted: bool = False
    ) -> Float[np.ndarray, "points cells"]:
        """True mean RSRP at chainages in metres, by linear interpolation of the grid."""
        field = self.drive_dbm if drifted else self.survey_dbm
        at = np.clip(chainage_m / self.length_m, 0.0, 1.0) * (len(field) - 1)
        low = np.minimum(at.astype(int), len(field) - 2)
        share = (at - low)[:, None]
        return (1.0 - share) * field[low] + share * field[low + 1]


@dataclass(frozen=True, eq=False)
class City:
    """Roads and cells of a scenario under a seed, with their truth."""

    scenario: Scenario
    seed: int
    layout: Layout
    roads: tuple[RoadTruth, ...]

    @cached_property
    def by_id(self) -> dict[str, RoadTruth]:
        """The roads by their id."""
        return {truth.road_id: truth for truth in self.roads}
