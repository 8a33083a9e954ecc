"""Free parameters of the rivals, chosen on the survey alone: each gets what serves it best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from app.domain import Direction, Trace
from app.evaluation.methods.base import Model, Previous, Survey
from app.evaluation.passes import Drive, drive_of
from app.evaluation.protocols import PROTOCOLS, Asked, Protocol, tour
from app.numerics.geodesy import distance_m

P = TypeVar("P")

TUNING_DRIVES = 8  # the four roads of the paper's area both ways
WINDOWS_A_RUN = 3  # of each under each protocol: methods that remember go on from the one before
MOST_WINDOWS = 1000
HELD_SHARE = 5  # one pass in so many is held out where days do not tell
FARTHEST_M = 150.0  # a miss counts no more: one lost drive must not choose the parameters


def choose(choices: Sequence[P], fit: Callable[[Survey, P], Model], survey: Survey, seed: int) -> P:
    """
    The parameters of least mean error on held-out survey windows; the first among equals.

    Passes of the last day are held out where the other days cover their roads, else the last fifth
    of each road's passes. Only with one pass a road every second sample is (neighbouring samples
    share the place, not the noise). Held-out passes are driven both ways, as vehicles will.
    """
    train, held = split(survey)
    drives = _spread(
        [_drive(survey, trace) for trace in held]
        + [_drive(survey, _turned(trace)) for trace in held]
    )
    runs = [
        _run(one, number, protocol, survey.window_m, seed)
        for protocol in PROTOCOLS
        for number, one in enumerate(drives)
    ]
    return min(choices, key=lambda each: _mean_error_m(fit(train, each), runs))


def _spread(drives: list[Drive]) -> list[Drive]:
    """At most `TUNING_DRIVES` of them, evenly from first to last."""
    count = min(len(drives), TUNING_DRIVES)
    return [drives[i] for i in np.linspace(0, len(drives) - 1, count).round().astype(int).tolist()]


def _run(one: Drive, number: int, protocol: Protocol, length_m: float, seed: int) -> list[Asked]:
    """A few windows of a drive, one after the other; of aligned ones another stretch each drive."""
    found = list(
        tour(
            [one],
            MOST_WINDOWS,
            protocol=protocol,
            length_m=length_m,
            seed=seed + number,
            each=WINDOWS_A_RUN,
        )
    )
    first = (number * WINDOWS_A_RUN) % max(1, len(found) - WINDOWS_A_RUN + 1)
    return found[first : first + WINDOWS_A_RUN]


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


def _turned(trace: Trace) -> Trace:
    """The same pass driven the other way."""
    return replace(
        trace,
        time_s=trace.time_s[-1] - trace.time_s[::-1],
        lon=trace.lon[::-1],
        lat=trace.lat[::-1],
        rsrp_dbm=trace.rsrp_dbm[::-1],
    )


def _mean_error_m(model: Model, runs: Sequence[Sequence[Asked]]) -> float:
    errors = []
    for run in runs:
        previous: Previous | None = None
        for asked in run:
            if previous is not None and asked.since_m is not None:
                previous = Previous(previous.estimate, asked.since_m)
            estimate = model.locate(asked.window, previous)
            previous = Previous(estimate, 0.0)
            truth = asked.truth
            errors.append(float(distance_m(estimate.lon, estimate.lat, truth.lon, truth.lat)))
    return float(np.mean(np.minimum(errors, FARTHEST_M)))
