"""
The experiments as points, and the settings that have to be run for them.

A point is one place on the axis of one figure. A setting is what is built and asked once: a city
(or a data set), its survey, all methods fitted. Points of different figures that need the same
setting share it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from app.evaluation.protocols import PROTOCOLS, Protocol
from app.evaluation.scenario import Scenario, preset

WINDOW_M = 30.0
REAL_WINDOWS_M = (50.0, 100.0, 200.0, 400.0)
REAL_GRID_M = 2.0  # the paper's, for its own drives
CITY_SIZES = (4, 16, 64, 256)
CITY_WINDOWS = 100
MAP_METHODS = (
    "exhaustive",
    "roadprint",
)  # the others cannot be fitted to hundreds of roads in time


@dataclass(frozen=True, slots=True, order=True)
class Case:
    """One kind of window asked under a setting."""

    protocol: Protocol
    window_m: float


@dataclass(frozen=True, slots=True)
class Setting:
    """
    What is built once.

    Attributes:
        scenario: None with real data.
        data: Folder of real data, None in a simulated city.
        grid_m: Spacing of the survey's samples and of reference points.
        windows: Asked in each case.
    """

    scenario: Scenario | None
    data: str | None
    seed: int
    grid_m: float
    methods: tuple[str, ...]
    windows: int


@dataclass(frozen=True, slots=True)
class Point:
    """One place on an experiment's axis, under one seed."""

    experiment: str
    x: float
    label: str
    setting: Setting
    case: Case


