"""
What a road's surveys are worth, sub-segment by sub-segment: who drove it, and how well it tells.

How well is the Fisher information of a window that ends there, from the fitted curves alone
(S. M. Kay, *Fundamentals of Statistical Signal Processing: Estimation Theory*, 1993, Eq. 3.14): a
sample at chainage s hears cell k with probability ``p_k`` as ``N(mu_k(s) + b, sigma_k^2)``, so that

    I_ss = sum p_k mu_k'^2 / sigma_k^2
    I_sb = sum p_k mu_k' / sigma_k^2
    I_bb = sum p_k / sigma_k^2

over the cells and the window's samples, one each `SAMPLE_M`. `app.numerics.expectation` makes
metres of them with what the map's calibration knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float

from app.domain import RoadModel, Segment, Trace
from app.numerics.expectation import SAMPLE_M, WINDOW_M
from app.numerics.geodesy import Floats
from app.numerics.lines import project
from app.numerics.passes import REACH_M, distinct

SLOPE_M = 10.0  # a curve's wiggles below this are as much noise as signal
LEAST_SHARE = 0.5  # of a sub-segment: a pass that drove less of it was not along it
UNDATED = "undated"  # passes without a date may all be of one day


@dataclass(frozen=True, slots=True)
class SegmentCoverage:
    """
    What is known of the surveys along one sub-segment.

    Attributes:
        forward, backward: Passes by direction; ``passes`` is their sum.
        days: Different dates of the passes; all that have none count as one day.
        devices: Different devices; all that are not named count as one.
        cells: Mapped anywhere on it. ``cells_heard``: expected in one sample.
        spread_db: Of a new sample about the curves, weighted by how often a cell is heard; None
            where none is mapped.
        place_information, mixed_information, offset_information: I_ss (1/m^2), I_sb (1/(m dB)) and
            I_bb (1/dB^2) of a window that ends here: means over its places and both directions.
    """

    segment_index: int
    passes: int
    forward: int
    backward: int
    days: int
    devices: int
    cells: int
    cells_heard: float
    spread_db: float | None
    last_surveyed_at: datetime | None
    place_information: float
    mixed_information: float
    offset_information: float


@dataclass(frozen=True, slots=True)
class _Way:
    """The stretch of the road that one pass drove."""

    trace: Trace
    low_m: float
    high_m: float
    forward: bool


def cover(model: RoadModel, passes: Sequence[Trace]) -> list[SegmentCoverage]:
    """
    Every sub-segment of a road model with the passes that it was made of.

    Args:
        passes: Those of the fit; exact copies count once.
    """
    ways = [way for trace in distinct(passes) if (way := _way(model, trace)) is not None]
    information = _window_sums(_information(model), model.step_m)
    return [
        _segment(model, segment, ways, information[_grid_of(model, segment)])
        for segment in model.segments
    ]


def _grid_of(model: RoadModel, segment: Segment) -> slice:
    """Grid points on a segment, one at least."""
    last = len(model.mean_dbm) - 1
    first = min(int(np.ceil(segment.start_m / model.step_m - 1e-9)), last)
    return slice(first, max(first, min(int(segment.end_m / model.step_m + 1e-9), last)) + 1)


def _segment(
    model: RoadModel,
    segment: Segment,
    ways: Sequence[_Way],
    information: Float[np.ndarray, "within 3"],
) -> SegmentCoverage:
    least_m = LEAST_SHARE * (segment.end_m - segment.start_m)
    by = [one for one in ways if _shared_m(one, segment.start_m, segment.end_m) >= least_m]
    traces = [one.trace for one in by]
    moments = [trace.recorded_at for trace in traces if trace.recorded_at is not None]
    forward = sum(one.forward for one in by)
    within = _grid_of(model, segment)
    place, mixed, offset = information.mean(axis=0).tolist()
    return SegmentCoverage(
        segment_index=segment.index,
        passes=len(by),
        forward=forward,
        backward=len(by) - forward,
        days=len({_day(trace) for trace in traces}),
        devices=len({trace.device for trace in traces}),
        cells=int(np.isfinite(model.mean_dbm[within]).any(axis=0).sum()),
        cells_heard=float(_weight(model)[within].sum(axis=1).mean()),
        spread_db=_spread_db(model, within),
        last_surveyed_at=max(moments, default=None),
        place_information=place,
        mixed_information=mixed,
        offset_information=offset,
    )


def _way(model: RoadModel, trace: Trace) -> _Way | None:
    feet = project(model.line, trace.lon, trace.lat)
    chainage_m = feet.chainage_m[np.abs(feet.offset_m) <= REACH_M]
    if len(chainage_m) < 2:
        return None
    forward = bool(chainage_m[-1] >= chainage_m[0])
    return _Way(trace, float(chainage_m.min()), float(chainage_m.max()), forward)


def _shared_m(way: _Way, start_m: float, end_m: float) -> float:
    return min(way.high_m, end_m) - max(way.low_m, start_m)


def _day(trace: Trace) -> str:
    return trace.recorded_at.date().isoformat() if trace.recorded_at else UNDATED


def _weight(model: RoadModel) -> Floats:
    """How probably a sample hears each cell, 0 where it is not mapped."""
    return np.where(np.isfinite(model.mean_dbm), model.heard, 0.0).astype(float)


def _spread_db(model: RoadModel, within: slice) -> float | None:
    weight = _weight(model)[within]
    variance = np.where(weight > 0, model.spread_db[within], 0.0).astype(float) ** 2
    total = float(weight.sum())
    return float(np.sqrt((weight * variance).sum() / total)) if total > 0 else None


def _information(model: RoadModel) -> Float[np.ndarray, "grid 3"]:
    """I_ss, I_sb and I_bb of one sample at each grid point."""
    steps = max(1, round(SLOPE_M / model.step_m))
    level_db = model.mean_dbm.astype(float)
    ahead = np.minimum(np.arange(len(level_db)) + (steps + 1) // 2, len(level_db) - 1)
    behind = np.maximum(np.arange(len(level_db)) - steps // 2, 0)
    apart_m = np.maximum(ahead - behind, 1)[:, None] * model.step_m
    slope = (level_db[ahead] - level_db[behind]) / apart_m
    slope = np.where(np.isfinite(slope), slope, 0.0)  # at the rim of a cell: it tells by its level
    spread_db = np.where(np.isfinite(level_db), model.spread_db, 1.0).astype(float)
    weight = _weight(model) / np.maximum(spread_db, 0.1) ** 2
    terms = [weight * slope**2, weight * slope, weight]
    return np.stack([term.sum(axis=1) for term in terms], axis=1)


def _window_sums(at: Float[np.ndarray, "grid 3"], step_m: float) -> Floats:
    """
    The sums over a window that ends at each grid point, mean of both directions.

    A window at a road's end has only what lies on the road, as its other samples lie on a road of
    which nothing is known here.
    """
    count = max(1, round(WINDOW_M / step_m))
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(at, axis=0)])
    here = np.arange(len(at))
    forward = total[here + 1] - total[np.maximum(here + 1 - count, 0)]
    backward = total[np.minimum(here + count, len(at))] - total[here]
    return 0.5 * (forward + backward) * (step_m / SAMPLE_M)
