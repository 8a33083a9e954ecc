"""
How right a map of real streets is: `python -m benchmarks.real_streets [DIR] [--windows N]`.

First survey passes held out by day: each of four maps lacks a quarter of the survey's days, is
calibrated as a build does, and is asked windows of just these days. With `--test` a fifth map, of
all survey passes, is asked the data set's test passes, too, which must decide nothing. Windows end
evenly over the driven way, or with `--even` as many of every pass. Off the map are the same windows
in the map without their street. Some ten minutes of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from app.domain import RadioMap, Road
from app.evaluation.passes import Drive, cut_windows, load_test_drives
from app.evaluation.truth import Labelled
from app.numerics import native
from app.numerics.answer import fit_of_place
from app.numerics.calibration import calibrate
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, locate, shortlist
from app.numerics.offmap import off_map_probability
from app.numerics.query import ask
from app.numerics.reliability import auroc, calibration_error, curve_of
from app.numerics.roadfit import fit_road
from benchmarks.first_night import LENGTHS_M, REAL, Driven, of_road, survey_of

FOLDS = 4
HELD_OUT_SEEDS, TEST_SEEDS = (3,), (2024, 5, 77)
OFF_M = 1e9  # error of a window that was refused, for medians


def main() -> None:
    """Print a line for each length."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="?", type=Path, default=REAL)
    parser.add_argument("--windows", type=int, default=600, help="of each length, of all folds")
    parser.add_argument("--even", action="store_true", help="as many windows of every pass")
    parser.add_argument(
        "--test", action="store_true", help="ask test passes, 300 of each seed, too"
    )
    chosen = parser.parse_args()
    roads, every = survey_of(chosen.data)
    days = sorted({one.day for one in every})
    rows: dict[float, list[Row]] = {}
    for fold in range(FOLDS):
        out = set(days[fold::FOLDS])
        maps = Maps(roads, [one for one in every if one.day not in out])
        asked = [one.drive for one in every if one.day in out and maps.has(one.drive.road_id)]
        for length_m in LENGTHS_M:
            windows = drawn(
                asked, chosen.windows // FOLDS, length_m, HELD_OUT_SEEDS, even=chosen.even
            )
            rows.setdefault(length_m, []).extend(map(maps.answered, windows))
    report("survey passes held out by day", rows)
    if chosen.test:
        maps, tests = Maps(roads, every), load_test_drives(chosen.data)
        report(
            "test passes",
            {
                length_m: list(
                    map(maps.answered, drawn(tests, 300, length_m, TEST_SEEDS, even=chosen.even))
                )
                for length_m in LENGTHS_M
            },
        )


# Road, direction and sub-segment right, error, their posteriors, within each radius, refused, the
# probability of being off the map, and the same without the window's street.
Row = tuple[float, ...]


class Maps:
    """A map, asked with each of its streets and without."""

    def __init__(self, roads: Sequence[Road], used: Sequence[Driven]) -> None:
        models = [
            fit_road(road, [one.drive.trace for one in passes])
            for road in roads
            if (passes := of_road(used, road.road_id))
        ]
        self.index = MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))
        self.number = {model.road_id: number for number, model in enumerate(models)}

    def has(self, road_id: str) -> bool:
        """Whether any of its passes is known."""
        return road_id in self.number

    def answered(self, one: Labelled) -> Row:
        """A window's answer beside its truth."""
        truth = one.truth
        fix, wide = (locate(self.index, one.window, confidence=each) for each in (0.68, 0.95))
        error_m = float(distance_m(fix.lon, fix.lat, truth.lon, truth.lat))
        road = fix.road_id == truth.road_id and not fix.off_map
        segment = road and fix.segment_start_m <= truth.chainage_m <= fix.segment_end_m
        within = [not fix.off_map and error_m <= each.accuracy_m for each in (fix, wide)]
        return (
            road,
            road and fix.direction == truth.direction,
            segment,
            OFF_M if fix.off_map else error_m,
            fix.road_posterior,
            fix.segment_posterior,
            *within,
            fix.off_map,
            fix.off_map_posterior,
            self._strange(one),
        )

    def _strange(self, one: Labelled) -> float:
        """Probability of being off the map, its own street not being on it."""
        query = ask(self.index, one.window, in_c=native.BUILT)
        left_out = self.number[one.truth.road_id]
        others = fine_places(self.index, query, shortlist(self.index, query, without=left_out))
        fit = fit_of_place(self.index, query, others, int(others.score.argmax()))
        calibration = self.index.calibration
        return off_map_probability(calibration, fit, query.information(calibration))


def drawn(
    drives: Sequence[Drive], count: int, length_m: float, seeds: Sequence[int], *, even: bool
) -> Iterator[Labelled]:
    """Windows of each seed: evenly over the way, or as many of every drive that is long enough."""
    long = [one for one in drives if float(one.travelled_m[-1]) > length_m]
    for seed in seeds:
        if not even:
            yield from cut_windows(drives, count, length_m=length_m, seed=seed)
            continue
        for number, drive in enumerate(long):
            each = max(count // len(long), 1)
            yield from cut_windows([drive], each, length_m=length_m, seed=1000 * seed + number)


def report(name: str, rows: dict[float, list[Row]]) -> None:
    """A line of figures for each length, and one of what is off the map for all of them."""
    print(name)
    for length_m, row in rows.items():
        print(f"  {length_m:3.0f} m  {described(np.array(row, dtype=float))}", flush=True)
    *_, here, strange = np.array([one for row in rows.values() for one in row], dtype=float).T
    print(f"  all    AUROC {auroc(strange, here):.3f}")


def described(rows: Float[np.ndarray, "windows 11"]) -> str:
    """A line of figures."""
    road, way, segment, error_m, said, of_segment, in68, in95, refused, here, strange = rows.T
    return (
        f"{len(rows)} windows  road {road.mean():.1%}  median {np.median(error_m):5.2f} m  "
        f"direction {way.mean():.1%}, on the right road {way.sum() / road.sum():.1%}  "
        f"ECE road {calibration_error(curve_of(said, road > 0.0)):.1%}, "
        f"sub-segment {calibration_error(curve_of(of_segment, segment > 0.0)):.1%}  "
        f"68 % radius {in68.mean():.1%}  95 % {in95.mean():.1%}  refused {refused.mean():.1%}  "
        f"AUROC {auroc(strange, here):.3f}, strangers refused {np.mean(strange > 0.5):.1%}"
    )


if __name__ == "__main__":
    main()