@dataclass(frozen=True, slots=True)
class Job:
    """A setting and all that is asked under it."""

    setting: Setting
    cases: tuple[Case, ...]

    @property
    def key(self) -> str:
        """Name of the job's results: the same for the same work."""
        text = json.dumps(asdict(self), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Ask:
    """What the user chose; the base of every setting."""

    scenario: str | None
    data: str | None
    methods: tuple[str, ...]
    windows: int

    def setting(self, seed: int, grid_m: float = 1.0, **changes: Any) -> Setting:
        """The base setting with changes of the scenario."""
        scenario = None
        if self.scenario is not None:
            scenario = replace(preset(self.scenario), **changes)
        return Setting(scenario, self.data, seed, grid_m, self.methods, self.windows)


def _cells(ask: Ask, seed: int) -> Iterator[Point]:
    for cells in range(1, 7):
        for protocol in PROTOCOLS:
            setting = ask.setting(seed, cells=cells)
            yield Point("cells", cells, f"{cells}", setting, Case(protocol, WINDOW_M))


def _grid(ask: Ask, seed: int) -> Iterator[Point]:
    for grid_m in (1.0, 2.0, 4.0, 6.0, 8.0, 10.0):
        for protocol in PROTOCOLS:
            setting = ask.setting(seed, grid_m)
            yield Point("grid", grid_m, f"{grid_m:g} m", setting, Case(protocol, WINDOW_M))


def _cdf(ask: Ask, seed: int) -> Iterator[Point]:
    if ask.data is not None:
        setting = ask.setting(seed, REAL_GRID_M)
        yield Point("cdf", 200.0, "2 m grid", setting, Case("anywhere", 200.0))
    else:
        setting = ask.setting(seed, 2.0, cells=2)
        yield Point("cdf", 2.0, "2 cells, 2 m grid", setting, Case("anywhere", WINDOW_M))


def _window(ask: Ask, seed: int) -> Iterator[Point]:
    real = ask.data is not None
    for window_m in REAL_WINDOWS_M if real else (10.0, 20.0, 30.0, 60.0, 100.0):
        setting = ask.setting(seed, REAL_GRID_M if real else 1.0)
        yield Point("window", window_m, f"{window_m:g} m", setting, Case("anywhere", window_m))


def _noise(ask: Ask, seed: int) -> Iterator[Point]:
    for noise_db in (0.0, 1.0, 2.0, 4.0, 6.0):
        setting = ask.setting(seed, noise_db=noise_db)
        yield Point("noise", noise_db, f"{noise_db:g} dB", setting, Case("anywhere", WINDOW_M))


def _impairments(ask: Ask, seed: int) -> Iterator[Point]:
    harsh = preset("harsh")
    changes: dict[str, dict[str, Any]] = {
        "none": {},
        "1 Hz": {"sample_interval_s": harsh.sample_interval_s},
        "3 dB noise": {"noise_db": harsh.noise_db},
        "4 dB offset": {"device_offset_sd_db": harsh.device_offset_sd_db},
        "3 % odometer": {"odometer_error_sd": harsh.odometer_error_sd},
        "2 dB drift": {"drift_db": harsh.drift_db},
        "3 m survey": {"survey_position_noise_m": harsh.survey_position_noise_m},
    }
    case = Case("anywhere", WINDOW_M)
    for i, (label, change) in enumerate(changes.items()):
        yield Point("impairments", i, label, ask.setting(seed, **change), case)
    everything = replace(ask, scenario="harsh").setting(seed)
    yield Point("impairments", len(changes), "all (harsh)", everything, case)


def _passes(ask: Ask, seed: int) -> Iterator[Point]:
    for passes in (1, 2, 3, 5):
        setting = replace(ask, scenario="harsh").setting(seed, survey_passes=passes)
        yield Point("passes", passes, f"{passes}", setting, Case("anywhere", WINDOW_M))


def _reliability(ask: Ask, seed: int) -> Iterator[Point]:
    if ask.data is not None:
        setting = ask.setting(seed, REAL_GRID_M)
        yield Point("reliability", 0, "data", setting, Case("anywhere", 200.0))
        return
    case = Case("anywhere", WINDOW_M)
    yield Point("reliability", 0, str(ask.scenario), ask.setting(seed), case)
    if ask.scenario != "harsh":
        yield Point("reliability", 1, "harsh", replace(ask, scenario="harsh").setting(seed), case)


def _recall(ask: Ask, seed: int) -> Iterator[Point]:
    if ask.data is not None:
        yield from (replace(point, experiment="recall") for point in _window(ask, seed))
        return
    for point in _cells(ask, seed):
        if point.case.protocol == "anywhere":
            yield replace(point, experiment="recall")


def _roads(ask: Ask, seed: int) -> Iterator[Point]:
    if seed != 0:
        return  # a question of time, not of chance: one city of each size
    methods = tuple(name for name in ask.methods if name in MAP_METHODS)
    small = replace(ask, scenario="city", methods=methods, windows=min(ask.windows, CITY_WINDOWS))
    for roads in CITY_SIZES if methods else ():
        setting = small.setting(seed, roads=roads, cells=max(8, roads // 2))
        yield Point("roads", roads, f"{roads}", setting, Case("anywhere", WINDOW_M))


EXPERIMENTS: dict[str, Callable[[Ask, int], Iterator[Point]]] = {
    "cells": _cells,
    "grid": _grid,
    "cdf": _cdf,
    "window": _window,
    "noise": _noise,
    "impairments": _impairments,
    "passes": _passes,
    "reliability": _reliability,
    "recall": _recall,
    "roads": _roads,
}
"""Name -> its points under a seed, in the order of the report."""

PAPER_SUITE = ("cells", "grid", "cdf")
REAL_EXPERIMENTS = ("cdf", "window", "reliability", "recall")


def plan(ask: Ask, experiments: Sequence[str], seeds: int) -> list[Point]:
    """All points of the experiments, in the order of the report."""
    return [
        point
        for name in experiments
        for seed in range(seeds)
        for point in EXPERIMENTS[name](ask, seed)
    ]


def jobs(points: Sequence[Point]) -> list[Job]:
    """Each setting once with all its cases, in the order of first need."""
    cases: dict[Setting, set[Case]] = {}
    for point in points:
        cases.setdefault(point.setting, set()).add(point.case)
    return [Job(setting, tuple(sorted(wanted))) for setting, wanted in cases.items()]
