"""Survey passes laid on their road: chainage of every reading, one row a metre and pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.domain import Line, Trace
from app.numerics.geodesy import Floats
from app.numerics.lines import length_m, project
from app.numerics.smoothing import smooth_chainage

ROW_M = 1.0  # a standing car's readings of one metre are one reading
REACH_M = 40.0  # a fix farther off than a wide street was not taken on this road
END_SLACK_M = 10.0  # beyond an end, only what the jitter of a fix may explain


@dataclass(frozen=True, slots=True, eq=False)
class RoadPass:
    """
    One pass along a road, in driving order, one row a metre at most.

    Attributes:
        chainage_m: Shape ``(rows,)``.
        rsrp_dbm: Mean reading, NaN = not heard. Shape ``(rows, cells)``.
        heard: Share of the row's samples that heard the cell, same shape.
        group: Passes of one day share it: they are held out together.
    """

    chainage_m: Float[np.ndarray, " rows"]
    rsrp_dbm: Float[np.ndarray, "rows cells"]
    heard: Float[np.ndarray, "rows cells"]
    group: str

    @property
    def travelled_m(self) -> Floats:
        """Distance driven since the first row."""
        return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.chainage_m)))])

    @property
    def sign(self) -> int:
        """+1 when driven towards growing chainage, else -1."""
        return 1 if self.chainage_m[-1] >= self.chainage_m[0] else -1


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
    Project a trace on the line and join its samples metre by metre.

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
    if near.sum() < 2:
        return None
    column = {cell: index for index, cell in enumerate(cells)}
    rsrp = np.full((int(near.sum()), len(cells)), np.nan)
    rsrp[:, [column[cell] for cell in trace.cells]] = trace.rsrp_dbm[near]
    chainage_m = smooth_chainage(feet.chainage_m[near], feet.offset_m[near], trace.time_s[near])
    joined = _join(chainage_m, rsrp)
    if len(joined.chainage_m) < 2:
        return None
    group = trace.recorded_at.date().isoformat() if trace.recorded_at else name
    return RoadPass(joined.chainage_m, joined.rsrp_dbm, joined.heard, group)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    chainage_m: Floats
    rsrp_dbm: Floats
    heard: Floats


def _join(chainage_m: Floats, rsrp_dbm: Floats) -> _Rows:
    row = _runs(np.rint(chainage_m / ROW_M).astype(int))
    starts = np.flatnonzero(np.concatenate([[True], np.diff(row) != 0]))
    size = np.diff(np.append(starts, len(row)))
    known = ~np.isnan(rsrp_dbm)
    count = np.add.reduceat(known.astype(float), starts, axis=0)
    total = np.add.reduceat(np.where(known, rsrp_dbm, 0.0), starts, axis=0)
    with np.errstate(invalid="ignore"):
        mean = total / count
    return _Rows(np.add.reduceat(chainage_m, starts) / size, mean, count / size[:, None])


def _runs(metre: Int[np.ndarray, " samples"]) -> Int[np.ndarray, " samples"]:
    """Number the stretches of samples that stay in one metre, in driving order."""
    return np.concatenate([[0], np.cumsum(np.diff(metre) != 0)])
