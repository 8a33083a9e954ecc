"""
How right a map of one long route is: `python -m benchmarks.real_route [DIR] [--windows N]`.

First survey drives held out: each of five maps lacks a fifth of them, is calibrated as a build
does, and is asked windows of just these. With `--test` a sixth map, of all survey drives, is asked
the data set's test drives, too, which must decide nothing. Windows end evenly over the driven way.
Errors are along the route. Some five minutes of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from app.domain import Direction, RadioMap, Road, Trace
from app.evaluation.passes import Drive, cut_windows, drive_of
from app.evaluation.realdata import load
from app.evaluation.truth import Labelled
from app.numerics.calibration import calibrate
from app.numerics.index import MapIndex
from app.numerics.lines import project
from app.numerics.matching import locate
from app.numerics.reliability import calibration_error, curve_of
from app.numerics.roadfit import fit_road

ROUTE = Path(__file__).resolve().parents[2] / "shared" / "data" / "pcat"
LENGTHS_M = (50.0, 100.0, 200.0, 400.0)
FOLDS = 5
HELD_OUT_SEEDS, TEST_SEEDS = (3,), (11, 12)

# Error along the route, within each radius, posterior of the sub-segment, whether it is right, and
# whether the window was refused.
Row = tuple[float, ...]


def main() -> None:
    """Print a line for each length."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="?", type=Path, default=ROUTE)
    parser.add_argument("--windows", type=int, default=600, help="of each length")
    parser.add_argument("--test", action="store_true", help="ask test drives, too")
    chosen = parser.parse_args()
    data = load(chosen.data)
    rows: dict[float, list[Row]] = {}
    for fold in range(FOLDS):
        others = [one for number, one in enumerate(data.survey) if number % FOLDS != fold]
        index = map_of(data.roads[0], others)
        asked = [driven(data.roads[0], one) for one in data.survey[fold::FOLDS]]
        for length_m in LENGTHS_M:
            windows = drawn(asked, chosen.windows // FOLDS, length_m, HELD_OUT_SEEDS)
            rows.setdefault(length_m, []).extend(answered(index, one) for one in windows)
    report("survey drives held out", rows)
    if chosen.test:
        index, each = map_of(data.roads[0], data.survey), chosen.windows // len(TEST_SEEDS)
        told = {
            length_m: [
                answered(index, one) for one in drawn(data.tests, each, length_m, TEST_SEEDS)
            ]
            for length_m in LENGTHS_M
        }
        report("test drives", told)


def map_of(road: Road, survey: Sequence[Trace]) -> MapIndex:
    """The route alone, as these drives tell it."""
    models = [fit_road(road, list(survey))]
    return MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))


def driven(road: Road, trace: Trace) -> Drive:
    """A survey drive as one to ask; its progress along the route stands in for the odometer."""
    if road.line is None:
        raise ValueError(f"road {road.road_id} has no line")
    chainage_m = project(road.line, trace.lon, trace.lat).chainage_m
    ahead = chainage_m[-1] >= chainage_m[0]
    way = Direction.FORWARD if ahead else Direction.BACKWARD
    return drive_of(trace, road.road_id, road.line, way)


def drawn(
    drives: Sequence[Drive], count: int, length_m: float, seeds: Sequence[int]
) -> Iterator[Labelled]:
    """Windows of each seed, evenly over the way."""
    for seed in seeds:
        yield from cut_windows(drives, count, length_m=length_m, seed=seed)


def answered(index: MapIndex, one: Labelled) -> Row:
    """A window's answer beside its truth."""
    fix, wide = (locate(index, one.window, confidence=each) for each in (0.68, 0.95))
    error_m = abs(fix.chainage_m - one.truth.chainage_m)
    right = fix.segment_start_m <= one.truth.chainage_m <= fix.segment_end_m and not fix.off_map
    within = [not fix.off_map and error_m <= each.accuracy_m for each in (fix, wide)]
    return error_m, *within, fix.segment_posterior, right, fix.off_map


def report(name: str, rows: dict[float, list[Row]]) -> None:
    """A line of figures for each length."""
    print(name)
    for length_m, row in rows.items():
        print(f"  {length_m:3.0f} m  {described(np.array(row, dtype=float))}", flush=True)


def described(rows: Float[np.ndarray, "windows 6"]) -> str:
    """A line of figures."""
    error_m, in68, in95, said, right, refused = rows.T
    return (
        f"{len(rows)} windows  median {np.median(error_m):6.2f} m  "
        f"sub-segment said {said.mean():.1%}, right {right.mean():.1%}, "
        f"ECE {calibration_error(curve_of(said, right > 0.0)):.1%}  "
        f"68 % radius {in68.mean():.1%}  95 % {in95.mean():.1%}  refused {refused.mean():.1%}"
    )


if __name__ == "__main__":
    main()
