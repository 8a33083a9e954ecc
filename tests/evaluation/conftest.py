"""Surveys small enough to know the right answer by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from app.domain import Line, Road, Trace, Window
from app.evaluation.methods import Place, Survey
from app.evaluation.scenario import build_city, preset, survey
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import point_at

FRAME = LocalFrame(11.5, 48.1)


@dataclass(frozen=True)
class Street:
    """A straight street to the east, whose levels are functions of the chainage."""

    road_id: str
    north_m: float
    levels_dbm: Callable[[np.ndarray], np.ndarray]
    length_m: float = 200.0

    @property
    def road(self) -> Road:
        """The street with its line."""
        place = FRAME.to_lonlat(np.array([0.0, self.length_m]), np.full(2, self.north_m))
        return Road(self.road_id, None, Line(place.lon, place.lat))

    def trace(self, step_m: float = 1.0) -> Trace:
        """A survey pass without noise."""
        at_m = np.arange(0.0, self.length_m + 1e-9, step_m)
        place = point_at(self.road.line, at_m)
        levels = self.levels_dbm(at_m).astype(np.float32)
        cells = tuple(f"cell-{i}" for i in range(levels.shape[1]))
        return Trace(cells, at_m / 8.0, place.lon, place.lat, levels, self.road_id)

    def window(self, start_m: float, end_m: float, step_m: float = 1.0) -> Window:
        """Readings along the drive from one chainage to another, either way."""
        count = round(abs(end_m - start_m) / step_m) + 1
        levels = self.levels_dbm(np.linspace(start_m, end_m, count))
        cells = tuple(f"cell-{i}" for i in range(levels.shape[1]))
        return Window(cells, np.arange(count) * step_m, levels)


def survey_of(
    *streets: Street, grid_m: float = 1.0, sites: dict[str, Place] | None = None
) -> Survey:
    traces = tuple(street.trace() for street in streets)
    return Survey(tuple(s.road for s in streets), traces, grid_m, 30.0, sites or {})


def waves(seed: int, cells: int = 4) -> Callable[[np.ndarray], np.ndarray]:
    """Smooth levels that tell places apart."""
    rng = np.random.default_rng(seed)
    phase, stretch = rng.uniform(0, 6.3, size=(2, cells))
    return lambda at: -90.0 + 9.0 * np.sin(at[:, None] / (14.0 + 3.0 * stretch) + phase)


@pytest.fixture(scope="session")
def lab():
    """What the tests of methods build from."""

    class Lab:
        street, survey, wave = staticmethod(Street), staticmethod(survey_of), staticmethod(waves)
        frame = FRAME

    return Lab


@pytest.fixture(scope="session")
def paper_city():
    return build_city(replace(preset("paper"), cells=4), 20261122)


@pytest.fixture(scope="session")
def paper_survey(paper_city):
    roads = tuple(truth.road for truth in paper_city.roads)
    return Survey(roads, tuple(survey(paper_city)), 1.0, 30.0)
