"""
The numeric core alone: one window against maps in memory, in C and with numpy.

Both take the windows in turn, in rounds, so that what slows the machine slows both; every window is
another one, as in a service. Beside them `locate_exhaustively`, their definition. Where there are
real drives (``--data``), windows of several lengths of their test passes follow, on the map of the
survey passes; ``--roads 1000`` adds a city of so many roads. Ends by itself.

    python -m benchmarks.bench_locate [--rounds 20] [--windows 100] [--data DIR] [--roads N]
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median, quantiles

from app.domain import Fix, RadioMap, RoadModel, Trace, Window
from app.evaluation import realdata
from app.evaluation.dataset import is_dataset
from app.evaluation.passes import cut_windows
from app.evaluation.scenario import Scenario, build_city, preset, survey, windows
from app.numerics import native
from app.numerics.calibration import calibrate
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.roadfit import fit_road

SEED = 7
WINDOW_M = 29.0  # 30 samples at 1 m
REAL_WINDOWS_M = (30.0, 50.0, 100.0, 200.0, 400.0)
REAL = Path(__file__).resolve().parents[2] / "shared" / "data" / "santa_monica_att"
SLOW_WINDOWS = 15  # exhaustive search takes as long as some dozens of fixes
TRIED_ROADS = 60  # of a large city: their calibration serves all

Locator = Callable[[MapIndex, Window], Fix]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--windows", type=int, default=100, help="of each kind in a round")
    parser.add_argument("--data", type=Path, default=REAL, help="real drives, where there are any")
    parser.add_argument("--roads", type=int, default=0, help="of one more city")
    chosen = parser.parse_args(arguments)
    print("one window, microseconds; half of the rounds in brackets; without more words 30 samples")
    for name, scenario in scenarios(chosen.roads).items():
        index, asked = mapped(scenario, chosen.windows)
        report(name, index, measure(index, asked, chosen.rounds))
    if is_dataset(chosen.data):
        measure_real(chosen.data, chosen.windows, chosen.rounds)


def measure_real(folder: Path, count: int, rounds: int) -> None:
    """Windows of test passes on the map of survey passes."""
    data = realdata.load(folder)
    passes: dict[str, list[Trace]] = defaultdict(list)
    for trace in data.survey:
        passes[str(trace.road_id)].append(trace)
    index = index_of(tuple(fit_road(road, passes[road.road_id]) for road in data.roads))
    for length_m in REAL_WINDOWS_M:
        cut = cut_windows(data.tests, count, length_m=length_m, seed=SEED)
        name = f"{len(index.roads)} real streets, windows of {length_m:.0f} m"
        report(name, index, measure(index, [one.window for one in cut], rounds))


def scenarios(roads: int) -> dict[str, Scenario]:
    """The paper's area, and towns of as many streets as the real drives cross, and more."""
    city = preset("city")
    sizes = [17, 60, roads] if roads else [17, 60]
    return {
        "paper, 4 roads x 6 cells": preset("paper"),
        **{f"city, {size} roads": replace(city, roads=size) for size in sizes},
    }


def mapped(scenario: Scenario, count: int) -> tuple[MapIndex, list[Window]]:
    """A surveyed city's map and windows driven through it."""
    city = build_city(scenario, SEED)
    passes: dict[str, list[Trace]] = defaultdict(list)
    for one in survey(city):
        passes[str(one.road_id)].append(one)
    models = tuple(fit_road(truth.road, passes[truth.road.road_id]) for truth in city.roads)
    return index_of(models), [one.window for one in windows(city, count, length_m=WINDOW_M)]


def index_of(models: tuple[RoadModel, ...]) -> MapIndex:
    """A map of roads."""
    return MapIndex.build(RadioMap(1, models, calibrate(models[:TRIED_ROADS])))


def measure(index: MapIndex, asked: list[Window], rounds: int) -> dict[str, list[float]]:
    """Median seconds of each round and locator; a first round warms up and is left out."""
    ways: dict[str, tuple[Locator, list[Window]]] = {
        "numpy": (partial(locate, in_c=False), asked),
        "exhaustive": (locate_exhaustively, asked[:SLOW_WINDOWS]),
    }
    if native.BUILT:
        ways = {"C": (partial(locate, in_c=True), asked), **ways}
    measured: dict[str, list[float]] = {name: [] for name in ways}
    for number in range(rounds + 1):
        for name, (way, some) in ways.items():
            elapsed_s = median([timed(way, index, window) for window in some])
            if number:
                measured[name].append(elapsed_s)
    return measured


def timed(way: Locator, index: MapIndex, window: Window) -> float:
    """Seconds of one fix."""
    started = time.perf_counter()
    way(index, window)
    return time.perf_counter() - started


def report(name: str, index: MapIndex, measured: Mapping[str, list[float]]) -> None:
    """One line a locator, with the ratio of paired rounds to the first."""
    metres = sum(road.length_m for road in index.roads)
    print(f"{name}, {len(index.cells)} cells, {metres / 1000:.1f} km")
    first = next(iter(measured.values()))
    for way, seconds in measured.items():
        low, middle, high = (1e6 * one for one in quantiles(seconds, n=4))
        ratio = median(one / other for one, other in zip(seconds, first, strict=True))
        print(f"  {way:<11} {middle:9.0f}  [{low:.0f} to {high:.0f}]  x {ratio:.1f}")


if __name__ == "__main__":
    main()
