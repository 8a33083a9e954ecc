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
WINDOW_S = 10.0  # instead, where samples come by the clock: 30 m would hold four of them
REAL_WINDOW_M = 200.0
REAL_WINDOWS_M = (50.0, 100.0, 200.0, 400.0)
REAL_GRID_M = 2.0  # the paper's, for its own drives
CITY_SIZES = (4, 16, 64, 256, 1000)  # the last is the preset `city` itself
CITY_WINDOWS = 100
FEWEST_CITY_CELLS = 8
RIVAL_ROADS = 64  # beyond, choosing a rival's parameters on the survey takes minutes, then hours
MAP_METHODS = ("exhaustive", "roadprint")  # one map, no parameter to choose


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
        tuned_m: Length of the windows for which free parameters are chosen.
    """

    scenario: Scenario | None
    data: str | None
    seed: int
    grid_m: float
    methods: tuple[str, ...]
    windows: int
    tuned_m: float


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
        tuned_m = self.window_m
        return Setting(scenario, self.data, seed, grid_m, self.methods, self.windows, tuned_m)

    @property
    def window_m(self) -> float:
        """Length of a window where the experiment does not vary it."""
        if self.scenario is None:
            return REAL_WINDOW_M
        scenario = preset(self.scenario)
        by_clock = scenario.sample_interval_s is not None
        return WINDOW_S * scenario.speed_mps if by_clock else WINDOW_M


def _cells(ask: Ask, seed: int) -> Iterator[Point]:
    for cells in range(1, 7):
        for protocol in PROTOCOLS:
            setting = ask.setting(seed, cells=cells)
            yield Point("cells", cells, f"{cells}", setting, Case(protocol, ask.window_m))


def _grid(ask: Ask, seed: int) -> Iterator[Point]:
    for grid_m in (1.0, 2.0, 4.0, 6.0, 8.0, 10.0):
        for protocol in PROTOCOLS:
            setting = ask.setting(seed, grid_m)
            yield Point("grid", grid_m, f"{grid_m:g} m", setting, Case(protocol, ask.window_m))


def _cdf(ask: Ask, seed: int) -> Iterator[Point]:
    if ask.data is not None:
        setting = ask.setting(seed, REAL_GRID_M)
        yield Point("cdf", REAL_GRID_M, "2 m grid", setting, Case("anywhere", ask.window_m))
    else:
        setting = ask.setting(seed, 2.0, cells=2)
        yield Point("cdf", 2.0, "2 cells, 2 m grid", setting, Case("anywhere", ask.window_m))


def _window(ask: Ask, seed: int) -> Iterator[Point]:
    real = ask.data is not None
    for window_m in REAL_WINDOWS_M if real else (10.0, 20.0, 30.0, 60.0, 100.0):
        setting = ask.setting(seed, REAL_GRID_M if real else 1.0)
        yield Point("window", window_m, f"{window_m:g} m", setting, Case("anywhere", window_m))


def _noise(ask: Ask, seed: int) -> Iterator[Point]:
    for noise_db in (0.0, 1.0, 2.0, 4.0, 6.0):
        setting = ask.setting(seed, noise_db=noise_db)
        yield Point("noise", noise_db, f"{noise_db:g} dB", setting, Case("anywhere", ask.window_m))


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
    case = Case("anywhere", ask.window_m)
    for i, (label, change) in enumerate(changes.items()):
        yield Point("impairments", i, label, ask.setting(seed, **change), case)
    everything = replace(ask, scenario="harsh").setting(seed)
    everything = replace(everything, tuned_m=case.window_m)  # one length for all, to compare
    yield Point("impairments", len(changes), "all (harsh)", everything, case)


def _passes(ask: Ask, seed: int) -> Iterator[Point]:
    for passes in (1, 2, 3, 5):
        harsh = replace(ask, scenario="harsh")
        setting = harsh.setting(seed, survey_passes=passes)
        yield Point("passes", passes, f"{passes}", setting, Case("anywhere", harsh.window_m))


def _reliability(ask: Ask, seed: int) -> Iterator[Point]:
    if ask.data is not None:
        yield from (replace(point, experiment="reliability") for point in _window(ask, seed))
        return
    names = dict.fromkeys((str(ask.scenario), "harsh"))
    for i, one in enumerate(replace(ask, scenario=name) for name in names):
        case = Case("anywhere", one.window_m)
        yield Point("reliability", i, str(one.scenario), one.setting(seed), case)


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
    whole = preset("city")
    for roads in CITY_SIZES:
        rivals = roads <= RIVAL_ROADS
        methods = tuple(name for name in ask.methods if rivals or name in MAP_METHODS)
        if not methods:
            continue
        few = min(ask.windows, CITY_WINDOWS)
        small = replace(ask, scenario="city", methods=methods, windows=few)
        cells = max(FEWEST_CITY_CELLS, whole.cells * roads // whole.roads)
        setting = small.setting(seed, roads=roads, cells=cells)
        yield Point("roads", roads, f"{roads}", setting, Case("anywhere", small.window_m))


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
