"""From a request to a window: one vectorised look, spelled out only when something is wrong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.api.checks import (
    ANY_RSRP_RANGE_DBM,
    check_cells,
    check_length,
    check_rising,
    check_rows,
    check_rsrp,
    check_within,
)
from app.api.faults import Faults
from app.api.schemas.locate import LocateRequest
from app.api.state import Limits
from app.domain import Window

Floats = NDArray[np.float64]

MAX_WINDOW_LENGTH_M = 100_000.0  # beyond any window; keeps sums of squares far from overflow
MAX_SPEED_MPS = 150.0  # faster than a road vehicle, slower than a unit mistaken by 3.6 twice
LOW_DBM, HIGH_DBM = ANY_RSRP_RANGE_DBM


def window_of(request: LocateRequest, limits: Limits) -> Window:
    """
    The window that a request describes, its distance counted from its first sample.

    Raises:
        InvalidInput: With every fault found, as `faults_of_window` lists them.
    """
    window = _clean_window(request, limits)
    if window is None:
        raise faults_of_window(request, limits).error()
    return window


def _clean_window(request: LocateRequest, limits: Limits) -> Window | None:
    """The fast twin of `faults_of_window`: the window, or None when there is any fault."""
    cells, rows = request.cells, request.rsrp_dbm
    if len(rows) > limits.max_window_samples or len(cells) > limits.max_window_cells:
        return None
    way_m = _distance_m(request, len(rows))
    if way_m is None or len(set(cells)) != len(cells):
        return None
    try:
        rsrp_dbm = np.array(rows, dtype=np.float64)  # None becomes NaN
    except ValueError:  # ragged
        return None
    if not rsrp_dbm.size or rsrp_dbm.shape != (len(rows), len(cells)):
        return None
    if np.fmin.reduce(rsrp_dbm, None) < LOW_DBM or np.fmax.reduce(rsrp_dbm, None) > HIGH_DBM:
        return None
    return Window(tuple(cells), way_m, rsrp_dbm, request.distance_error)


def _distance_m(request: LocateRequest, samples: int) -> Floats | None:
    """Metres from the first sample, or None when the way is told wrongly."""
    told_m = request.distance_m
    if told_m is None:
        return _integrated_m(request, samples)
    if request.time_s is not None or request.speed_mps is not None:
        return None
    # Plain Python: on lists this short it is faster than numpy, and sorting what is sorted is free.
    if len(told_m) != samples or not told_m or sorted(told_m) != told_m:
        return None
    if not told_m[-1] - told_m[0] <= MAX_WINDOW_LENGTH_M:
        return None
    return np.array(told_m) - told_m[0]


def _integrated_m(request: LocateRequest, samples: int) -> Floats | None:
    """Metres from the first sample by time and speed, or None when these are told wrongly."""
    if request.time_s is None or request.speed_mps is None or len(request.time_s) != samples:
        return None
    time_s, speed_mps = np.array(request.time_s), np.asarray(request.speed_mps, dtype=np.float64)
    if not samples or (speed_mps.ndim and speed_mps.size != samples):
        return None
    if speed_mps.min() < 0 or speed_mps.max() > MAX_SPEED_MPS or (np.diff(time_s) < 0).any():
        return None
    way_m = travelled_m(time_s, speed_mps)
    return way_m if way_m[-1] <= MAX_WINDOW_LENGTH_M else None


def travelled_m(time_s: Floats, speed_mps: Floats) -> Floats:
    """Distance from the first sample: the trapezoidal integral of speed over time, metres."""
    each_mps = np.broadcast_to(speed_mps, time_s.shape)
    steps_m = np.diff(time_s) * (each_mps[1:] + each_mps[:-1]) / 2.0
    return np.concatenate(([0.0], np.cumsum(steps_m)))


def faults_of_window(request: LocateRequest, limits: Limits) -> Faults:
    """All that is wrong with a window, in the order of its fields: the definition of a refusal."""
    faults = Faults()
    samples = len(request.rsrp_dbm)
    check_cells(request.cells, faults)
    if len(request.cells) > limits.max_window_cells:
        faults.add("/cells", f"{len(request.cells)} cells; {limits.max_window_cells} are the most")
    if not samples:
        faults.add("/rsrp_dbm", "the window has no sample")
    if samples > limits.max_window_samples:
        faults.add("/rsrp_dbm", f"{samples} samples; {limits.max_window_samples} are the most")
    if check_rows(request.rsrp_dbm, len(request.cells), faults) and samples and request.cells:
        check_rsrp(np.array(request.rsrp_dbm, dtype=np.float64), None, faults)
    if request.distance_m is not None:
        _check_distance(request, request.distance_m, samples, faults)
    else:
        _check_time_and_speed(request, samples, faults)
    return faults


def _check_distance(
    request: LocateRequest, told_m: list[float], samples: int, faults: Faults
) -> None:
    for name in ("time_s", "speed_mps"):
        if getattr(request, name) is not None:
            faults.add(f"/{name}", "the way is told by distance_m already")
    check_length("/distance_m", len(told_m), samples, faults)
    check_rising("/distance_m", np.array(told_m, dtype=np.float64), "m", faults)
    _check_extent("/distance_m", told_m[-1] - told_m[0] if told_m else 0.0, faults)


def _check_time_and_speed(request: LocateRequest, samples: int, faults: Faults) -> None:
    if request.time_s is None or request.speed_mps is None:
        faults.add("/distance_m", "the way is missing: send distance_m, or time_s and speed_mps")
        return
    time_s = np.array(request.time_s, dtype=np.float64)
    check_length("/time_s", time_s.size, samples, faults)
    check_rising("/time_s", time_s, "s", faults)
    speed_mps = np.asarray(request.speed_mps, dtype=np.float64)
    if speed_mps.ndim:
        check_length("/speed_mps", speed_mps.size, samples, faults)
        check_within("/speed_mps", speed_mps, (0.0, MAX_SPEED_MPS), "m/s", faults)
    elif not 0.0 <= speed_mps <= MAX_SPEED_MPS:
        faults.add("/speed_mps", f"{speed_mps:.10g} m/s is outside 0..{MAX_SPEED_MPS:g}")
    if not faults.count:
        _check_extent("/time_s", float(travelled_m(time_s, speed_mps)[-1]), faults)


def _check_extent(pointer: str, length_m: float, faults: Faults) -> None:
    if not length_m <= MAX_WINDOW_LENGTH_M:
        faults.add(
            pointer, f"the window is {length_m:.10g} m long; {MAX_WINDOW_LENGTH_M:g} is the most"
        )
