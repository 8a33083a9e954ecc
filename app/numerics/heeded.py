"""What of a window counts for less, or not at all: for explanations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain import Window
from app.numerics import carriers
from app.numerics.index import MapIndex
from app.numerics.query import Query
from app.numerics.wild import without_wild


class WildReading(NamedTuple):
    """A reading that its neighbours contradict (`app.numerics.wild`), and where it was read."""

    cell: str
    behind_m: float
    rsrp_dbm: float


def silence_of(query: Query) -> float:
    """For how much it counts that the window lists no other cells (`app.numerics.listing`)."""
    number = carriers.numbers(query.cells)
    # The shares of a carrier's cells sum to that, in any sample that heard it.
    return float((query.fine.share @ (number[:, None] == number)).max(initial=0.0)) or 1.0


def left_out(index: MapIndex, window: Window, query: Query) -> tuple[tuple[WildReading, ...], int]:
    """
    Readings of the map's cells that the query lacks.

    Returns:
        Wild ones, oldest first, and how many others.
    """
    used = slice(len(window.distance_m) - query.samples, None)
    known = sorted(cell for cell in window.cells if cell in index.cells)
    columns = [window.cells.index(cell) for cell in known]
    distance_m, read_dbm = window.distance_m[used], window.rsrp_dbm[used][:, columns]
    behind_m = distance_m[-1] - distance_m
    strays = np.isnan(without_wild(distance_m, read_dbm)) & ~np.isnan(read_dbm)
    rows, at = (found.tolist() for found in strays.nonzero())
    wild = tuple(
        WildReading(known[cell], float(behind_m[row]), float(read_dbm[row, cell]))
        for row, cell in zip(rows, at, strict=True)
    )
    missing = np.count_nonzero(~np.isnan(read_dbm)) - np.count_nonzero(~np.isnan(query.rsrp_dbm))
    return wild, int(missing) - len(wild)
