"""The centre line of a route that is known by its drives alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.domain import Line, Trace
from app.evaluation.route import SEEN_M, follow
from app.numerics.geodesy import Floats, distance_m
from app.numerics.lines import length_m, point_at

VERTEX_M = 20.0
ROUNDS = 2  # a line is drawn, followed and drawn again
SHARE_OF_DRIVES = 0.25  # that reach a stretch, or it is no part of the route


def draw_line(traces: Sequence[Trace], odometers_m: Sequence[Floats | None]) -> Line:
    """
    The centre line of drives of one route, in the direction of the drive that it begins with.

    Begun from the drive whose positions jump least, then the mean of what all drives say at each
    place, where they are laid by `follow`; ends that few drives reach are cut off.

    Args:
        odometers_m: One a trace; None where there is none.
    """
    steadiest = min(_whole(traces), key=_largest_jump_m)
    line = _thinned(steadiest)
    for _ in range(ROUNDS):
        laid = [
            (trace, follow(line, trace, odometer).chainage_m)
            for trace, odometer in zip(traces, odometers_m, strict=True)
        ]
        line = _mean_line(line, laid)
    return line


def _whole(traces: Sequence[Trace]) -> list[Trace]:
    """Those that take at least nine tenths of the median extent between first and last position."""
    extent_m = [float(distance_m(t.lon[0], t.lat[0], t.lon[-1], t.lat[-1])) for t in traces]
    least_m = 0.9 * float(np.median(extent_m))
    return [t for t, each_m in zip(traces, extent_m, strict=True) if each_m >= least_m]


def _largest_jump_m(trace: Trace) -> float:
    return float(np.max(distance_m(trace.lon[:-1], trace.lat[:-1], trace.lon[1:], trace.lat[1:])))


def _thinned(trace: Trace) -> Line:
    """A first line: the trace's positions at least a vertex's spacing apart."""
    kept = [0]
    for i in range(1, len(trace.lon)):
        last = kept[-1]
        if distance_m(trace.lon[last], trace.lat[last], trace.lon[i], trace.lat[i]) >= VERTEX_M:
            kept.append(i)
    return Line(trace.lon[kept], trace.lat[kept])


def _mean_line(line: Line, laid: list[tuple[Trace, Floats]]) -> Line:
    """Mean position of all drives about each vertex of an even division of the old line."""
    parts = max(2, round(length_m(line) / VERTEX_M))
    width_m = length_m(line) / parts
    sums, drives = np.zeros((parts, 3)), np.zeros(parts)
    for trace, chainage_m in laid:
        on = point_at(line, np.nan_to_num(chainage_m))
        near = distance_m(trace.lon, trace.lat, on.lon, on.lat) <= SEEN_M
        seen = ~np.isnan(chainage_m) & near
        part = np.minimum((chainage_m[seen] / width_m).astype(int), parts - 1)
        count = np.maximum(np.bincount(part, minlength=parts), 1)
        there = np.bincount(part, minlength=parts) > 0
        for column, values in enumerate((trace.lon, trace.lat, np.ones(len(trace.lon)))):
            mean = np.bincount(part, values[seen], minlength=parts) / count
            sums[:, column] += np.where(there, mean, 0.0)
        drives += there
    often = np.flatnonzero(drives >= max(1.0, SHARE_OF_DRIVES * len(laid)))
    return Line(*(_smooth(sums[often, column] / sums[often, 2]) for column in (0, 1)))


def _smooth(values: Floats) -> Floats:
    """Weights 1, 2, 1: positions rounded alike by all drives make zigzags, and a line too long."""
    inner = (values[:-2] + 2.0 * values[1:-1] + values[2:]) / 4.0
    return np.concatenate([values[:1], inner, values[-1:]])
