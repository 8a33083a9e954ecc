"""Survey passes laid on their road: chainage of every reading, one row a metre and pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from app.domain import Line, Trace
from app.numerics import native_readings
from app.numerics.geodesy import Floats
from app.numerics.lines import length_m, project
from app.numerics.smoothing import smooth_chainage
from app.numerics.wild import without_wild

MAX_LAG_S = 3.0  # a receiver whose clocks differ by more is broken, not late
EDGE_S = 3.0  # beyond its ends a drive goes on as fast as over so long
ROW_M = 1.0  # a standing car's readings of one metre are one reading
REACH_M = 40.0  # a fix farther off than a wide street was not taken on this road
MIN_ROWS = 2
END_SLACK_M = 10.0  # beyond an end, only what the jitter of a fix may explain


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """
    What a pass's rows are joined from: its samples on the road, in driving order.

    Attributes:
        time_s: Non-decreasing. Shape ``(samples,)``.
        chainage_m: Where the receiver said it was, without jitter; same shape.
        rsrp_dbm: NaN = not heard. Shape ``(samples, cells)``.
        end_m: Length of the road.
    """

    time_s: Float[np.ndarray, " samples"]
    chainage_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    end_m: float

    @property
    def timed(self) -> bool:
        """Whether the samples' times tell when each was taken."""
        return bool(self.time_s[-1] > self.time_s[0])

    def starts(self) -> Int[np.ndarray, " rows"]:
        """First sample of every row."""
        return _starts(self.chainage_m)

    def behind_m(self, lag_s: float) -> Floats:
        """
        Chainage at which the car was ``lag_s`` before each sample's time; a standing car stays.

        Before its first and after its last sample the car is taken to have gone on as fast as near
        them, so places may lie beyond the road's ends.
        """
        moving = np.concatenate(([True], np.diff(self.time_s) > 0.0))
        time_s, chainage_m = self.time_s[moving], self.chainage_m[moving]
        second = min(int(np.searchsorted(time_s, time_s[0] + EDGE_S)), len(time_s) - 1)
        last = max(int(np.searchsorted(time_s, time_s[-1] - EDGE_S, side="right")) - 1, 0)
        before_m = (chainage_m[second] - chainage_m[0]) / (time_s[second] - time_s[0])
        after_m = (chainage_m[-1] - chainage_m[last]) / (time_s[-1] - time_s[last])
        known_s = np.concatenate([[time_s[0] - MAX_LAG_S], time_s, [time_s[-1] + MAX_LAG_S]])
        first_m = chainage_m[0] - MAX_LAG_S * before_m
        final_m = chainage_m[-1] + MAX_LAG_S * after_m
        known_m = np.concatenate([[first_m], chainage_m, [final_m]])
        return np.interp(self.time_s - lag_s, known_s, known_m)


@dataclass(frozen=True, slots=True, eq=False)
class RoadPass:
    """
    One pass along a road, in driving order, one row a metre at most.

    Attributes:
        chainage_m: Shape ``(rows,)``.
        rsrp_dbm: Mean reading, NaN = not heard. Shape ``(rows, cells)``.
        heard: Share of the row's samples that heard the cell, same shape.
        group: Passes of one day share it: they are held out together.
        samples: What the rows were joined from; None where that is not known.
        doubt_m: How far its places may be wrong (`app.numerics.smoothing`).
    """

    chainage_m: Float[np.ndarray, " rows"]
    rsrp_dbm: Float[np.ndarray, "rows cells"]
    heard: Float[np.ndarray, "rows cells"]
    group: str
    samples: Samples | None = None
    doubt_m: float = 0.0

    @property
    def travelled_m(self) -> Floats:
        """Distance driven since the first row."""
        return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.chainage_m)))])

    @property
    def sign(self) -> int:
        """+1 when driven towards growing chainage, else -1."""
        return 1 if self.chainage_m[-1] >= self.chainage_m[0] else -1

    def of_cells(self, kept: Bool[np.ndarray, " cells"]) -> RoadPass:
        """The pass with some of its columns."""
        samples = self.samples
        if samples is not None:
            samples = replace(samples, rsrp_dbm=samples.rsrp_dbm[:, kept])
        rsrp_dbm, heard = self.rsrp_dbm[:, kept], self.heard[:, kept]
        return replace(self, rsrp_dbm=rsrp_dbm, heard=heard, samples=samples)

    def corrected(self, lag_s: float, level_db: float) -> RoadPass:
        """
        The pass with every reading where the car was ``lag_s`` before, ``level_db`` less loud.

        Readings that come from beyond an end by more than the slack are left out. Nothing to
        correct, or no samples to do it with, and the pass is itself.
        """
        if self.samples is None or (lag_s == 0.0 and level_db == 0.0):
            return self
        all_of = self.samples
        moved_m = all_of.behind_m(lag_s) if lag_s != 0.0 else all_of.chainage_m
        kept = (moved_m >= -END_SLACK_M) & (moved_m <= all_of.end_m + END_SLACK_M)
        moved_m = np.clip(moved_m[kept], 0.0, all_of.end_m)
        if len(_starts(moved_m)) < MIN_ROWS:
            return self
        time_s, rsrp_dbm = all_of.time_s[kept], all_of.rsrp_dbm[kept] - level_db
        return _pass(Samples(time_s, moved_m, rsrp_dbm, all_of.end_m), self.group, self.doubt_m)


