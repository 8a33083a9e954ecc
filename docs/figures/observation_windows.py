"""Held-out windows asked for everywhere: the information that they hold, and what was tried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from unittest.mock import patch

import numpy as np
from observation_data import FOLDS, Driven, heard_near, lay_all, others

from app.domain import Calibration, Direction, RadioMap, Road, RoadModel, Trace
from app.evaluation.passes import cut_windows, drive_of
from app.evaluation.truth import Labelled
from app.numerics import observation
from app.numerics.alignment import align
from app.numerics.geodesy import Floats, distance_m
from app.numerics.index import MapIndex
from app.numerics.lines import point_at, project
from app.numerics.offsets import OffsetPrior
from app.numerics.posterior import Places, masses
from app.numerics.query import Query, ask
from app.numerics.tapes import BOTH
from app.numerics.trials import with_offset

SEED = 3
LENGTHS_M = (0.0, 25.0, 50.0, 100.0, 200.0, 400.0)
TEMPERATURES = np.geomspace(0.5, 45.0, 20)
NEAR_TRUTH_M = 20.0
SMALLEST = 1e-6  # one window in the wrong place must not decide alone
OFFSET_SD_DB = 1.0
TRIED_LENGTH_M = 200.0
TYPICAL_TEMPERATURE = 8.0  # of such windows: the best place depends on it a little
ONCE = np.linspace(0.0, 1.5, 16)
EACH = np.geomspace(0.01, 1.0, 41)

Maps = Sequence[dict[str, RoadModel]]


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """
    What windows of one length were answered, all roads aligned metre by metre.

    Attributes:
        log_truth: Log posterior within `NEAR_TRUTH_M` of the truth in the true direction, shape
            ``(windows, temperatures)``.
        weight, samples: Of each window.
        error_m, right: Distance of the best place from the truth, and whether it is the road's.
    """

    log_truth: Floats
    weight: Floats
    samples: Floats
    error_m: Floats
    right: Floats


def windows(
    roads: dict[str, Road], driven: Sequence[Driven], length_m: float, count: int
) -> list[tuple[int, Labelled]]:
    """Windows that end anywhere on the passes of each fold, as many of every fold."""
    found = []
    for fold in range(FOLDS):
        drives = []
        for one in driven:
            line = roads[one.road_id].line
            if one.fold == fold and line is not None:
                chainage_m = project(line, one.trace.lon, one.trace.lat).chainage_m
                ahead = chainage_m[-1] >= chainage_m[0]
                way = Direction.FORWARD if ahead else Direction.BACKWARD
                drives.append(drive_of(one.trace, one.road_id, line, way))
        cut = cut_windows(drives, count // FOLDS, length_m=length_m, seed=SEED + fold)
        found += [(fold, one) for one in cut]
    return found


def indices(maps: Maps) -> list[MapIndex]:
    """Of each fold, its map in memory."""
    told = Calibration(offset_sd_db=OFFSET_SD_DB)
    return [MapIndex.build(RadioMap(0, tuple(models.values()), told)) for models in maps]


def ask_all(maps: Sequence[MapIndex], asked: Sequence[tuple[int, Labelled]]) -> Answers:
    """Each window in the map that has not seen its day."""
    rows = [_ask(maps[fold], one) for fold, one in asked]
    return Answers(
        np.array([row[0] for row in rows]), *(np.array([r[i] for r in rows]) for i in range(1, 5))
    )


def _ask(index: MapIndex, one: Labelled) -> tuple[list[float], float, int, float, bool]:
    query, truth = ask(index, one.window), one.truth
    places = _not_offset(index, query)
    warm = with_offset(places, index.offset_prior.at(TYPICAL_TEMPERATURE))
    best = int(warm.score.argmax())
    name = index.road_ids[places.road[best]]
    place = point_at(index.lines[places.road[best]], float(places.chainage_m[best]))
    error_m = float(distance_m(place.lon, place.lat, truth.lon, truth.lat))
    near = np.abs(places.chainage_m - truth.chainage_m) <= NEAR_TRUTH_M
    near &= (places.road == index.road_ids.index(truth.road_id)) & (
        places.sign == truth.direction.sign
    )
    mass = [
        float(masses(with_offset(places, index.offset_prior.at(t)), t)[near].sum())
        for t in TEMPERATURES.tolist()
    ]
    logs = [float(np.log(max(each, SMALLEST))) for each in mass]
    return logs, query.weight, len(query.fine.weight), error_m, name == truth.road_id


def _not_offset(index: MapIndex, query: Query) -> Places:
    """Every metre of every road both ways, the sums of each carrier instead of offsets' gain."""
    parts = []
    for number, road in enumerate(index.roads):
        aim, last = query.aim_at(index, number), road.grid_size
        for sign in BOTH:
            sums = align(road.along, aim, 1, last, sign)
            metres = np.stack([np.arange(last) * road.step_m, np.full(last, road.step_m)])
            where = np.full((2, last), ((number,), (sign,)))
            parts.append(Places(where, np.concatenate([metres, sums])))
    return Places.join(parts)


