"""
In which order a device's rows were measured.

Files come sorted by time, by cell, newest first, or shuffled; and clocks are set while they log.
Sorting by time is right for all of the first and wrong after a clock was set back, where it would
weave two stretches of the drive into one another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

METRES_PER_DEGREE = 111_195.0  # of a sphere of 6,371 km, along a meridian
LEAST_DETOUR_M = 25.0  # GPS noise makes less; a weave of a second at walking pace makes no harm
SAMPLES_PER_STEP = 20  # a clock is set now and then, not at every other sample

Floats = NDArray[np.float64]
Places = NDArray[np.intp]


def steps_m(lon: Floats, lat: Floats) -> Floats:
    """
    Distance of each position from the one before, metres; shape ``(positions - 1,)``.

    Flat at each pair's latitude, longitudes wrapped: exact enough to compare orders and to find
    jumps, also across the antimeridian.
    """
    east_deg = (np.diff(lon) + 180.0) % 360.0 - 180.0
    scale = np.cos(np.radians(0.5 * (lat[1:] + lat[:-1])))
    return np.hypot(east_deg * scale, np.diff(lat)) * METRES_PER_DEGREE


def runs_in_time(time_s: Floats, lon: Floats, lat: Floats) -> list[Places]:
    """
    Rows as runs of non-decreasing time: one run sorted by time, or several cut at clock steps.

    Both readings of the file are laid out; when the sorted one is the longer way, the clock was set
    back and the file's own order is the truth. Rows of one time keep the file's order.
    """
    falls = np.flatnonzero(np.diff(time_s) < 0.0) + 1
    if not falls.size:
        return [np.arange(len(time_s))]
    ordered = np.argsort(time_s, kind="stable")
    if falls.size * SAMPLES_PER_STEP > np.count_nonzero(np.diff(time_s)):
        return [ordered]
    runs = np.split(np.arange(len(time_s)), falls)
    as_written_m = sum(float(steps_m(lon[run], lat[run]).sum()) for run in runs)
    as_sorted_m = float(steps_m(lon[ordered], lat[ordered]).sum())
    return runs if as_sorted_m > as_written_m + LEAST_DETOUR_M else [ordered]
