"""
Held-out windows as one float32 table, which is how a road model carries them.

Rows of one window follow each other: one that tells its truth, one a reading, one a place where it
fits on its own road. Columns: number of the window, what the row is, and six values or more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from app.numerics.posterior import VALUES, Places

COLUMNS = 8  # and two more for each carrier after the first that any window heard
TRUTH, READING, PLACE = range(3)  # chainage, sign, measured | distance, cell, dBm | sign, values
NO_CELL = -1.0  # of a sample that heard nothing, which is evidence too


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """
    A window that its road's curves have not seen.

    Attributes:
        distance_m: Of each sample, the last one at 0. Shape ``(samples,)``.
        rsrp_dbm: Shape ``(samples, cells)``; NaN = not heard.
        cells: Numbers of the columns among the road model's cells. Shape ``(cells,)``.
        chainage_m: Where the last sample was taken.
        sign: +1 when driven towards growing chainage, else -1.
        measured: False when the readings are drawn from the model.
        places: Where on its own road the window fits; scores do not hold offsets yet, values have a
            residual and a weight of each carrier.
    """

    distance_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    cells: Int[np.ndarray, " cells"]
    chainage_m: float
    sign: int
    measured: bool
    places: Places


def pack(windows: Sequence[HeldOut]) -> Float32[np.ndarray, "rows columns"]:
    """The table of these windows."""
    columns = 3 + max([VALUES, *(len(one.places.values) for one in windows)])
    parts = [np.zeros((0, columns))]
    for number, one in enumerate(windows):
        truth = np.zeros((1, columns))
        truth[0, 1:5] = TRUTH, one.chainage_m, one.sign, one.measured
        sample, column = np.nonzero(~np.isnan(one.rsrp_dbm))
        silent = np.flatnonzero(np.isnan(one.rsrp_dbm).all(axis=1))
        readings = np.zeros((len(sample) + len(silent), columns))
        readings[:, 1] = READING
        readings[:, 2] = one.distance_m[np.concatenate([sample, silent])]
        readings[:, 3] = np.concatenate([one.cells[column], np.full(len(silent), NO_CELL)])
        readings[: len(sample), 4] = one.rsrp_dbm[sample, column]
        places = np.zeros((len(one.places), columns))
        places[:, 1], places[:, 2] = PLACE, one.places.sign
        places[:, 3 : 3 + len(one.places.values)] = one.places.values.T
        block = np.concatenate([truth, readings, places])
        block[:, 0] = number
        parts.append(block)
    return np.concatenate(parts).astype(np.float32)


def unpack(table: Float[np.ndarray, "rows columns"], road: int) -> list[HeldOut]:
    """
    The windows of a model's table; none where it is of another layout.

    Args:
        road: Number that the places get.
    """
    if table.shape[1] < COLUMNS or table.shape[1] % 2 or not len(table):
        return []
    starts = np.flatnonzero(table[:, 1] == TRUTH)
    return [_window(block.astype(np.float64), road) for block in np.split(table, starts[1:])]


def _window(block: Float[np.ndarray, "rows columns"], road: int) -> HeldOut:
    _, _, chainage_m, sign, measured = block[0, :5].tolist()
    readings = block[block[:, 1] == READING]
    places = block[block[:, 1] == PLACE]
    distance_m, sample = np.unique(readings[:, 2], return_inverse=True)
    heard = readings[:, 3] != NO_CELL
    cells, column = np.unique(readings[heard, 3].astype(np.intp), return_inverse=True)
    rsrp_dbm = np.full((len(distance_m), len(cells)), np.nan)
    rsrp_dbm[sample[heard], column] = readings[heard, 4]
    signs = places[:, 2].astype(np.int64)
    where = np.stack([np.full_like(signs, road), signs])
    values = np.ascontiguousarray(places[:, 3:].T)
    return HeldOut(
        distance_m, rsrp_dbm, cells, chainage_m, int(sign), bool(measured), Places(where, values)
    )
