"""
Areas that nothing was chosen on: `python -m benchmarks.impairments [WORD ...] [--seeds N]`.

The presets with one thing changed each: more drift, unlike devices, noise, odometers, fixes,
coarser levels, other clocks; and the presets asked by phones unlike the surveys', noisier ones or
such as write down levels that no antenna sent. Of each the road right, errors, how right the
posteriors of road and sub-segment are, what radii hold, windows refused, and the AUROC of windows
off the map: without their road, and of another city that has the same cell names. Words choose
areas by their names.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import RadioMap
from app.evaluation.scenario import build_city, preset
from app.evaluation.scenario.city import City
from app.evaluation.scenario.params import Scenario
from app.evaluation.truth import Labelled
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.reliability import auroc
from benchmarks.bounds import asked_of
from benchmarks.strangers import error_of, maps_of

FIRST_SEED, SEEDS, WINDOWS = 621, 4, 100
ANOTHER = 1000  # seeds on: the other city
HARSH, PAPER = replace(preset("harsh"), cells=4), replace(preset("paper"), cells=4)
AREAS: dict[str, Scenario] = {
    "harsh, three cells": replace(HARSH, cells=3),
    "harsh, drift of 4 dB": replace(HARSH, drift_db=4.0),
    "harsh, offsets of 8 dB": replace(HARSH, device_offset_sd_db=8.0),
    "harsh, noise of 5 dB": replace(HARSH, noise_db=5.0),
    "harsh, odometers 6 % off": replace(HARSH, odometer_error_sd=0.06),
    "harsh, one pass": replace(HARSH, survey_passes=1),
    "harsh, fixes 8 m off": replace(HARSH, survey_position_noise_m=8.0),
    "harsh, shadowing over 40 m": replace(HARSH, shadowing_correlation_m=40.0),
    "harsh, five samples a second": replace(HARSH, sample_interval_s=0.2),
    "harsh, steps of 3 dB": replace(HARSH, quantisation_db=3.0),
    "paper, drift of 2 dB": replace(PAPER, cells=3, drift_db=2.0),
    "paper, offsets of 5 dB": replace(PAPER, device_offset_sd_db=5.0),
    "paper, a sample each 5 m": replace(PAPER, sample_interval_m=5.0),
    "paper, deaf below -105 dBm": replace(PAPER, sensitivity_dbm=-105.0),
    "paper, noise of 4 dB": replace(PAPER, noise_db=4.0),
    "paper, one way": replace(PAPER, cells=5, both_directions=False),
}

# What phones make of a window's levels, area by area.
Spoil = Callable[[np.random.Generator, Float[np.ndarray, "samples cells"]], np.ndarray]


def noisier(sd_db: float) -> Spoil:
    """Noise on top of the surveys' phones'."""
    return lambda rng, rsrp_dbm: rsrp_dbm + rng.normal(0.0, sd_db, rsrp_dbm.shape)


def wild(share: float) -> Spoil:
    """Readings that are any level from -125 to -65 dBm."""
    return lambda rng, rsrp_dbm: np.where(
        (rng.random(rsrp_dbm.shape) < share) & ~np.isnan(rsrp_dbm),
        rng.uniform(-125.0, -65.0, rsrp_dbm.shape),
        rsrp_dbm,
    )


PHONES: dict[str, tuple[Scenario, Spoil]] = {
    f"{area.name}, {name}": (area, spoil)
    for area in (HARSH, PAPER)
    for name, spoil in (
        ("phones 3 dB noisier", noisier(3.0)),
        ("one reading of a hundred wild", wild(0.01)),
        ("three of a hundred wild", wild(0.03)),
    )
}

# Road and sub-segment right, error, their posteriors, within either radius, refused, and the
# probability of being off the map with the window's road and without.
Row = tuple[float, ...]


def main() -> None:
    """Print a line for each area."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", help="of the areas' names; without, all are asked")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--windows", type=int, default=WINDOWS, help="of each seed")
    chosen = parser.parse_args()
    print(f"four cells but where it is said, {chosen.seeds} seeds from {FIRST_SEED} on")
    areas = {name: (scenario, as_it_is) for name, scenario in AREAS.items()} | PHONES
    for name, (scenario, spoil) in areas.items():
        if chosen.words and not any(word in name for word in chosen.words):
            continue
        rows: list[Row] = []
        abroad: list[float] = []
        for seed in range(FIRST_SEED, FIRST_SEED + chosen.seeds):
            city = build_city(scenario, seed)
            foreign = spoilt(build_city(scenario, seed + ANOTHER), chosen.windows, spoil)
            _, models, calibration = next(maps_of(city))
            whole = MapIndex.build(RadioMap(1, tuple(models), calibration))
            without = {
                left_out.road_id: MapIndex.build(
                    RadioMap(1, tuple(one for one in models if one is not left_out), calibration)
                )
                for left_out in models
            }
            rows += answers(whole, without, spoilt(city, chosen.windows, spoil))
            abroad += [locate(whole, one.window).off_map_posterior for one in foreign]
        print(f"  {name:38s} {described(rows, abroad)}", flush=True)


def as_it_is(_: np.random.Generator, rsrp_dbm: Float[np.ndarray, "samples cells"]) -> np.ndarray:
    """A phone like the surveys'."""
    return rsrp_dbm


def spoilt(city: City, count: int, spoil: Spoil) -> list[Labelled]:
    """A city's windows as other phones hear them."""
    rng, windows = np.random.Generator(np.random.PCG64(city.seed)), []
    for one in asked_of(city, count):
        rsrp_dbm = spoil(rng, one.window.rsrp_dbm)
        windows.append(one._replace(window=replace(one.window, rsrp_dbm=rsrp_dbm)))
    return windows


def answers(
    whole: MapIndex, without: dict[str, MapIndex], asked: Sequence[Labelled]
) -> Iterator[Row]:
    """Each window's answer beside its truth."""
    for one in asked:
        truth = one.truth
        fix, wide = (locate(whole, one.window, confidence=each) for each in (0.68, 0.95))
        error_m = float(distance_m(fix.lon, fix.lat, truth.lon, truth.lat))
        road = fix.road_id == truth.road_id and not fix.off_map
        segment = road and fix.segment_start_m <= truth.chainage_m <= fix.segment_end_m
        within = [error_m <= each.accuracy_m for each in (fix, wide)]
        strange = locate(without[truth.road_id], one.window).off_map_posterior
        posterior = (fix.road_posterior, fix.segment_posterior)
        yield (
            road,
            segment,
            error_m,
            *posterior,
            *within,
            fix.off_map,
            fix.off_map_posterior,
            strange,
        )


def described(rows: Sequence[Row], abroad: Sequence[float]) -> str:
    """A line of figures."""
    road, segment, error_m, said, said_segment, in68, in95, refused, off_map, strange = np.array(
        rows, dtype=float
    ).T
    return (
        f"{len(rows)} windows  road {road.mean():.1%}  MDE {error_m.mean():.2f} m  "
        f"median {np.median(error_m):.2f} m  ECE road {error_of(said, road > 0.0):.1%}, "
        f"sub-segment {error_of(said_segment, segment > 0.0):.1%}  radii hold {in68.mean():.1%}, "
        f"{in95.mean():.1%}  refused {refused.mean():.1%}  AUROC {auroc(strange, off_map):.3f}, "
        f"of another city {auroc(np.array(abroad), off_map):.3f}"
    )


if __name__ == "__main__":
    main()
