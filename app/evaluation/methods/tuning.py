"""Free parameters of the rivals, chosen on the survey alone: each gets what serves it best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from app.domain import Direction, Trace
from app.evaluation.methods.base import Model, Previous, Survey
from app.evaluation.passes import Drive, drive_of
from app.evaluation.protocols import PROTOCOLS, Asked, tour
from app.numerics.geodesy import distance_m

P = TypeVar("P")

TUNING_WINDOWS = 24  # under each protocol
HELD_SHARE = 5  # one pass in so many is held out where days do not tell
FARTHEST_M = 150.0  # a miss counts no more: one lost drive must not choose the parameters


def choose(choices: Sequence[P], fit: Callable[[Survey, P], Model], survey: Survey, seed: int) -> P:
    """
    The parameters of least mean error on held-out survey windows; the first among equals.

    Passes of the last day are held out where the other days cover their roads, else the last fifth
    of each road's passes. Only with one pass a road every second sample is (neighbouring samples
    share the place, not the noise).
    """
    train, held = split(survey)
    drives = [_drive(survey, trace) for trace in held]
    windows = [
        asked
        for protocol in PROTOCOLS
        for asked in tour(
            drives, TUNING_WINDOWS, protocol=protocol, length_m=survey.window_m, seed=seed
        )
    ]
    return min(choices, key=lambda each: _mean_error_m(fit(train, each), windows))


def split(survey: Survey) -> tuple[Survey, list[Trace]]:
    """A survey to learn from, and passes that it lacks."""
    days = sorted({day for trace in survey.traces if (day := _day(trace)) is not None})
    last = [trace for trace in survey.traces if days and _day(trace) == days[-1]]
    rest = [trace for trace in survey.traces if not days or _day(trace) != days[-1]]
    if last and rest and {trace.road_id for trace in last} <= {trace.road_id for trace in rest}:
        return replace(survey, traces=tuple(rest)), last
    held = _last_passes(survey)
    if held:
        rest = [trace for trace in survey.traces if not any(trace is one for one in held)]
        return replace(survey, traces=tuple(rest)), held
    train = tuple(_every_second(trace, 0) for trace in survey.traces)
    return replace(survey, traces=train), [_every_second(trace, 1) for trace in survey.traces]


def _last_passes(survey: Survey) -> list[Trace]:
    """The last fifth, at least one, of the passes of each road that has several."""
    by_road: dict[str | None, list[Trace]] = {}
    for trace in survey.traces:
        by_road.setdefault(trace.road_id, []).append(trace)
    several = [passes for passes in by_road.values() if len(passes) > 1]
    return [trace for passes in several for trace in passes[-max(1, len(passes) // HELD_SHARE) :]]


def _day(trace: Trace) -> str | None:
    return trace.recorded_at.date().isoformat() if trace.recorded_at else None


def _every_second(trace: Trace, first: int) -> Trace:
    part = slice(first, None, 2)
    return replace(
        trace,
        time_s=trace.time_s[part],
        lon=trace.lon[part],
        lat=trace.lat[part],
        rsrp_dbm=trace.rsrp_dbm[part],
    )


def _drive(survey: Survey, trace: Trace) -> Drive:
    line = survey.line(str(trace.road_id))
    forward = drive_of(trace, str(trace.road_id), line, Direction.FORWARD)
    if forward.chainage_m[-1] >= forward.chainage_m[0]:
        return forward
    return drive_of(trace, str(trace.road_id), line, Direction.BACKWARD)


def _mean_error_m(model: Model, windows: Sequence[Asked]) -> float:
    errors = []
    previous: Previous | None = None
    for asked in windows:
        if asked.since_m is None or previous is None:
            previous = None
        else:
            previous = Previous(previous.estimate, asked.since_m)
        estimate = model.locate(asked.window, previous)
        previous = Previous(estimate, 0.0)
        truth = asked.truth
        errors.append(float(distance_m(estimate.lon, estimate.lat, truth.lon, truth.lat)))
    return float(np.mean(np.minimum(errors, FARTHEST_M)))
