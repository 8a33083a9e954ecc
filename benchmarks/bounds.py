"""
What bounds the error: `python -m benchmarks.bounds [SCENARIO] [--untold] [--seeds N]`.

The same windows are asked of three maps: the one fitted to the survey; the scenario's own curves as
they were on the survey's day; and those as they are when the vehicles drive, drift included. What
the last one leaves is in the windows: noise, the device's offset, the odometer. Beside them the
best that any method can do with this survey (`app.evaluation.survey_bound`), which takes cells not
heard to say nothing; the same with readings below the sensitivity reported, too, which knows more
than there is to know, so that the truth lies between the two; and the Cramer-Rao bound's mean
error. How often the true place lies within its 68 and 95 % intervals is told as well, and with
`--untold` the same of whoever is not told how far odometers err, as no map is: it takes twice as
long again. Windows of 30 m that end anywhere, or of 10 s where samples come by the clock.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import Calibration, RadioMap, RoadModel
from app.evaluation.bound import MEAN_ABSOLUTE, least_sd_m
from app.evaluation.experiments.plan import WINDOW_M, WINDOW_S
from app.evaluation.scenario import build_city, preset, survey, windows
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.params import Scenario
from app.evaluation.survey_bound import ANY, Odometers, best_answers
from app.evaluation.truth import Labelled
from app.numerics.calibration import calibrate
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.roadfit import fit_road

FIRST_SEED = 301  # seeds that nothing was tuned on
WINDOWS = 250
CELLS = (2, 4, 6)
STEP_M = 0.125  # between places: half of it moves the least mean error of 0.12 m by 1 %
CLOCK_STEP_M = 0.5  # by the clock errors are ten times that: half of it moves none
ALL_HEARD_DBM = -200.0
CONFIDENCES = (0.68, 0.95)
# Error in metres, whether the road is right, and of the best possible answers whether each interval
# holds the truth.
Row = tuple[float | bool, ...]


def main() -> None:
    """Print mean error, median and road right of each map for each number of cells."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="harsh")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--windows", type=int, default=WINDOWS)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--untold", action="store_true", help="and not told of odometers")
    chosen = parser.parse_args()
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.seeds)
    kind = "10 s" if by_clock(preset(chosen.scenario)) else "30 m"
    print(
        f"{chosen.scenario}, windows of {kind} anywhere, "
        f"{chosen.windows} for each of seeds {list(seeds)}"
    )
    for cells in CELLS:
        scenario = replace(preset(chosen.scenario), cells=cells)
        rows: dict[str, list[Row]] = {}
        least_m: list[float] = []
        for seed in seeds:
            city = build_city(scenario, seed)
            asked = asked_of(city, chosen.windows)
            for name, index in maps_of(city, scenario):
                rows.setdefault(name, []).extend(answers(index, asked))
            rows.setdefault("best with this survey", []).extend(best(city, asked))
            if chosen.untold:
                untold = best(city, asked, odometers=ANY)
                rows.setdefault("best, odometers untold", []).extend(untold)
            bare = build_city(replace(scenario, sensitivity_dbm=ALL_HEARD_DBM), seed)
            best_bare = best(bare, asked_of(bare, chosen.windows))
            rows.setdefault("best, were all heard", []).extend(best_bare)
            least_m += [cramer_rao_m(city, one) for one in asked]
        for name, row in rows.items():
            print(f"  {cells} cells, {name:26s} {described(row)}", flush=True)
        print(f"  {cells} cells, {'Cramer-Rao':26s} {len(least_m)} windows  MDE {mean(least_m)} m")


def by_clock(scenario: Scenario) -> bool:
    """Whether samples come by the clock."""
    return scenario.sample_interval_s is not None


def asked_of(city: City, count: int) -> list[Labelled]:
    """The windows of a city."""
    if by_clock(city.scenario):
        return windows(city, count, length_m=None, duration_s=WINDOW_S)
    return windows(city, count, length_m=WINDOW_M)


def best(city: City, asked: Sequence[Labelled], odometers: Odometers | None = None) -> list[Row]:
    """Error and road of the best possible answers, and which of their intervals hold the truth."""
    step_m = CLOCK_STEP_M if by_clock(city.scenario) else STEP_M
    told = [one.window for one in asked]
    found = best_answers(city, told, step_m=step_m, confidences=CONFIDENCES, odometers=odometers)
    rows: list[Row] = []
    for answer, one in zip(found, asked, strict=True):
        truth = one.truth
        right = answer.road_id == truth.road_id
        held = [right and low <= truth.chainage_m <= high for low, high in answer.intervals_m]
        error_m = float(distance_m(answer.lon, answer.lat, truth.lon, truth.lat))
        rows.append((error_m, right, *held))
    return rows


def cramer_rao_m(city: City, one: Labelled) -> float:
    """The bound's mean absolute error for a window, its device's offset unknown."""
    truth = city.by_id[one.truth.road_id]
    behind_m = np.arange(len(one.window.distance_m))[::-1] * city.scenario.spacing_m
    at_m = one.truth.chainage_m - one.truth.direction.sign * behind_m
    return MEAN_ABSOLUTE * least_sd_m(truth, at_m, city.scenario)


def mean(values: Sequence[float]) -> str:
    """Of the finite ones."""
    return f"{np.mean([each for each in values if math.isfinite(each)]):6.3f}"


def maps_of(city: City, scenario: Scenario) -> list[tuple[str, MapIndex]]:
    """The fitted map, and the same roads with the scenario's own curves."""
    passes = survey(city)
    fitted = [
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    known = Calibration(offset_sd_db=max(scenario.device_offset_sd_db, 0.5))
    found = [("fitted to the survey", fitted, calibrate(fitted))]
    found += [(name, models, known) for name, models in of_true_curves(city, fitted)]
    return [
        (name, MapIndex.build(RadioMap(1, tuple(models), calibration)))
        for name, models, calibration in found
    ]


def of_true_curves(city: City, fitted: Sequence[RoadModel]) -> list[tuple[str, list[RoadModel]]]:
    """The roads with the curves of the survey's day, and with those of when vehicles drive."""
    scenario, found = city.scenario, []
    for name, drifted, unknown_db in (
        ("true on the survey's day", False, scenario.drift_db),
        ("true when driving", True, 0.0),
    ):
        noise_db = math.hypot(scenario.noise_db, unknown_db)
        models = [
            told_the_truth(model, truth, scenario, drifted=drifted, spread_db=noise_db)
            for model, truth in zip(fitted, city.roads, strict=True)
        ]
        found.append((name, models))
    return found


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


def answers(index: MapIndex, asked: Sequence[Labelled]) -> list[Row]:
    """Error in metres, and whether the road is right, of each window."""
    found: list[Row] = []
    for one in asked:
        fix = locate_exhaustively(index, one.window)
        error_m = float(distance_m(fix.lon, fix.lat, one.truth.lon, one.truth.lat))
        found.append((error_m, fix.road_id == one.truth.road_id))
    return found


def described(rows: Sequence[Row]) -> str:
    """A line of figures."""
    error_m, road, *held = np.array(rows, dtype=float).T
    within = "".join(
        f"  {confidence:.0%} interval holds {each.mean():.1%}"
        for confidence, each in zip(CONFIDENCES, held, strict=False)
    )
    return (
        f"{len(rows)} windows  MDE {error_m.mean():6.3f} m  median {np.median(error_m):6.3f} m  "
        f"road {road.mean():.1%}{within}"
    )


if __name__ == "__main__":
    main()
