"""
How far a map of few passes can be trusted: `python -m benchmarks.first_night [DIR] [--windows N]`.

Maps of one day's survey passes, of one pass a road, and of one pass on half of the roads and the
first days' passes on the others, calibrated as a build does, asked windows of the survey's other
days. Beside what they answer, how sure they are of it. Passes that a data set keeps for tests are
never read. With `--constants` instead: what `calibration.UNTRIED` was taken
from, the calibrations of maps with two passes a road on two days. Some five minutes of one core.
"""

from __future__ import annotations

import argparse
import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.domain import Calibration, Direction, RadioMap, Road, Trace
from app.evaluation.dataset import read_index, read_roads, stream_passes
from app.evaluation.passes import Drive, cut_windows, drive_of
from app.formats.account import Account
from app.numerics.calibration import UNTRIED, calibrate
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.reliability import calibration_error, curve_of
from app.numerics.roadfit import fit_road

REAL = Path(__file__).resolve().parents[2] / "shared" / "data" / "santa_monica_att"
LENGTHS_M = (100.0, 200.0, 400.0)
SEED = 5
PICKS = (11, 12, 13)  # of one pass a road
PAIRS = range(6)  # of two
INSIDE_M = 10.0  # a window may reach so far beyond what a road's passes drove


@dataclass(frozen=True, slots=True)
class Driven:
    """A survey pass, its day, and which stretch of its road it drove."""

    drive: Drive
    day: str

    @property
    def reach_m(self) -> tuple[float, float]:
        """First and last chainage."""
        known_m = self.drive.chainage_m[~np.isnan(self.drive.chainage_m)]
        return float(known_m.min()), float(known_m.max())


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="?", type=Path, default=REAL)
    parser.add_argument("--windows", type=int, default=300, help="of each length and map")
    parser.add_argument("--constants", action="store_true", help="what UNTRIED was taken from")
    chosen = parser.parse_args()
    roads, every = survey_of(chosen.data)
    if chosen.constants:
        print_constants(roads, every)
        return
    days = sorted({one.day for one in every}, key=lambda day: -sum(e.day == day for e in every))
    for day in days[:2]:
        told(f"all passes of {day}", roads, [one for one in every if one.day == day], every, chosen)
    for seed in PICKS:
        rng = random.Random(seed)  # noqa: S311  # a draw of passes, no secret
        picked = [rng.choice(of_road(every, road.road_id)) for road in roads]
        told(f"one pass a road, pick {seed}", roads, picked, every, chosen)
    early = set(sorted(days)[: 2 * len(days) // 3])
    for seed in PICKS:
        rng, uneven = random.Random(seed), []  # noqa: S311
        thin = set(rng.sample([road.road_id for road in roads], len(roads) // 2))
        for road in roads:
            passes = [one for one in of_road(every, road.road_id) if one.day in early]
            uneven += [rng.choice(passes)] if road.road_id in thin and passes else passes
        told(f"one pass on half of the roads, pick {seed}", roads, uneven, every, chosen)


def survey_of(folder: Path) -> tuple[list[Road], list[Driven]]:
    """Roads that the survey drove, and its passes along them."""
    index, roads = read_index(folder), {road.road_id: road for road in read_roads(folder)}
    found = []
    for each in stream_passes(folder, Account()):
        entry = index.get(each.pass_id)
        if entry is None or entry.role != "survey":
            continue
        line, trace = roads[entry.road_id].line, each.trace
        if line is None or trace.recorded_at is None:
            raise SystemExit(f"pass {each.pass_id} needs a road with a line, and a date")
        drive = drive_of(trace, entry.road_id, line, Direction(entry.direction))
        found.append(Driven(drive, trace.recorded_at.date().isoformat()))
    driven = {one.drive.road_id for one in found}
    return [road for road_id, road in roads.items() if road_id in driven], found


def of_road(every: Sequence[Driven], road_id: str) -> list[Driven]:
    """Passes of one road."""
    return [one for one in every if one.drive.road_id == road_id]


def told(
    name: str,
    roads: Sequence[Road],
    used: Sequence[Driven],
    every: Sequence[Driven],
    chosen: argparse.Namespace,
) -> None:
    """Fit and calibrate a map of some passes, ask it windows of other days, print a line each."""
    models = [
        fit_road(road, [one.drive.trace for one in passes])
        for road in roads
        if (passes := of_road(used, road.road_id))
    ]
    found = calibrate(models)
    index = MapIndex.build(RadioMap(1, tuple(models), found))
    print(f"{name}: {len(used)} passes, {len(models)} roads, {described(found)}", flush=True)
    days = {one.day for one in used}
    asked = [one.drive for one in every if one.day not in days]
    for length_m in LENGTHS_M:
        print(f"  {length_m:3.0f} m  {answered(index, used, asked, length_m, chosen.windows)}")


def described(found: Calibration) -> str:
    """What a calibration rests on."""
    measured = f"{found.window_count} windows held out" if found.window_count else "nothing tried"
    return f"{measured}; information {found.information_once} + {found.information_each:.3f} each"


def answered(
    index: MapIndex, used: Sequence[Driven], asked: Sequence[Drive], length_m: float, count: int
) -> str:
    """Figures over windows along stretches that the map's passes drove."""
    rows = []
    for one in cut_windows(asked, count, length_m=length_m, seed=SEED):
        ends_m = one.truth.chainage_m - np.array([0.0, one.truth.direction.sign * length_m])
        if not any(covers(each, ends_m) for each in of_road(used, one.truth.road_id)):
            continue
        fix, wide = (locate(index, one.window, confidence=c) for c in (0.68, 0.95))
        error_m = float(distance_m(fix.lon, fix.lat, one.truth.lon, one.truth.lat))
        right = fix.road_id == one.truth.road_id and not fix.off_map
        within = (error_m <= fix.accuracy_m, error_m <= wide.accuracy_m)
        rows.append((right, error_m, fix.road_posterior, *within, fix.off_map))
    right, error_m, said, in68, in95, refused = np.array(rows, dtype=float).T
    ece = calibration_error(curve_of(said, right > 0.0))
    return (
        f"{len(rows)} windows  road {right.mean():.1%}  median {np.median(error_m):5.1f} m  "
        f"refused {refused.mean():.1%}  said {said.mean():.1%}  ECE {ece:.1%}  "
        f"68 % radius {in68.mean():.1%}  95 % {in95.mean():.1%}"
    )


def covers(one: Driven, ends_m: np.ndarray) -> bool:
    """Whether a pass drove all of a window."""
    first_m, last_m = one.reach_m
    return bool(ends_m.min() >= first_m - INSIDE_M and ends_m.max() <= last_m + INSIDE_M)


def print_constants(roads: Sequence[Road], every: Sequence[Driven]) -> None:
    """Calibrations of maps with two passes a road, of two days, each held out of the other."""
    found = []
    for seed in PAIRS:
        models = [fit_road(road, pair) for road in roads if (pair := two_of(every, road, seed))]
        learnt = calibrate(models)
        # Off the map as windows on such a map are asked in the end.
        found.append(calibrate(models, UNTRIED).off_map)
        print(
            f"pick {seed}: {described(learnt)}, offsets {learnt.offset_sd_db:.1f} dB, positions "
            f"{learnt.position_sd_m} m, boundaries {learnt.segment_sd_m} m, off the map "
            f"{np.round(found[-1], 4).tolist()}",
            flush=True,
        )
    print(f"off the map, mean: {np.round(np.mean(found, axis=0), 4).tolist()}")


def two_of(every: Sequence[Driven], road: Road, seed: int) -> list[Trace]:
    """Two passes of a road, of different days, drawn at random; none where there are none."""
    passes = of_road(every, road.road_id)
    random.Random(seed).shuffle(passes)  # noqa: S311  # a draw of passes, no secret
    for at, one in enumerate(passes):
        for other in passes[at + 1 :]:
            if other.day != one.day:
                return [one.drive.trace, other.drive.trace]
    return []


if __name__ == "__main__":
    main()