def all_cells(passes: Sequence[Trace]) -> tuple[str, ...]:
    """Every cell of the passes, sorted, so that the order of columns never matters."""
    return tuple(sorted({cell for trace in passes for cell in trace.cells}))


def distinct(passes: Sequence[Trace]) -> list[Trace]:
    """
    The passes without exact copies, in an order of their own: the same samples twice are one pass.

    Neither the order of the passes nor that of their cells moves anything.
    """
    seen: dict[tuple[bytes, ...], Trace] = {}
    for trace in sorted(passes, key=lambda trace: str(trace.recorded_at)):
        seen.setdefault(_samples(trace), trace)
    return [seen[key] for key in sorted(seen)]


def _samples(trace: Trace) -> tuple[bytes, ...]:
    order = np.argsort(np.array(trace.cells))
    columns = np.ascontiguousarray(trace.rsrp_dbm[:, order], dtype=np.float32)
    names = "\n".join(sorted(trace.cells)).encode()
    places = (trace.lon.tobytes(), trace.lat.tobytes())
    return (*places, trace.time_s.tobytes(), names, columns.tobytes())


def lay_on_road(line: Line, trace: Trace, cells: tuple[str, ...], name: str) -> RoadPass | None:
    """
    Project a trace on the line, leave wild readings out, and join its samples metre by metre.

    Args:
        cells: Columns wanted; those that the trace lacks are NaN throughout.
        name: Group of a trace without a date.

    Returns:
        None when fewer than two rows lie on the road.
    """
    feet = project(line, trace.lon, trace.lat)
    end_m = length_m(line)
    at_an_end = (feet.chainage_m <= 0.0) | (feet.chainage_m >= end_m)
    near = np.abs(feet.offset_m) <= np.where(at_an_end, END_SLACK_M, REACH_M)
    if near.sum() < MIN_ROWS:
        return None
    column = {cell: index for index, cell in enumerate(cells)}
    rsrp = np.full((int(near.sum()), len(cells)), np.nan)
    rsrp[:, [column[cell] for cell in trace.cells]] = trace.rsrp_dbm[near]
    time_s = trace.time_s[near]
    chainage_m, doubt_m = smooth_chainage(feet.chainage_m[near], feet.offset_m[near], time_s)
    if len(_starts(chainage_m)) < MIN_ROWS:
        return None
    rsrp = _without_wild(chainage_m, rsrp)
    group = trace.recorded_at.date().isoformat() if trace.recorded_at else name
    return _pass(Samples(time_s, chainage_m, rsrp, end_m), group, doubt_m)


def _without_wild(
    chainage_m: Float[np.ndarray, " samples"], rsrp_dbm: Float[np.ndarray, "samples cells"]
) -> Float[np.ndarray, "samples cells"]:
    travelled_m = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(chainage_m)))))
    leave_out = native_readings.without_wild if native_readings.BUILT else without_wild
    return leave_out(travelled_m, rsrp_dbm)


def _pass(samples: Samples, group: str, doubt_m: float) -> RoadPass:
    """One row for each stretch of samples that stay in one metre, in driving order."""
    chainage_m, rsrp_dbm, starts = samples.chainage_m, samples.rsrp_dbm, samples.starts()
    size = np.diff(np.append(starts, len(chainage_m)))
    known = ~np.isnan(rsrp_dbm)
    count = np.add.reduceat(known.astype(float), starts, axis=0)
    total = np.add.reduceat(np.where(known, rsrp_dbm, 0.0), starts, axis=0)
    with np.errstate(invalid="ignore"):
        mean = total / count
    row_m = np.add.reduceat(chainage_m, starts) / size
    return RoadPass(row_m, mean, count / size[:, None], group, samples, doubt_m)


def _starts(chainage_m: Floats) -> Int[np.ndarray, " rows"]:
    metre = np.rint(chainage_m / ROW_M).astype(int)
    return np.flatnonzero(np.concatenate([[True], np.diff(metre) != 0]))
