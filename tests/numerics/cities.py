"""Maps of simulated cities, fitted once a test run, and windows driven through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from app.domain import RadioMap, RoadModel, Window
from app.evaluation.scenario import City, build_city, preset, survey
from app.evaluation.truth import Labelled
from app.numerics.calibration import calibrate
from app.numerics.index import MapIndex
from app.numerics.roadfit import fit_road


@dataclass(frozen=True, slots=True)
class Surveyed:
    """A city's roads fitted, and the map of them."""

    models: tuple[RoadModel, ...]
    index: MapIndex


def city_of(name: str = "paper", cells: int = 6) -> City:
    return _city(name, cells)


def models_of(name: str = "paper", cells: int = 6) -> tuple[RoadModel, ...]:
    return _surveyed(name, cells).models


def index_of(name: str = "paper", cells: int = 6) -> MapIndex:
    return _surveyed(name, cells).index


@cache
def _city(name: str, cells: int) -> City:
    return build_city(replace(preset(name), cells=cells), seed=7)


@cache
def _surveyed(name: str, cells: int) -> Surveyed:
    city = _city(name, cells)
    passes = survey(city)
    models = tuple(
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    )
    return Surveyed(models, index_with(models))


def index_with(models: Sequence[RoadModel]) -> MapIndex:
    return MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))


def thinned(one: Labelled, seed: int, share: float = 0.5) -> Labelled:
    """The window with some samples left out, for irregular distances; the last one stays."""
    rng = np.random.default_rng(seed)
    kept = rng.random(len(one.window.distance_m)) < share
    kept[-1] = True
    window = one.window
    return Labelled(Window(window.cells, window.distance_m[kept], window.rsrp_dbm[kept]), one.truth)


def with_gaps(one: Labelled, seed: int, share: float = 0.2) -> Labelled:
    """The window with some readings missing."""
    window = one.window
    lost = np.random.default_rng(seed).random(window.rsrp_dbm.shape) < share
    return Labelled(replace(window, rsrp_dbm=np.where(lost, np.nan, window.rsrp_dbm)), one.truth)


def with_strangers(one: Labelled, seed: int, cells: tuple[str, ...] = ("x:1", "x:2")) -> Labelled:
    """The window with readings of cells that no map knows."""
    window = one.window
    rng = np.random.default_rng(seed)
    readings_dbm = rng.uniform(-120.0, -70.0, (len(window.distance_m), len(cells)))
    columns = np.column_stack([window.rsrp_dbm, readings_dbm])
    return Labelled(Window((*window.cells, *cells), window.distance_m, columns), one.truth)


def error_m(fix, truth) -> float:
    """Along the road where it is right, else 1000."""
    return abs(fix.chainage_m - truth.chainage_m) if fix.road_id == truth.road_id else 1000.0
