"""
What radii lack: `python -m benchmarks.told [SCENARIO] [--seeds N] [--windows N]`.

No survey tells whether the vehicles' odometers err, nor whether cells will have changed by the time
they drive: a map has priors of both. The same windows are asked of the fitted map as they are; each
saying how far its distances err (`distance_error`); and of the map told, too, whether cells have
changed. What the radius then holds, and how right road and sub-segment are said, is the model's
own; what they were before is the priors'. Windows of 10 s, or of 30 m where samples do not come by
the clock.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import RadioMap, Window
from app.evaluation.scenario import build_city, preset, survey
from app.evaluation.scenario.city import City
from app.evaluation.truth import Labelled
from app.numerics.calibration import calibrate
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.reliability import calibration_error, curve_of
from app.numerics.roadfit import fit_road
from benchmarks.bounds import CELLS, asked_of

FIRST_SEED = 1001  # seeds that nothing was tuned on
SEEDS, WINDOWS = 6, 170
CONFIDENCES = (0.68, 0.95)
NEVER = 1e-12


def main() -> None:
    """Print a line for each number of cells and each thing told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="harsh")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--windows", type=int, default=WINDOWS, help="of each seed")
    chosen = parser.parse_args()
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.seeds)
    print(f"{chosen.scenario}, {chosen.windows} windows of each of seeds {list(seeds)}")
    for cells in CELLS:
        scenario = replace(preset(chosen.scenario), cells=cells)
        rows: dict[str, list[list[float]]] = {}
        for seed in seeds:
            city = build_city(scenario, seed)
            asked = asked_of(city, chosen.windows)
            for name, index, error in told(city):
                rows.setdefault(name, []).extend(answers(index, asked, error))
        for name, row in rows.items():
            each_m = np.array(row)[:, 0].reshape(len(seeds), -1).mean(axis=1)
            print(
                f"  {cells} cells, {name:24s} {described(np.array(row))}  "
                f"median of seeds' MDE {np.median(each_m):.3f} m",
                flush=True,
            )


def told(city: City) -> Iterator[tuple[str, MapIndex, float | None]]:
    """The map, and what each window says of its distances."""
    passes, scenario = survey(city), city.scenario
    models = [
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    index = MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))
    yield "nothing told", index, None
    yield "odometers", index, scenario.odometer_error_sd
    changed = MapIndex.build(RadioMap(1, tuple(models), index.calibration))
    apart = 1.0 if scenario.drift_db > 0.0 else NEVER
    changed.offset_prior = changed.offset_prior._replace(apart=apart)
    yield "odometers and changes", changed, scenario.odometer_error_sd


def answers(
    index: MapIndex, asked: Sequence[Labelled], error: float | None
) -> Iterator[list[float]]:
    """
    Error, whether it was refused, whether each radius holds, and of road and sub-segment the
    posterior and whether it is right, of each window.
    """
    for one in asked:
        window: Window = replace(one.window, distance_error=error)
        fixes = [locate(index, window, confidence=each) for each in CONFIDENCES]
        error_m = float(distance_m(fixes[0].lon, fixes[0].lat, one.truth.lon, one.truth.lat))
        held = [not fix.off_map and error_m <= fix.accuracy_m for fix in fixes]
        fix = fixes[0]
        road = not fix.off_map and fix.road_id == one.truth.road_id
        segment = road and fix.segment_start_m <= one.truth.chainage_m <= fix.segment_end_m
        said = [fix.road_posterior, road, fix.segment_posterior, segment]
        yield [error_m, fix.off_map, *held, *said]


def described(rows: Float[np.ndarray, "windows 8"]) -> str:
    """A line of figures; refused windows are held by no radius."""
    error_m, refused, *held, road_said, road, segment_said, segment = rows.T
    right = [
        calibration_error(curve_of(said, came > 0.0))
        for said, came in ((road_said, road), (segment_said, segment))
    ]
    radii = ", ".join(f"{c:.0%} {h.mean():.1%}" for c, h in zip(CONFIDENCES, held, strict=True))
    return (
        f"{len(rows)} windows  MDE {error_m.mean():6.3f} m  median {np.median(error_m):6.3f} m  "
        f"refused {refused.mean():.1%}  radii hold {radii}  "
        f"road {road.mean():.1%}  ECE road {right[0]:.1%}, sub-segment {right[1]:.1%}"
    )


if __name__ == "__main__":
    main()
