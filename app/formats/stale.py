"""
Neighbours' levels that a phone says again because its modem has not measured anew.

Modems refresh all neighbours at once, every second or every ten, and tools log what they have. Old
levels smear each place over the way driven since; `docs/formats.md` has what that costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.formats.rows import Rows

LEAST_EQUAL = 3  # of levels in whole dB one in five repeats by chance, three at once in 3 of 100
LONGEST_S = 10.0  # after a longer silence equal levels say that the car stood


def repeated_neighbours(rows: Rows, sample: NDArray[np.intp]) -> NDArray[np.bool_]:
    """
    Readings of samples whose neighbours are all, cell by cell, those of the sample before.

    Only where a serving cell is told: it stays, and with it the sample's place.

    Args:
        rows: Of one drive in the order of time, a cell once a sample.
        sample: Number of each row's sample, from 0.
    """
    count = int(sample[-1]) + 1
    other = rows.serving != 1
    order = np.lexsort((sample, rows.cell))
    again = np.zeros(len(rows), bool)
    behind, before = order[1:], order[:-1]
    again[behind] = (
        (rows.cell[behind] == rows.cell[before])
        & (sample[behind] == sample[before] + 1)
        & (rows.rsrp_dbm[behind] == rows.rsrp_dbm[before])
        & (rows.time_s[behind] - rows.time_s[before] <= LONGEST_S)
        & other[behind]
        & other[before]
    )
    told = np.bincount(sample[other], minlength=count)
    equal = np.bincount(sample[again], minlength=count)
    stale = (equal == told) & (equal >= LEAST_EQUAL)
    stale[1:] &= told[1:] == told[:-1]
    stale &= np.bincount(sample[~other], minlength=count) > 0
    return np.asarray(other & stale[sample])
