"""
Held-out windows as one float32 table, which is how a road model carries them.

Rows of one window follow each other: one that tells its truth, then one a reading. Before them all
one says what the readings have in common that windows may be drawn from. Columns: number of the
window, what the row is, and four values; three in older models, whose truths had no doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from app.numerics.independence import NOT_SEEN, Shared

COLUMNS = 6
# chainage, sign, fold, doubt | distance, cell, dBm, 0 | `app.numerics.independence.Shared`, 0, 0
TRUTH, READING, SHARED = range(3)
NO_CELL = -1.0  # of a sample that heard nothing, which is evidence too
DRAWN = -2  # fold of windows that nobody drove
DRAWN_BLINDLY = -1  # of those drawn, in older models, whatever the road's readings are like


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """
    A window that the curves of its fold have not seen.

    Attributes:
        distance_m: Of each sample, the last one at 0. Shape ``(samples,)``.
        rsrp_dbm: Shape ``(samples, cells)``; NaN = not heard.
        cells: Numbers of the columns among the road model's cells. Shape ``(cells,)``.
        chainage_m: Where the last sample was taken.
        sign: +1 when driven towards growing chainage, else -1.
        fold: Which of the model's ``unseen`` curves lack its passes; `DRAWN` when its readings are
            drawn from the model.
        doubt_m: Standard deviation of what the truth itself errs by: as fixes scatter, where it was
            driven. A drawn one errs by as much as the map does whose only pass it was drawn from.
    """

    distance_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    cells: Int[np.ndarray, " cells"]
    chainage_m: float
    sign: int
    fold: int
    doubt_m: float = 0.0

    @property
    def measured(self) -> bool:
        """Whether somebody drove it."""
        return self.fold != DRAWN


def pack(
    windows: Sequence[HeldOut], shared: Shared | None = None
) -> Float32[np.ndarray, "rows columns"]:
    """
    The table of these windows.

    Args:
        shared: Of the only pass of a road; None = the windows were driven.
    """
    parts = [np.zeros((0, COLUMNS)) if shared is None else np.array([[0.0, SHARED, *shared, 0, 0]])]
    for number, one in enumerate(windows):
        sample, column = np.nonzero(~np.isnan(one.rsrp_dbm))
        silent = np.flatnonzero(np.isnan(one.rsrp_dbm).all(axis=1))
        block = np.zeros((1 + len(sample) + len(silent), COLUMNS))
        block[:, 0] = number
        block[0, 1:] = TRUTH, one.chainage_m, one.sign, one.fold, one.doubt_m
        block[1:, 1] = READING
        block[1:, 2] = one.distance_m[np.concatenate([sample, silent])]
        block[1:, 3] = np.concatenate([one.cells[column], np.full(len(silent), NO_CELL)])
        block[1 : 1 + len(sample), 4] = one.rsrp_dbm[sample, column]
        parts.append(block)
    return np.concatenate(parts).astype(np.float32)


def unpack(table: Float[np.ndarray, "rows columns"]) -> list[HeldOut]:
    """The windows of a model's table that tell something; none where it is of another layout."""
    table = table[table[:, 1] != SHARED] if table.shape[1] == COLUMNS else table
    if table.shape[1] not in (COLUMNS - 1, COLUMNS) or not len(table):
        return []
    starts = np.flatnonzero(table[:, 1] == TRUTH)
    every = [_window(block.astype(np.float64)) for block in np.split(table, starts[1:])]
    return [one for one in every if one.fold != DRAWN_BLINDLY]


def shared_of(table: Float[np.ndarray, "rows columns"]) -> Shared | None:
    """What the readings have in common that windows may be drawn from; None = there are none."""
    if table.shape[1] == COLUMNS and len(table) and table[0, 1] == SHARED:
        return Shared(*table[0, 2:4].tolist())
    return NOT_SEEN if any(not one.measured for one in unpack(table)) else None


def _window(block: Float[np.ndarray, "rows columns"]) -> HeldOut:
    _, _, chainage_m, sign, fold, *doubt_m = block[0].tolist()
    readings = block[1:]
    distance_m, sample = np.unique(readings[:, 2], return_inverse=True)
    heard = readings[:, 3] != NO_CELL
    cells, column = np.unique(readings[heard, 3].astype(np.intp), return_inverse=True)
    rsrp_dbm = np.full((len(distance_m), len(cells)), np.nan)
    rsrp_dbm[sample[heard], column] = readings[heard, 4]
    truth = (chainage_m, int(sign), int(fold), *doubt_m)
    return HeldOut(distance_m, rsrp_dbm, cells, *truth)
