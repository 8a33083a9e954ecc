"""Figures of points: errors, rates, intervals, delays, reliability, recall."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from app.evaluation.bound import MEAN_ABSOLUTE
from app.evaluation.experiments.plan import Job, Point
from app.evaluation.streams import Purpose, stream
from app.numerics.geodesy import Floats

REDRAWS = 1000
BOOTSTRAP_SEED = 20261122
BINS = 10

Row = dict[str, Any]


def score_points(points: Sequence[Point], keys: dict[Job, str], fixes: pa.Table) -> list[Row]:
    """
    A row for each experiment, x, protocol and method, all seeds together.

    Args:
        keys: The jobs that were run; their fixes carry the key.
    """
    job_of = {job.setting: key for job, key in keys.items()}
    groups: dict[tuple[str, float, str, str, float], list[str]] = {}
    for point in points:
        case = point.case
        name = (point.experiment, point.x, point.label, case.protocol, case.window_m)
        groups.setdefault(name, []).append(job_of[point.setting])
    parts = _by_case(fixes)
    rows = []
    for (experiment, x, label, protocol, window_m), wanted in groups.items():
        tables = [
            parts[key, protocol, window_m] for key in wanted if (key, protocol, window_m) in parts
        ]
        if not tables:
            continue
        table = pa.concat_tables(tables)
        for method in dict.fromkeys(table["method"].to_pylist()):
            head = {
                "experiment": experiment,
                "x": x,
                "label": label,
                "protocol": protocol,
                "window_m": window_m,
                "method": method,
            }
            rows.append(head | score(table.filter(pc.equal(table["method"], method))))
    return rows


def score(fixes: pa.Table) -> Row:
    """
    Figures of one method's fixes at one point; None where there is nothing to say.

    ``direction_rate`` is of all windows, on whatever road they were put (by chance half of them);
    ``direction_given_road_rate`` of those on the right road.
    """
    error_m = _floats(fixes, "error_m")
    low_m, high_m = mean_interval(error_m, _drive_names(fixes))
    p75, p90, p95 = np.quantile(error_m, [0.75, 0.9, 0.95]).tolist()
    delay_ms = _floats(fixes, "delay_ms")
    least_m = _floats(fixes, "least_sd_m")
    least_m = least_m[~np.isnan(least_m)]
    recall = _floats(fixes, "recall")
    recall = recall[~np.isnan(recall)]
    along_m = _floats(fixes, "along_m")
    along_m = along_m[~np.isnan(along_m)]
    on_road = fixes.filter(fixes["road_right"])
    return {
        "windows": len(error_m),
        "mde_m": float(error_m.mean()),
        "mde_low_m": low_m,
        "mde_high_m": high_m,
        "median_m": float(np.median(error_m)),
        "p75_m": p75,
        "p90_m": p90,
        "p95_m": p95,
        "median_along_m": float(np.median(along_m)) if len(along_m) else None,
        "road_rate": _rate(fixes, "road_right"),
        "direction_rate": _rate(fixes, "direction_right"),
        "direction_given_road_rate": _rate(on_road, "direction_right"),
        "segment_rate": _rate(fixes, "segment_right"),
        "located_rate": _rate(fixes, "located"),
        "median_delay_ms": float(np.median(delay_ms)),
        "mean_delay_ms": float(delay_ms.mean()),
        "bound_m": float(MEAN_ABSOLUTE * least_m.mean()) if len(least_m) else None,
        "recall": float(recall.mean()) if len(recall) else None,
        "least_recall": float(recall.min()) if len(recall) else None,
    } | calibration(fixes)


def mean_interval(values: Floats, drives: Sequence[str]) -> tuple[float, float]:
    """
    95 % interval of the mean by bootstrap, whole drives redrawn.

    Windows of one drive share a vehicle and, for methods that remember, each other's mistakes.
    """
    number = np.unique(np.array(drives), return_inverse=True)[1].reshape(-1)
    total, count = np.bincount(number, values), np.bincount(number)
    rng = stream(BOOTSTRAP_SEED, Purpose.BOOTSTRAP)
    drawn = rng.integers(0, len(total), size=(REDRAWS, len(total)))
    means = total[drawn].sum(axis=1) / count[drawn].sum(axis=1)
    low, high = np.quantile(means, [0.025, 0.975]).tolist()
    return low, high


def calibration(fixes: pa.Table) -> Row:
    """Expected calibration error of the sub-segment posterior; coverage of the radii."""
    error_m = _floats(fixes, "error_m")
    out: Row = {"ece": None, "coverage68": None, "coverage95": None}
    bins = reliability(fixes)
    if bins:
        count = np.array([each["windows"] for each in bins])
        gap = np.array([abs(each["said"] - each["right"]) for each in bins])
        out["ece"] = float((count * gap).sum() / count.sum())
    for level in (68, 95):
        radius_m = _floats(fixes, f"radius{level}_m")
        if len(radius_m) and not np.isnan(radius_m).any():
            out[f"coverage{level}"] = float(np.mean(error_m <= radius_m))
    return out


def reliability(fixes: pa.Table) -> list[Row]:
    """How often the sub-segment was right, by what was said of it, in ten even bins."""
    said, right = _floats(fixes, "posterior"), _floats(fixes, "segment_right")
    known = ~np.isnan(said) & ~np.isnan(right)
    said, right = said[known], right[known]
    which = np.minimum((said * BINS).astype(int), BINS - 1)
    return [
        {
            "bin": int(number),
            "windows": int((which == number).sum()),
            "said": float(said[which == number].mean()),
            "right": float(right[which == number].mean()),
        }
        for number in np.unique(which)
    ]


def pick(fixes: pa.Table, points: Sequence[Point], keys: dict[Job, str]) -> pa.Table:
    """The fixes of some points, all methods."""
    job_of = {job.setting: key for job, key in keys.items()}
    parts = _by_case(fixes)
    wanted = dict.fromkeys(
        (job_of[point.setting], point.case.protocol, point.case.window_m) for point in points
    )
    return pa.concat_tables([parts[each] for each in wanted if each in parts])


def _by_case(fixes: pa.Table) -> dict[tuple[str, str, float], pa.Table]:
    """Runs of rows of one job and case; they stand together."""
    job, protocol = fixes["job"].to_pylist(), fixes["protocol"].to_pylist()
    names = list(zip(job, protocol, fixes["window_m"].to_pylist(), strict=True))
    starts = [i for i in range(len(names)) if i == 0 or names[i] != names[i - 1]]
    ends = [*starts[1:], len(names)]
    return {
        names[start]: fixes.slice(start, end - start)
        for start, end in zip(starts, ends, strict=True)
    }


def _drive_names(fixes: pa.Table) -> list[str]:
    job, drive = fixes["job"].to_pylist(), fixes["drive"].to_pylist()
    return [f"{one}/{other}" for one, other in zip(job, drive, strict=True)]


def _floats(fixes: pa.Table, name: str) -> Floats:
    """A column as floats, NaN where there is none."""
    column = fixes[name].cast(pa.float64()) if name != "segment_right" else _numbers(fixes[name])
    return np.asarray(column.fill_null(float("nan")).to_numpy(zero_copy_only=False), dtype=float)


def _numbers(column: pa.ChunkedArray) -> pa.ChunkedArray:
    return column.cast(pa.int8()).cast(pa.float64())


def _rate(fixes: pa.Table, name: str) -> float | None:
    mean = pc.mean(_numbers(fixes[name])).as_py()
    return None if mean is None else float(mean)
