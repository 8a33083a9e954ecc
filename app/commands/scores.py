"""How far off a run's answers were, and how long they took."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from app.commands.target import Document
from app.evaluation.truth import Truth
from app.numerics.geodesy import distance_m


@dataclass(frozen=True, slots=True)
class Answer:
    """
    One answer against its truth.

    An ``off_map`` answer has no position: its error is that of its best candidate, so that giving
    up is not rewarded, and its road and direction count as wrong.
    """

    error_m: float
    located: bool
    road_right: bool
    direction_right: bool
    delay_ms: float
    match_ms: float

    @classmethod
    def of(cls, fix: Document, truth: Truth, delay_ms: float, server_timing: str) -> Answer:
        """Compare a fix, as ``POST /v1/locate`` answers it, with the truth."""
        located = fix["status"] == "located"
        best = fix["candidates"][0]
        place = fix["position"] if located else best
        error_m = distance_m(place["lon"], place["lat"], truth.lon, truth.lat)
        return cls(
            error_m=float(error_m),
            located=located,
            road_right=located and fix["road"]["id"] == truth.road_id,
            direction_right=located and place["direction"] == truth.direction,
            delay_ms=delay_ms,
            match_ms=_duration_ms(server_timing),
        )


@dataclass(frozen=True, slots=True)
class Scores:
    """What a run amounts to. Rates are shares of all answers."""

    mean_error_m: float
    median_error_m: float
    p95_error_m: float
    road_right: float
    direction_right: float
    located: float

    @classmethod
    def of(cls, answers: Sequence[Answer]) -> Scores:
        """The figures of at least one answer."""
        error_m = np.array([answer.error_m for answer in answers])
        return cls(
            mean_error_m=float(np.mean(error_m)),
            median_error_m=float(np.median(error_m)),
            p95_error_m=float(np.quantile(error_m, 0.95)),
            road_right=float(np.mean([answer.road_right for answer in answers])),
            direction_right=float(np.mean([answer.direction_right for answer in answers])),
            located=float(np.mean([answer.located for answer in answers])),
        )


def scores_table(answers: Sequence[Answer]) -> Table:
    """Errors and delays, for people."""
    scores = Scores.of(answers)
    delay_ms = np.array([answer.delay_ms for answer in answers])
    match_ms = np.array([answer.match_ms for answer in answers])
    table = Table(title=f"{len(answers)} windows located over HTTP", title_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_row("mean distance error", f"{scores.mean_error_m:.2f} m")
    table.add_row("median error", f"{scores.median_error_m:.2f} m")
    table.add_row("95 % of errors below", f"{scores.p95_error_m:.2f} m")
    table.add_row("road right", f"{scores.road_right:.1%}")
    table.add_row("direction right", f"{scores.direction_right:.1%}")
    table.add_row("delay, end to end, median", f"{np.median(delay_ms):.2f} ms")
    table.add_row("delay, end to end, 95 %", f"{np.quantile(delay_ms, 0.95):.2f} ms")
    table.add_row("of it matching, median", f"{np.nanmedian(match_ms):.2f} ms")
    return table


def _duration_ms(server_timing: str) -> float:
    """The first ``dur`` of a Server-Timing header; NaN without one."""
    for part in server_timing.replace(",", ";").split(";"):
        name, _, value = part.strip().partition("=")
        if name == "dur":
            return float(value)
    return float("nan")
