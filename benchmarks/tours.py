"""
Tracking round a simulated square: `python -m benchmarks.tours [SCENARIO] [--cells N ...]`.

Vehicles drive five sides of the square, one way and the other, their odometers off as the scenario
has it. Windows lie back to back: of 10 s, or of 30 m where samples do not come by the clock. The
same windows alone and tracked, from each drive's second one on: all of them, those that hold no
corner and come after the first one, and those that hold one.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import Fix, RadioMap
from app.evaluation.experiments.plan import WINDOW_M, WINDOW_S
from app.evaluation.scenario import City, build_city, preset
from app.evaluation.scenario.tours import Leg, Tour, tour_of
from app.numerics import matching, tracking
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.lines import point_at
from benchmarks.bounds import CELLS, by_clock
from benchmarks.strangers import maps_of

FIRST_SEED, SEEDS = 1201, 4  # seeds that nothing was tuned on
DRIVES, SIDES = 12, 5
ROUND = ("road-south", "road-east", "road-north", "road-west")
CONFIDENCES = (0.68, 0.95)

# Of a window alone, then tracked: error, road right, within either radius.
Row = tuple[float, ...]


def main() -> None:
    """Print three lines for each number of cells."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="harsh")
    parser.add_argument("--cells", type=int, nargs="+", default=CELLS)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    chosen = parser.parse_args()
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.seeds)
    print(f"{chosen.scenario}, {DRIVES} drives of {SIDES} sides in each of seeds {list(seeds)}")
    for cells in chosen.cells:
        kinds: dict[str, list[Row]] = {"all": [], "after a corner": [], "round a corner": []}
        for seed in seeds:
            city = build_city(replace(preset(chosen.scenario), cells=cells), seed)
            _, models, calibration = next(maps_of(city))
            index = MapIndex.build(RadioMap(1, tuple(models), calibration))
            for tour in tours(city):
                for turned, turns, row in followed(city, index, tour):
                    kinds["all"].append(row)
                    if turns or turned:
                        kinds["round a corner" if turns else "after a corner"].append(row)
        for kind, rows in kinds.items():
            alone, tracked = described(rows)
            print(f"  {cells} cells, {kind:14s} {len(rows):4d} windows  alone {alone}", flush=True)
            print(f"{'':39s}tracked {tracked}", flush=True)


def tours(city: City) -> Iterator[Tour]:
    """Drives that begin at any corner, one way and the other, each with its odometer."""
    rng = np.random.Generator(np.random.PCG64(city.seed))
    for number in range(DRIVES):
        first, way = int(rng.integers(len(ROUND))), 1 if number % 2 == 0 else -1
        legs = []
        for side in range(SIDES):
            road_id = ROUND[(first + way * side) % len(ROUND)]
            ends_m = (0.0, city.by_id[road_id].length_m)
            legs.append(Leg(road_id, *ends_m[::way]))
        tour = tour_of(city, *legs, number=number * SIDES)
        scale = 1.0 + city.scenario.odometer_error_sd * float(rng.normal())
        yield replace(tour, travelled_m=tour.travelled_m * scale)


def followed(city: City, index: MapIndex, tour: Tour) -> Iterator[tuple[bool, bool, Row]]:
    """Of each window whether a corner lies behind it, whether one lies in it, and its answers."""
    way_m = tour.travelled_m
    length_m = WINDOW_S * city.scenario.speed_mps if by_clock(city.scenario) else WINDOW_M
    kept: tracking.Tracked | None = None
    before = 0
    for end_m in np.arange(length_m, way_m[-1], length_m):
        last = int(np.searchsorted(way_m, end_m, side="right")) - 1
        first = int(np.searchsorted(way_m, way_m[last] - length_m - 1e-9))
        window, since_m = tour.window(first, last), float(way_m[last] - way_m[before])
        tracked = [
            tracking.begin(index, window, confidence=confidence)
            if kept is None
            else tracking.follow(
                index, window, kept.belief, since_m, heard=kept.heard, confidence=confidence
            )
            for confidence in CONFIDENCES
        ]
        begun, kept, before = kept is not None, tracked[0], last
        if begun:
            alone = [matching.locate(index, window, confidence=each) for each in CONFIDENCES]
            fixes = alone, [one.fix for one in tracked]
            row = tuple(value for each in fixes for value in judged(city, tour, last, each))
            yield bool(tour.leg[last] > 0), bool(tour.leg[first] != tour.leg[last]), row


def judged(city: City, tour: Tour, last: int, fixes: Sequence[Fix]) -> Row:
    """Error, road right, and whether each radius holds the truth."""
    leg, fix = tour.legs[tour.leg[last]], fixes[0]
    place = point_at(city.by_id[leg.road_id].line, float(tour.chainage_m[last]))
    error_m = float(distance_m(fix.lon, fix.lat, float(place.lon), float(place.lat)))
    right = fix.road_id == leg.road_id and not fix.off_map
    return error_m, right, *(error_m <= one.accuracy_m for one in fixes)


def described(rows: Sequence[Row]) -> list[str]:
    """Figures alone and tracked."""
    every = np.array(rows, dtype=float)
    return [line(every[:, part]) for part in (slice(0, 4), slice(4, 8))]


def line(row: Float[np.ndarray, "windows 4"]) -> str:
    """A line of figures."""
    error_m, road, *held = row.T
    radii = ", ".join(f"{one.mean():.1%}" for one in held)
    return (
        f"MDE {error_m.mean():6.2f} m  median {np.median(error_m):5.2f} m  road {road.mean():.1%}  "
        f"radii hold {radii}"
    )


if __name__ == "__main__":
    main()