def information(answers: Sequence[Answers]) -> tuple[dict[str, float], dict[str, list[float]]]:
    """
    What a window's information is modelled as, chosen by the mean log posterior of the truths.

    Returns:
        The parameters, and of each model the mean log posterior at every length: one temperature
        for all, information per weight alone, once and per weight, and each length's own best.
    """
    weights = [np.maximum(one.weight, 1e-3) for one in answers]

    def logs(temperatures: Sequence[Floats]) -> list[float]:
        return [_mean_at(one, t) for one, t in zip(answers, temperatures, strict=True)]

    def modelled(once: float, each: float) -> list[float]:
        return logs(
            [
                w / np.minimum(once + each * w, one.samples)
                for one, w in zip(answers, weights, strict=True)
            ]
        )

    single = max(TEMPERATURES, key=lambda t: sum(logs([np.full_like(w, t) for w in weights])))
    once, each = max(product(ONCE, EACH), key=lambda pair: sum(modelled(*pair)))
    models = {
        "scores as they are": logs([np.ones_like(w) for w in weights]),
        "one temperature": logs([np.full_like(w, single) for w in weights]),
        "once and each": modelled(float(once), float(each)),
        "each length's own": [float(one.log_truth.mean(axis=0).max()) for one in answers],
    }
    told = {"once": float(once), "each": float(each), "one_temperature": float(single)}
    return told, models


def _mean_at(one: Answers, temperature: Floats) -> float:
    at = np.interp(np.log(temperature), np.log(TEMPERATURES), np.arange(len(TEMPERATURES)))
    low = np.minimum(at.astype(int), len(TEMPERATURES) - 2)
    rows, share = np.arange(len(at)), at - low
    logs = one.log_truth[rows, low] * (1.0 - share) + one.log_truth[rows, low + 1] * share
    return float(logs.mean())


def tried(
    roads: dict[str, Road], driven: Sequence[Driven], maps: Maps, count: int
) -> list[dict[str, float | str]]:
    """The same windows under other offsets, spreads and weights of hearing."""
    asked = windows(roads, driven, TRIED_LENGTH_M, count)
    usual = indices(maps)
    found = [_row("as it is", ask_all(usual, asked))]
    with patch.object(OffsetPrior, "at", lambda self, _: self):
        found.append(_row("the whole integral divided", ask_all(usual, asked)))
    for carrier_db in (0.0, 1.0, 3.0):
        other = [_of_carriers(index, carrier_db) for index in usual]
        found.append(_row(f"offsets of carriers {carrier_db}", ask_all(other, asked)))
    for scale in (0.8, 1.3):
        varied = [{k: _scaled(m, scale) for k, m in models.items()} for models in maps]
        found.append(_row(f"spread times {scale}", ask_all(indices(varied), asked)))
    varied = [
        {k: _doubted(m, others(driven, k, fold), 9.0) for k, m in models.items()}
        for fold, models in enumerate(maps)
    ]
    found.append(_row("variance + 9 dB^2 / passes", ask_all(indices(varied), asked)))
    for weight in (0.0, 0.3, 0.6, 1.0):
        with _hearing(weight):
            found.append(_row(f"hearing {weight}", ask_all(usual, asked)))
    return found


def _row(name: str, answers: Answers) -> dict[str, float | str]:
    mean_log = answers.log_truth.mean(axis=0)
    return {
        "name": name,
        "windows": len(answers.right),
        "road_right": float(answers.right.mean()),
        "median_m": float(np.median(answers.error_m)),
        "p90_m": float(np.percentile(answers.error_m, 90)),
        "log_truth": float(mean_log.max()),
        "temperature": float(TEMPERATURES[mean_log.argmax()]),
    }


def _of_carriers(index: MapIndex, sd_db: float) -> MapIndex:
    other = index.recalibrated(index.calibration)
    other.offset_prior = replace(index.offset_prior, group_db2=sd_db**2)
    return other


def _scaled(model: RoadModel, scale: float) -> RoadModel:
    return replace(model, spread_db=model.spread_db * np.float32(scale))


def _doubted(model: RoadModel, passes: Sequence[Trace], variance_db2: float) -> RoadModel:
    """Spreads that grow where few passes heard the cell, as the residuals do."""
    heard, _ = heard_near(model, lay_all(model, passes))
    count = np.maximum(heard.sum(axis=0), 0.5)
    spread_db = np.sqrt(model.spread_db**2 + variance_db2 / count)
    return replace(model, spread_db=spread_db.astype(np.float32))


@contextmanager
def _hearing(weight: float) -> Iterator[None]:
    """Another weight of hearing; the constants are read when a window is scored."""
    with patch.object(observation, "HEARING_WEIGHT", weight):
        yield
