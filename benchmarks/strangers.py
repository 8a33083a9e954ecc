"""
How well a window off the map is told: `python -m benchmarks.strangers [SCENARIO] [--cells N]`.

The same windows are asked of a map, and of the map without their road; and windows of another city
of the same roads and cell names, whose shadowing alone is another, are asked of the whole map. That
is done with the map fitted to the survey and, to see what a survey could tell at best, with the
scenario's own curves as they were on the survey's day and as they are when the vehicles drive.
Beside them the AUROC of the best possible rule, which is told the law that the city was drawn from.
Then how right the posterior of the road is: over windows on the map alone, and where as many are
off it as the prior has it. Windows of 10 s, or of 30 m where samples do not come by the clock.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from app.domain import Calibration, RadioMap, RoadModel
from app.evaluation.scenario import build_city, preset, survey
from app.evaluation.scenario.city import City
from app.evaluation.survey_bound import on_map_log
from app.evaluation.truth import Labelled
from app.numerics.calibration import INFORMATION_EACH, calibrate
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.offmap import OFF_MAP_PRIOR
from app.numerics.reliability import auroc, calibration_error, curve_of
from app.numerics.roadfit import fit_road
from benchmarks.bounds import asked_of, of_true_curves

FIRST_SEED = 701  # seeds that nothing was tuned on
SEEDS, WINDOWS = 6, 100
ANOTHER = 100  # seeds on: the other city
KNOWN = max(INFORMATION_EACH)  # where curves are true every sample counts

# Whether the window is on the map, the posterior of the road, whether that is the true one and the
# window on the map, and the posterior of being off the map.
Row = tuple[bool, float, bool, float]
Odds = Float[np.ndarray, " windows"]


def main() -> None:
    """Print a line for each map."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="harsh")
    parser.add_argument("--cells", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--windows", type=int, default=WINDOWS, help="of each seed")
    chosen = parser.parse_args()
    scenario = replace(preset(chosen.scenario), cells=chosen.cells)
    rows: dict[str, list[Row]] = {}
    others: dict[str, list[float]] = {}
    best: list[tuple[Odds, Odds, Odds]] = []
    for seed in range(FIRST_SEED, FIRST_SEED + chosen.seeds):
        city = build_city(scenario, seed)
        asked = asked_of(city, chosen.windows)
        foreign = asked_of(build_city(scenario, seed + ANOTHER), chosen.windows)
        best.append((*best_rule(city, asked), best_rule(city, foreign)[0]))
        for name, models, calibration in maps_of(city):
            rows.setdefault(name, []).extend(answers(models, calibration, asked))
            others.setdefault(name, []).extend(answers_abroad(models, calibration, foreign))
    print(f"{scenario.name}, {scenario.cells} cells, seeds from {FIRST_SEED} on")
    for name, row in rows.items():
        print(f"  {name:24s} {described(row, others[name])}")
    here, without, abroad = (np.concatenate(each) for each in zip(*best, strict=True))
    print(
        f"  {'best with this survey':24s} {len(here)} windows  AUROC {auroc(-without, -here):.3f}, "
        f"of another city {auroc(-abroad, -here):.3f}"
    )


def best_rule(city: City, asked: Sequence[Labelled]) -> tuple[Odds, Odds]:
    """Log odds of whoever knows the law, in the whole map and without each window's road."""
    road_ids = [one.truth.road_id for one in asked]
    return on_map_log(city, [one.window for one in asked], road_ids)


def maps_of(city: City) -> Iterator[tuple[str, list[RoadModel], Calibration]]:
    """The fitted map, and the same roads with the scenario's own curves."""
    passes = survey(city)
    fitted = [
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    learnt = calibrate(fitted)
    yield "fitted to the survey", fitted, learnt
    known = replace(
        learnt,
        information_once=0.0,
        information_each=KNOWN,
        offset_sd_db=max(city.scenario.device_offset_sd_db, 0.5),
    )
    for name, models in of_true_curves(city, fitted):
        yield name, models, known


def answers(
    models: Sequence[RoadModel], calibration: Calibration, asked: Sequence[Labelled]
) -> Iterator[Row]:
    """Every window on the map, and on the map without its road."""
    whole = MapIndex.build(RadioMap(1, tuple(models), calibration))
    without = {
        left_out.road_id: MapIndex.build(
            RadioMap(1, tuple(one for one in models if one is not left_out), calibration)
        )
        for left_out in models
    }
    for one in asked:
        for on_map, index in ((True, whole), (False, without[one.truth.road_id])):
            fix = locate(index, one.window)
            right = on_map and fix.road_id == one.truth.road_id and not fix.off_map
            yield on_map, fix.road_posterior, right, fix.off_map_posterior


def answers_abroad(
    models: Sequence[RoadModel], calibration: Calibration, foreign: Sequence[Labelled]
) -> Iterator[float]:
    """Probability of being off the map of windows from a city that hears the same cell names."""
    index = MapIndex.build(RadioMap(1, tuple(models), calibration))
    for one in foreign:
        yield locate(index, one.window).off_map_posterior


def described(rows: Sequence[Row], others: Sequence[float]) -> str:
    """A line of figures."""
    on_map, posterior, right, off_map = np.array(rows, dtype=float).T
    on = on_map > 0.0
    often = np.where(on, round((1.0 - OFF_MAP_PRIOR) / OFF_MAP_PRIOR), 1)
    alone = error_of(posterior[on], right[on] > 0.0)
    mixed = error_of(posterior.repeat(often), right.repeat(often) > 0.0)
    abroad = np.array(others)
    return (
        f"{on.sum()} windows  AUROC {auroc(off_map[~on], off_map[on]):.3f}, "
        f"of another city {auroc(abroad, off_map[on]):.3f}  "
        f"refused {np.mean(off_map[on] > 0.5):.1%}, strangers {np.mean(off_map[~on] > 0.5):.1%}, "
        f"of another city {np.mean(abroad > 0.5):.1%}  "
        f"ECE of the road {alone:.1%}, {OFF_MAP_PRIOR:.0%} of windows off the map {mixed:.1%}"
    )


def error_of(
    posterior: Float[np.ndarray, " windows"], right: Bool[np.ndarray, " windows"]
) -> float:
    """Expected calibration error."""
    return calibration_error(curve_of(posterior, right))


if __name__ == "__main__":
    main()
