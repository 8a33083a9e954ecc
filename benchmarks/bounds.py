"""
What a perfect survey would be worth: `python -m benchmarks.bounds [SCENARIO] [--seeds N]`.

The same windows are asked of three maps: the one fitted to the survey; the scenario's own curves as
they were on the survey's day; and those as they are when the vehicles drive, drift included. What
the last one leaves is in the windows: noise, the device's offset, the odometer. No survey, and no
way of fitting one, can do better with this likelihood.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import Calibration, RadioMap, RoadModel
from app.evaluation.scenario import build_city, preset, survey, windows
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.params import Scenario
from app.evaluation.truth import Labelled
from app.numerics.calibration import calibrate
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.roadfit import fit_road

FIRST_SEED = 301  # seeds that nothing was tuned on
WINDOWS = 250
CELLS = (2, 4, 6)


def main() -> None:
    """Print mean error, median and road right of each map for each number of cells."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="harsh")
    parser.add_argument("--seeds", type=int, default=4)
    chosen = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + chosen.seeds)
    print(f"{chosen.scenario}, windows of 10 s anywhere, {WINDOWS} for each of seeds {list(seeds)}")
    for cells in CELLS:
        scenario = replace(preset(chosen.scenario), cells=cells)
        rows: dict[str, list[tuple[float, bool]]] = {}
        for seed in seeds:
            city = build_city(scenario, seed)
            asked = windows(city, WINDOWS, length_m=None, duration_s=10.0)
            for name, index in maps_of(city, scenario):
                rows.setdefault(name, []).extend(answers(index, asked))
        for name, row in rows.items():
            print(f"  {cells} cells, {name:26s} {described(row)}", flush=True)


def maps_of(city: City, scenario: Scenario) -> list[tuple[str, MapIndex]]:
    """The fitted map, and the same roads with the scenario's own curves."""
    passes = survey(city)
    fitted = [
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    found = [("fitted to the survey", fitted, calibrate(fitted))]
    known = Calibration(offset_sd_db=max(scenario.device_offset_sd_db, 0.5))
    for name, drifted, unknown_db in (
        ("true on the survey's day", False, scenario.drift_db),
        ("true when driving", True, 0.0),
    ):
        noise_db = math.hypot(scenario.noise_db, unknown_db)
        models = [
            told_the_truth(model, truth, scenario, drifted=drifted, spread_db=noise_db)
            for model, truth in zip(fitted, city.roads, strict=True)
        ]
        found.append((name, models, known))
    return [
        (name, MapIndex.build(RadioMap(1, tuple(models), calibration)))
        for name, models, calibration in found
    ]


def told_the_truth(
    model: RoadModel, truth: RoadTruth, scenario: Scenario, *, drifted: bool, spread_db: float
) -> RoadModel:
    """The model with the scenario's curves, noise and hearing in place of its own."""
    grid_m = np.minimum(np.arange(len(model.mean_dbm)) * model.step_m, truth.length_m)
    columns = [truth.cells.index(cell) for cell in model.cells]
    mean_dbm = truth.mean_dbm(grid_m, drifted=drifted)[:, columns]
    heard = normal((mean_dbm - scenario.sensitivity_dbm) / max(scenario.noise_db, 0.1))
    return replace(
        model,
        mean_dbm=mean_dbm.astype(np.float32),
        spread_db=np.full(mean_dbm.shape, spread_db, dtype=np.float32),
        heard=heard.astype(np.float32),
    )


def normal(z: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Distribution function of the standard normal."""
    return np.asarray(0.5 * (1.0 + np.vectorize(math.erf)(z / math.sqrt(2.0))))


def answers(index: MapIndex, asked: Sequence[Labelled]) -> list[tuple[float, bool]]:
    """Error in metres, and whether the road is right, of each window."""
    found = []
    for one in asked:
        fix = locate_exhaustively(index, one.window)
        error_m = float(distance_m(fix.lon, fix.lat, one.truth.lon, one.truth.lat))
        found.append((error_m, fix.road_id == one.truth.road_id))
    return found


def described(row: Sequence[tuple[float, bool]]) -> str:
    """A line of figures."""
    error_m, road = np.array(row, dtype=float).T
    return (
        f"{len(row)} windows  MDE {error_m.mean():6.2f} m  median {np.median(error_m):5.2f} m  "
        f"road {road.mean():.1%}"
    )


if __name__ == "__main__":
    main()
