"""
Areas with everything changed at once: `python -m benchmarks.mixed [--areas N] [--first N]`.

The paper's square with cells, passes, noise, steps, sensitivity, sampling, speed, scatter of survey
fixes, device offsets, odometers, drift, shadowing and windows' lengths drawn at random, each area
by its number, so that what is asked is what nobody thought of. Of each area the error, what radii
hold, how right the posteriors of road and sub-segment are, and what was refused; at the end how far
radii are from what they say over all areas.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import RadioMap
from app.evaluation.scenario import build_city, preset, survey, windows
from app.evaluation.scenario.params import Scenario
from app.numerics.calibration import calibrate
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.roadfit import fit_road
from benchmarks.strangers import error_of

FIRST, AREAS, WINDOWS = 100, 48, 150
CONFIDENCES = (0.68, 0.95)
# A tuple's values are equally likely.
DRAWN: dict[str, tuple[float, ...]] = {
    "survey_passes": (1, 1, 2, 3, 4),
    "noise_db": (1.0, 2.0, 3.0, 4.0, 5.0),
    "quantisation_db": (0.0, 1.0, 1.0, 2.0),
    "sensitivity_dbm": (-125.0, -125.0, -115.0, -110.0),
    "speed_mps": (5.0, 8.3, 14.0),
    "survey_position_noise_m": (0.0, 0.0, 2.0, 4.0, 6.0),
    "device_offset_sd_db": (0.0, 0.0, 2.0, 4.0, 6.0),
    "odometer_error_sd": (0.0, 0.0, 0.01, 0.03, 0.05),
    "drift_db": (0.0, 0.0, 1.0, 2.0, 3.0),
    "shadowing_correlation_m": (8.0, 12.0, 20.0, 30.0),
    "shadowing_nlos_db": (4.0, 6.0, 8.0),
}
CELLS = (3, 4, 5, 6)
BY_CLOCK_S, BY_WAY_M = (0.5, 1.0, 2.0), (0.5, 1.0, 2.0, 4.0)
LENGTHS_M = (20.0, 30.0, 50.0, 100.0)
FEWEST_STEPS = 3  # from sample to sample: windows are at least so long
# Error, road and sub-segment right and said, within either radius, refused.
Row = tuple[float, ...]


def main() -> None:
    """Print a line for each area, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--areas", type=int, default=AREAS)
    parser.add_argument("--first", type=int, default=FIRST, help="number of the first area")
    parser.add_argument("--windows", type=int, default=WINDOWS, help="of each area")
    chosen = parser.parse_args()
    held = []
    for number in range(chosen.first, chosen.first + chosen.areas):
        scenario, length_m = area_of(number)
        rows = np.array(answers(scenario, length_m, number, chosen.windows), dtype=float)
        error_m, in68, in95, refused = rows[:, [0, 5, 6, 7]].T
        held.append([in68.mean(), in95.mean(), refused.mean(), np.log(np.median(error_m))])
        print(f"{number:4d}  {described(rows)}  {told(scenario, length_m)}", flush=True)
    in68, in95, refused, log_median = np.array(held).T
    print(
        f"{len(held)} areas: 68 % radii hold {in68.mean():.1%} (rms deviation "
        f"{np.sqrt(np.mean((in68 - 0.68) ** 2)):.1%}), 95 % radii {in95.mean():.1%} "
        f"({np.sqrt(np.mean((in95 - 0.95) ** 2)):.1%}), refused {refused.mean():.2%}, "
        f"median error {np.exp(log_median.mean()):.2f} m (geometric mean)"
    )


def area_of(number: int) -> tuple[Scenario, float]:
    """An area, and how long the windows are that are asked of it."""
    rng = np.random.Generator(np.random.PCG64(number))
    drawn = {name: rng.choice(values).item() for name, values in DRAWN.items()}
    drawn["survey_passes"] = int(drawn["survey_passes"])
    if rng.random() < 0.5:
        drawn["sample_interval_s"] = rng.choice(BY_CLOCK_S).item()
    else:
        drawn["sample_interval_m"] = rng.choice(BY_WAY_M).item()
    length_m, cells = rng.choice(LENGTHS_M).item(), int(rng.choice(CELLS))
    both_directions = bool(rng.random() < 0.7)
    area = replace(preset("paper"), cells=cells, both_directions=both_directions, **drawn)
    return area, max(length_m, FEWEST_STEPS * area.spacing_m)


def answers(scenario: Scenario, length_m: float, seed: int, count: int) -> list[Row]:
    """Each window's answer beside its truth."""
    city = build_city(scenario, seed)
    passes = survey(city)
    models = [
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    index = MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))
    rows: list[Row] = []
    for window, truth in windows(city, count, length_m=length_m):
        fix, wide = (locate(index, window, confidence=each) for each in CONFIDENCES)
        error_m = float(distance_m(fix.lon, fix.lat, truth.lon, truth.lat))
        road = fix.road_id == truth.road_id and not fix.off_map
        segment = road and fix.segment_start_m <= truth.chainage_m <= fix.segment_end_m
        said = (road, fix.road_posterior, segment, fix.segment_posterior)
        held = [not fix.off_map and error_m <= each.accuracy_m for each in (fix, wide)]
        rows.append((error_m, *said, *held, fix.off_map))
    return rows


def described(rows: Float[np.ndarray, "windows figures"]) -> str:
    """A line of figures."""
    error_m, road, said, segment, said_segment, in68, in95, refused = rows.T
    ece, ece_segment = error_of(said, road > 0.0), error_of(said_segment, segment > 0.0)
    return (
        f"MDE {error_m.mean():6.2f} m  median {np.median(error_m):6.2f} m  road {road.mean():.1%}  "
        f"radii hold {in68.mean():.0%}, {in95.mean():.0%}  ECE road {ece:.1%}, sub-segment "
        f"{ece_segment:.1%}  refused {refused.mean():.1%}"
    )


def told(scenario: Scenario, length_m: float) -> str:
    """What is unlike the paper's area."""
    names = (*DRAWN, "sample_interval_s", "sample_interval_m", "both_directions")
    paper = preset("paper")
    changed = {name: getattr(scenario, name) for name in names}
    unlike = [f"{name} {value}" for name, value in changed.items() if value != getattr(paper, name)]
    return ", ".join((f"{length_m:.0f} m windows", f"{scenario.cells} cells", *unlike))


if __name__ == "__main__":
    main()
