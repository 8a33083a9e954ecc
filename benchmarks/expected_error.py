"""
Is the expected error of coverage honest? Survey passes of a data set, held out by day.

    python benchmarks/expected_error.py ../shared/data/santa_monica_att

Each part of the days is located on a map that was fitted and calibrated without it: windows of
200 m ending anywhere, one each 40 m of way. Prints what docs/surveying.md shows. Some minutes.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from app.domain import RadioMap, Road, Trace
from app.evaluation.dataset import PassEntry, read_index, read_roads, stream_passes
from app.evaluation.passes import cut_windows, drive_of
from app.formats.account import Account
from app.numerics.calibration import calibrate
from app.numerics.coverage import cover
from app.numerics.expectation import WINDOW_M, expected_error_m, expected_sd_m, road_right
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.roadfit import fit_road

PARTS = 4
EACH_M = 40.0
STRETCH_M = 50.0  # of a road, whatever its sub-segments are in each part
SEED = 11


@dataclass(frozen=True, slots=True)
class Asked:
    """One window: the stretch it ended on, what was expected there and what came."""

    stretch: str
    passes: int
    days: int
    same_way: bool
    expected_m: float
    error_m: float
    right: bool


def main(folder: Path) -> None:
    """All parts, then the tables."""
    index = read_index(folder)
    survey = [
        (index[one.pass_id], one.trace)
        for one in stream_passes(folder, Account())
        if index[one.pass_id].role == "survey"
    ]
    days = sorted({_day(trace) for _, trace in survey})
    every: list[Asked] = []
    for part in range(PARTS):
        held = set(days[part::PARTS])
        every += _ask(read_roads(folder), survey, held, SEED + part)
        print(f"part {part + 1} of {PARTS}: {len(every)} windows", flush=True)
    _print(every)


def _day(trace: Trace) -> str:
    return trace.recorded_at.date().isoformat() if trace.recorded_at else ""


def _ask(
    roads: Sequence[Road],
    survey: Sequence[tuple[PassEntry, Trace]],
    held: set[str],
    seed: int,
) -> Iterator[Asked]:
    lines = {road.road_id: road.line for road in roads}
    kept = {
        road.road_id: [
            replace(trace, road_id=road.road_id)
            for entry, trace in survey
            if entry.road_id == road.road_id and _day(trace) not in held
        ]
        for road in roads
    }
    models = [fit_road(road, kept[road.road_id]) for road in roads if kept[road.road_id]]
    calibration = calibrate(models)
    radio_map = MapIndex.build(RadioMap(1, tuple(models), calibration))
    covered = {model.road_id: cover(model, kept[model.road_id]) for model in models}
    drives = [
        drive_of(trace, entry.road_id, line, entry.direction)
        for entry, trace in survey
        if _day(trace) in held and (line := lines[entry.road_id]) is not None
    ]
    room_m = sum(max(0.0, float(one.travelled_m[-1]) - WINDOW_M) for one in drives)
    by_id = {model.road_id: model for model in models}
    for one in cut_windows(drives, int(room_m / EACH_M), length_m=WINDOW_M, seed=seed):
        truth = one.truth
        if not one.window.cells or truth.road_id not in by_id:
            continue
        ends = np.array([part.end_m for part in by_id[truth.road_id].segments])
        at = min(int(np.searchsorted(ends, truth.chainage_m)), len(ends) - 1)
        stretch = covered[truth.road_id][at]
        about = (
            stretch.place_information, stretch.mixed_information, stretch.offset_information,
        )  # fmt: skip
        passes = np.array([stretch.passes])
        sd_m = expected_sd_m(np.array([about]), passes, calibration)
        fix = locate(radio_map, one.window)
        yield Asked(
            f"{truth.road_id}/{int(truth.chainage_m // STRETCH_M)}",
            stretch.passes,
            stretch.days,
            bool(stretch.forward if truth.direction.sign > 0 else stretch.backward),
            float(expected_error_m(sd_m, road_right(passes))[0]),
            float(distance_m(fix.lon, fix.lat, truth.lon, truth.lat)),
            fix.road_id == truth.road_id,
        )


def _print(every: Sequence[Asked]) -> None:
    expected, error, right = (
        np.array([getattr(one, name) for one in every], dtype=float)
        for name in ("expected_m", "error_m", "right")
    )
    for name, bounds in (("passes", (0, 1, 2, 4, 7, 99)), ("days", (1, 2, 3, 5, 99))):
        values = np.array([getattr(one, name) for one in every])
        for low, high in itertools.pairwise(bounds):
            _row(f"{name} {low}..{high - 1}", (values >= low) & (values < high), error, right)
    passes = np.array([one.passes for one in every])
    same_way = np.array([one.same_way for one in every])
    for low, high in ((1, 4), (4, 7)):
        for way in (False, True):
            which = (passes >= low) & (passes < high) & (same_way == way)
            _row(f"passes {low}..{high - 1}, its direction driven: {way}", which, error, right)
    known = np.isfinite(expected)
    edges = np.quantile(expected[known], np.linspace(0.0, 1.0, 6))
    for low_m, high_m in itertools.pairwise(edges):
        which = known & (expected >= low_m) & (expected <= high_m)
        below = np.mean(error[which] <= expected[which])
        middle_m = np.median(expected[which])
        name = f"expected {low_m:.1f}..{high_m:.1f} m (median {middle_m:.1f}), {below:.0%} below"
        _row(name, which, error, right)
    print(f"below expected: {np.mean(error[known] <= expected[known]):.3f}")
    print(f"rank correlation, windows: {spearmanr(expected[known], error[known])[0]:.2f}")
    for name, of in (("stretches", 4), ("roads", 1)):
        groups: dict[str, list[Asked]] = {}
        for one in every:
            key = one.stretch if name == "stretches" else one.stretch.split("/", maxsplit=1)[0]
            groups.setdefault(key, []).append(one)
        kept = [group for group in groups.values() if len(group) >= of]
        first = [float(np.nanmedian([one.expected_m for one in group])) for group in kept]
        second = [float(np.median([one.error_m for one in group])) for group in kept]
        ranks = spearmanr(first, second, nan_policy="omit")[0]
        print(f"rank correlation, {len(kept)} {name}: {ranks:.2f}")


def _row(name: str, which: np.ndarray, error_m: np.ndarray, right: np.ndarray) -> None:
    if which.any():
        shares = f"road right {right[which].mean():.3f}, median {np.median(error_m[which]):.1f} m"
        print(f"{name}: {int(which.sum())} windows, {shares}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
