"""
Tracking along whole test passes of real streets, beside the same windows located alone.

    python -m benchmarks.bench_tracking [FOLDER] [--length-m 100] [--step-m 100]

FOLDER is a data set (docs/datasets.md); where it is absent the benchmark says so and ends. The map
is fitted from the survey passes. Windows lie back to back unless the step is another one; figures
are of each pass's second window on, an off-map answer counts as wrong and is as far off as its best
place. "Whole" asks for all that the pass has driven so far as one window: what no memory of windows
can surpass by much.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.domain import Fix, RadioMap
from app.evaluation.dataset import is_dataset
from app.evaluation.passes import Drive, window_of
from app.evaluation.realdata import RealData, load
from app.evaluation.truth import Labelled, Truth
from app.numerics import matching, tracking
from app.numerics.calibration import calibrate
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.roadfit import fit_road

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "santa_monica_att"


@dataclass(frozen=True, slots=True)
class Row:
    """One answer against its truth."""

    error_m: float
    road: bool
    direction: bool
    within: bool
    took_ms: float

    @classmethod
    def of(cls, fix: Fix, truth: Truth, took_s: float) -> Row:
        """Compare."""
        error_m = float(distance_m(fix.lon, fix.lat, truth.lon, truth.lat))
        road = fix.road_id == truth.road_id and not fix.off_map
        direction = road and fix.direction == truth.direction
        return cls(error_m, road, direction, error_m <= fix.accuracy_m, 1e3 * took_s)


def main() -> None:
    """Fit, follow, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    parser.add_argument("--length-m", type=float, default=100.0)
    parser.add_argument("--step-m", type=float, default=100.0)
    chosen = parser.parse_args()
    if not is_dataset(chosen.folder):
        print(f"tracking: the measurements are not at {chosen.folder}; nothing measured")
        return
    data = load(chosen.folder)
    index = fitted(data)
    rows: dict[str, list[Row]] = {"alone": [], "tracked": [], "whole": []}
    for drive in data.tests:
        for each in follow(index, drive, chosen.length_m, chosen.step_m):
            for name, row in zip(rows, each, strict=True):
                rows[name].append(row)
    print(
        f"{len(data.tests)} test passes of {chosen.folder.name}, windows of {chosen.length_m:g} m "
        f"every {chosen.step_m:g} m, from the second one on"
    )
    for name, kept in rows.items():
        print(described(name, kept))


def fitted(data: RealData) -> MapIndex:
    """The map of the survey passes."""
    models = [
        fit_road(road, [one for one in data.survey if one.road_id == road.road_id])
        for road in data.roads
    ]
    return MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))


def follow(
    index: MapIndex, drive: Drive, length_m: float, step_m: float
) -> Iterator[tuple[Row, Row, Row]]:
    """Rows alone, tracked and whole of each window of a drive but the first."""
    kept, before = None, 0
    for last, one in windows(drive, length_m, step_m):
        started = time.perf_counter()
        fix = matching.locate(index, one.window)
        alone_s = time.perf_counter() - started
        started = time.perf_counter()
        if kept is None:
            kept = tracking.begin(index, one.window)
        else:
            since_m = float(drive.travelled_m[last] - drive.travelled_m[before])
            kept = tracking.follow(index, one.window, kept.belief, since_m, heard=kept.heard)
            tracked_s = time.perf_counter() - started
            started = time.perf_counter()
            whole = matching.locate(index, window_of(drive, 0, last).window)
            whole_s = time.perf_counter() - started
            yield (
                Row.of(fix, one.truth, alone_s),
                Row.of(kept.fix, one.truth, tracked_s),
                Row.of(whole, one.truth, whole_s),
            )
        before = last


def windows(drive: Drive, length_m: float, step_m: float) -> Iterator[tuple[int, Labelled]]:
    """Windows in the order they were driven, each with the number of its last sample."""
    before = -1
    for end_m in np.arange(length_m, drive.travelled_m[-1] + 1e-9, step_m):
        last = int(np.searchsorted(drive.travelled_m, end_m, side="right")) - 1
        first = int(np.searchsorted(drive.travelled_m, drive.travelled_m[last] - length_m - 1e-6))
        if first < last and last > before:
            one = window_of(drive, first, last)
            if one.window.cells:
                before = last
                yield last, one


def described(name: str, rows: list[Row]) -> str:
    """A line of figures."""
    error_m = np.array([row.error_m for row in rows])
    return (
        f"  {name:8s} {len(rows)} windows  median {np.median(error_m):5.2f} m  "
        f"p90 {np.quantile(error_m, 0.9):5.1f} m  road {np.mean([r.road for r in rows]):.1%}  "
        f"direction {np.mean([r.direction for r in rows]):.1%}  "
        f"68 % radius holds {np.mean([r.within for r in rows]):.1%}  "
        f"{np.median([r.took_ms for r in rows]):.2f} ms"
    )


if __name__ == "__main__":
    main()
