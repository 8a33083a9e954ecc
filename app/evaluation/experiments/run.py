"""One job: build the city, fit all methods, ask every window of every case, interleaved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from app.domain import Fix, Trace, Window
from app.evaluation.bound import least_sd_m
from app.evaluation.experiments.plan import Case, Job, Setting
from app.evaluation.methods import METHODS, Confident, Estimate, Model, Place, Previous, Survey
from app.evaluation.methods.exhaustive import ExhaustiveModel
from app.evaluation.passes import Drive
from app.evaluation.protocols import WINDOWS_A_DRIVE, Asked, tour
from app.evaluation.realdata import RealData, load
from app.evaluation.scenario import City, build_city, city_drives, survey
from app.numerics.corners import LEAST_M
from app.numerics.geodesy import LocalFrame, distance_m

RECALL_WINDOWS = 100  # of long windows: with every corner the definition takes a second and more

Clock = Callable[[], float]
"""Seconds from any origin; only differences count."""


@dataclass(slots=True)
class Outcome:
    """Rows of fixes, what each method chose and took to learn, and how long all of it took."""

    took_s: float = 0.0
    rows: list[dict[str, Any]] = field(default_factory=list)
    methods: dict[str, dict[str, Any]] = field(default_factory=dict)


def run_job(job: Job, clock: Clock) -> Outcome:
    """
    Everything under one setting; nothing but the delays depends on the machine.

    Args:
        clock: What measures the delays.
    """
    setting = job.setting
    started_s = clock()
    world = _world(setting)
    outcome = Outcome()
    models: dict[str, Model] = {}
    for name in setting.methods:
        began_s = clock()
        models[name] = METHODS[name].fit(world.survey, setting.seed)
        chosen = getattr(models[name], "parameters", None)
        outcome.methods[name] = {
            "fit_s": clock() - began_s,
            "parameters": None if chosen is None else repr(chosen),
        }
    for case in job.cases:
        asked = world.ask(case, setting)
        outcome.rows += _ask_all(job, case, models, asked, world.city, clock)
    outcome.took_s = clock() - started_s
    return outcome


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What is learnt from, and where windows come from."""

    survey: Survey
    city: City | None
    tests: tuple[Drive, ...]

    def ask(self, case: Case, setting: Setting) -> list[Asked]:
        """The windows of a case, the same for every method."""
        drives: Iterator[Drive] = iter(self.tests) if self.city is None else city_drives(self.city)
        each = WINDOWS_A_DRIVE
        if self.city is None:
            long = [one for one in self.tests if one.travelled_m[-1] >= case.window_m]
            drives, each = iter(long), max(1, -(-setting.windows // max(len(long), 1)))
        found = tour(
            drives,
            setting.windows,
            protocol=case.protocol,
            length_m=case.window_m,
            seed=setting.seed,
            each=each,
        )
        return list(islice(found, setting.windows))


def _world(setting: Setting) -> World:
    if setting.scenario is None:
        data = _load(str(setting.data))
        learn = Survey(data.roads, data.survey, setting.grid_m, setting.tuned_m)
        return World(learn, None, data.tests)
    city = build_city(setting.scenario, setting.seed)
    stride = max(1, round(setting.grid_m / setting.scenario.spacing_m))
    traces = tuple(_thinned(trace, stride) for trace in survey(city))
    roads = tuple(truth.road for truth in city.roads)
    grid_m = max(setting.grid_m, setting.scenario.spacing_m / setting.scenario.survey_passes)
    learn = Survey(roads, traces, grid_m, setting.tuned_m, _sites(city))
    return World(learn, city, ())


@lru_cache(maxsize=1)
def _load(folder: str) -> RealData:
    return load(Path(folder))


def _sites(city: City) -> dict[str, Place]:
    frame = LocalFrame(city.scenario.origin_lon, city.scenario.origin_lat)
    places = {}
    for site in city.layout.sites:
        at = frame.to_lonlat(site.x_m, site.y_m)
        places[site.cell] = Place(float(at.lon), float(at.lat))
    return places


def _thinned(trace: Trace, stride: int) -> Trace:
    part = slice(None, None, stride)
    return replace(
        trace,
        time_s=trace.time_s[part],
        lon=trace.lon[part],
        lat=trace.lat[part],
        rsrp_dbm=trace.rsrp_dbm[part],
    )


def _ask_all(
    job: Job,
    case: Case,
    models: dict[str, Model],
    windows: Sequence[Asked],
    city: City | None,
    clock: Clock,
) -> list[dict[str, Any]]:
    """Every method on every window; who goes first turns from window to window."""
    names = list(models)
    for name in names:
        if windows:
            models[name].locate(windows[0].window, None)  # the first call of a method warms caches
    last: dict[str, Estimate] = {}
    rows = []
    every = -(-len(windows) // RECALL_WINDOWS) if _may_turn(case.window_m) else 1
    for number, asked in enumerate(windows):
        turn = number % len(names)
        fixes: dict[str, dict[str, Any]] = {}
        for name in names[turn:] + names[:turn]:
            previous = None
            if asked.since_m is not None:
                previous = Previous(last[name], asked.since_m)
            began_s = clock()
            estimate = models[name].locate(asked.window, previous)
            delay_s = clock() - began_s
            last[name] = estimate
            fixes[name] = _fix(models[name], asked, estimate) | {"delay_ms": 1e3 * delay_s}
        recall = None
        if number % every == 0:
            recall = _recall(last, _definition(models, asked.window, last))
        common = _common(job, case, number, asked, city)
        for name in names:
            kept = recall if name == "roadprint" else None
            rows.append(common | {"method": name} | fixes[name] | {"recall": kept})
    return rows


def _common(job: Job, case: Case, number: int, asked: Asked, city: City | None) -> dict[str, Any]:
    truth, bound_m = asked.truth, None
    if city is not None:
        sd_m = least_sd_m(city.by_id[truth.road_id], asked.chainage_m, city.scenario)
        bound_m = sd_m if np.isfinite(sd_m) else None
    return {
        "job": job.key,
        "seed": job.setting.seed,
        "protocol": case.protocol,
        "window_m": case.window_m,
        "number": number,
        "drive": asked.drive,
        "samples": len(asked.window.distance_m),
        "travelled_m": float(asked.window.distance_m[-1] - asked.window.distance_m[0]),
        "true_road": truth.road_id,
        "true_chainage_m": truth.chainage_m,
        "true_direction": str(truth.direction),
        "true_lon": truth.lon,
        "true_lat": truth.lat,
        "least_sd_m": bound_m,
    }


def _fix(model: Model, asked: Asked, estimate: Estimate) -> dict[str, Any]:
    """
    An answer against its truth.

    ``off map`` has no position: its error is that of its best candidate, so that giving up is not
    rewarded, and its road and direction count as wrong.
    """
    truth = asked.truth
    road_right = estimate.located and estimate.road_id == truth.road_id
    segment_right = None
    if estimate.segment is not None:
        low_m, high_m = estimate.segment
        inside = low_m <= truth.chainage_m <= high_m
        segment_right = estimate.road_id == truth.road_id and inside
    direction_right = None
    if estimate.direction is not None:
        direction_right = estimate.located and estimate.direction == truth.direction
    sure = model if isinstance(model, Confident) else None
    return {
        "road": estimate.road_id,
        "chainage_m": estimate.chainage_m,
        "direction": None if estimate.direction is None else str(estimate.direction),
        "lon": estimate.lon,
        "lat": estimate.lat,
        "located": estimate.located,
        "error_m": float(distance_m(estimate.lon, estimate.lat, truth.lon, truth.lat)),
        "along_m": abs(estimate.chainage_m - truth.chainage_m)
        if estimate.road_id == truth.road_id
        else None,
        "road_right": road_right,
        "direction_right": direction_right,
        "posterior": estimate.posterior,
        "segment_right": segment_right,
        "radius68_m": None if sure is None else sure.radius_m(asked.window, 0.68),
        "radius95_m": None if sure is None else sure.radius_m(asked.window, 0.95),
    }


def _may_turn(window_m: float) -> bool:
    """Whether windows of that length are laid round corners."""
    return window_m >= LEAST_M


def _definition(models: dict[str, Model], window: Window, last: dict[str, Estimate]) -> Fix | None:
    """What `roadprint` approximates: `exhaustive`, round corners as well where that does so."""
    model = models.get("exhaustive")
    if not isinstance(model, ExhaustiveModel):
        return None
    if _may_turn(float(np.ptp(window.distance_m))):
        return model.with_turns(window)
    whole = last["exhaustive"].memory
    if not isinstance(whole, Fix):
        return None
    return model.with_turns(window) if model.may_have_turned(window, whole) else whole


def _recall(last: dict[str, Estimate], whole: Fix | None) -> float | None:
    """Share of the definition's posterior that lies in candidates of the two-scale search."""
    if whole is None or "roadprint" not in last:
        return None
    two_scale = last["roadprint"].memory
    if not isinstance(two_scale, Fix):
        return None
    kept = {(one.road_id, one.segment_index, one.direction) for one in two_scale.candidates}
    total = sum(one.posterior for one in whole.candidates)
    found = sum(
        one.posterior
        for one in whole.candidates
        if (one.road_id, one.segment_index, one.direction) in kept
    )
    return found / total if total > 0 else None
