"""Where roadprint wins and where it does not, from the numbers alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.evaluation.experiments.score import Row
from app.numerics.geodesy import Floats

OURS = "roadprint"
ROAD_SHARE = 0.95  # a method counts as a rival at a point when it has this much of our road rate
SAME_M = 1e-3  # `exhaustive` and `roadprint` place the same window within less
NEAR_M = 2.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence of the verdict, and whether it speaks for roadprint."""

    wins: bool
    text: str


def judge(rows: Sequence[Row]) -> list[Finding]:
    """For each point a finding on MDE, median error and delay, among comparable methods."""
    findings = []
    names = dict.fromkeys((row["experiment"], row["protocol"], row["label"]) for row in rows)
    for experiment, protocol, label in names:
        here = [
            row
            for row in rows
            if (row["experiment"], row["protocol"], row["label"]) == (experiment, protocol, label)
        ]
        ours = next((row for row in here if row["method"] == OURS), None)
        if ours is None or experiment in {"recall", "reliability"}:
            continue
        place = f"{experiment} {label}, {protocol}"
        rivals = comparable(here, ours)
        findings.append(_least(place, ours, rivals, "mde_m", "MDE", "m"))
        findings.append(_least(place, ours, rivals, "median_m", "median error", "m"))
        findings.append(_least(place, ours, rivals, "median_delay_ms", "median delay", "ms"))
    return findings


def comparable(here: Sequence[Row], ours: Row) -> list[Row]:
    """The other methods that reach `ROAD_SHARE` of our road rate."""
    least = ROAD_SHARE * (ours["road_rate"] or 0.0)
    return [row for row in here if row["method"] != OURS and (row["road_rate"] or 0.0) >= least]


def _least(
    place: str, ours: Row, rivals: Sequence[Row], column: str, what: str, unit: str
) -> Finding:
    mine = float(ours[column])
    slack = SAME_M if unit == "m" else 0.0
    better = [row for row in rivals if float(row[column]) < mine - slack]
    if not better:
        return Finding(True, f"{place}: lowest {what}, {mine:.3g} {unit}")
    best = min(better, key=lambda row: float(row[column]))
    value = float(best[column])
    apart = ""
    if column == "mde_m" and best["mde_high_m"] >= ours["mde_low_m"]:
        apart = " (their 95 % intervals overlap)"
    than = f"{value:.3g} against {mine:.3g} {unit}"
    return Finding(False, f"{place}: {best['method']} has a lower {what}, {than}{apart}")


def improvements(errors_m: dict[str, Floats]) -> list[Row]:
    """
    How far our CDF lies above each rival's, in points: from 0 to 2 m, and over the whole range.

    The paper says "17 %, 27 %, 35 % improvement (from 2 m to 0 m)" and not how that is counted:
    given are the mean difference of the two curves between 0 and 2 m, that at 2 m, and the mean
    over the whole range of errors (equal to the difference of the MDEs over the range).
    """
    ours = errors_m.get(OURS)
    if ours is None:
        return []
    widest_m = max(float(error.max()) for error in errors_m.values())
    return [
        {
            "method": method,
            "mean_0_to_2_m": _area(ours, NEAR_M) - _area(error_m, NEAR_M),
            "at_2_m": float(np.mean(ours <= NEAR_M) - np.mean(error_m <= NEAR_M)),
            "mean_whole_range": _area(ours, widest_m) - _area(error_m, widest_m),
            "whole_range_m": widest_m,
        }
        for method, error_m in errors_m.items()
        if method != OURS
    ]


def _area(error_m: Floats, to_m: float) -> float:
    """Mean of the empirical CDF between 0 and ``to_m``."""
    return float(np.mean(np.maximum(to_m - error_m, 0.0)) / to_m)
