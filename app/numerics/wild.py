"""
Wild readings: single levels that their neighbours contradict.

A log may hold a level that no antenna sent there: a filler, the value of the cell before, a name
put to the wrong one. Scores of places are Gaussian, so that one reading 30 dB off outweighs ten
good ones. Hampel's filter finds such readings without a map: each is compared with the median of
the five of its cell about it, which leaves slopes and steps as they are, and is left out where it
strays from that by more than the levels of these readings ever do. Of the first and the last sample
nobody knows whether what follows would have contradicted it: where most of its readings stray, it
is a step, at the mouth of a tunnel or round a corner.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

NEIGHBOURS = 2  # on either side
REACH_M = 40.0  # farther away a level may be any
LEAST_TO_TELL = 3  # readings, the one itself included
SURE_DB = 10.0  # nothing nearer is wild
TIMES = 4.5  # the median step from one reading of a cell to the next


def without_wild(
    distance_m: Float[np.ndarray, " samples"], rsrp_dbm: Float[np.ndarray, "samples cells"]
) -> Float[np.ndarray, "samples cells"]:
    """
    The readings, NaN where they are wild; the same array where none is.

    Args:
        distance_m: Travelled, non-decreasing.
    """
    usual_dbm, steps_db = _usual(distance_m, rsrp_dbm)
    stray_db = np.abs(rsrp_dbm - usual_dbm)
    if not (stray_db > SURE_DB).any():
        return rsrp_dbm
    wild = stray_db > max(SURE_DB, TIMES * float(np.median(steps_db)))
    for end in (0, -1):
        if 2 * wild[end].sum() > np.count_nonzero(~np.isnan(stray_db[end])):
            wild[end] = False
    return np.where(wild, np.nan, rsrp_dbm) if wild.any() else rsrp_dbm


def _usual(
    distance_m: Float[np.ndarray, " samples"], rsrp_dbm: Float[np.ndarray, "samples cells"]
) -> tuple[Float[np.ndarray, "samples cells"], Float[np.ndarray, " steps"]]:
    """Median about each reading, NaN where too few are near; all steps between near readings."""
    usual_dbm, steps_db = np.full(rsrp_dbm.shape, np.nan), [np.zeros(0)]
    for cell in range(rsrp_dbm.shape[1]):
        heard = np.flatnonzero(~np.isnan(rsrp_dbm[:, cell]))
        level_dbm, at_m = rsrp_dbm[heard, cell], distance_m[heard]
        steps_db.append(np.abs(np.diff(level_dbm))[np.diff(at_m) <= REACH_M])
        about = np.arange(len(heard))[:, None] + np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
        there = (about >= 0) & (about < len(heard))
        about = np.where(there, about, 0)
        there &= np.abs(at_m[about] - at_m[:, None]) <= REACH_M
        told = there.sum(axis=1) >= LEAST_TO_TELL
        levels = np.where(there, level_dbm[about], np.nan)[told]
        usual_dbm[heard[told], cell] = np.nanmedian(levels, axis=1)
    return usual_dbm, np.concatenate(steps_db)
