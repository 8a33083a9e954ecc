"""A stretch of a drive in even steps: rounding undone, jitter smoothed, samples known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.numerics.geodesy import Floats

STEP_M = 5.0  # finer than any road's bend, coarser than a smoothed fix's error
SHORTEST_M = 30.0
SMOOTHED_OVER = 3.0  # times the jitter, as the centre line of a road is
WIDTH_M = (4.0, 15.0)  # of the smoothing; wider would round off the corners of blocks
CALM = 0.6745  # median of |N(0, 1)|: a few corners must not count as jitter
COARSE_M = 3.0  # degrees with five decimals are rounded to 1 m, which smoothing removes
REPEATED = 0.5  # of the fixes: so few distinct values are rounded ones


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """
    A stretch of a drive in steps of `STEP_M`.

    Attributes:
        drive: Number of the drive that it is from.
        xy_m: Local metres. Shape ``(steps, 2)``.
        sample: Number of the drive's sample at each step, growing; fractions lie between samples.
    """

    drive: int
    xy_m: Float[np.ndarray, "steps 2"]
    sample: Float[np.ndarray, " steps"]

    @property
    def length_m(self) -> float:
        """Length of the piece."""
        return (len(self.xy_m) - 1) * STEP_M


def rounding_m(xy_m: Float[np.ndarray, "fixes 2"]) -> Float[np.ndarray, " 2"]:
    """What each axis of the fixes was rounded to; 0 where nothing says that it was."""
    found = np.zeros(2)
    for axis in (0, 1):
        values = np.unique(np.round(xy_m[:, axis], 2))
        if 2 < len(values) < REPEATED * len(xy_m):
            smallest_m = float(np.quantile(np.diff(values), 0.05))
            found[axis] = smallest_m if smallest_m >= COARSE_M else 0.0
    return found


def piece_of(
    drive: int,
    xy_m: Float[np.ndarray, "anchors 2"],
    rounded_m: Float[np.ndarray, " 2"],
    first: Int[np.ndarray, " anchors"],
    last: Int[np.ndarray, " anchors"],
) -> Piece | None:
    """
    Anchors of a drive as a piece; None when it is too short.

    Args:
        rounded_m: From `rounding_m`.
        first, last: Numbers of the first and last sample at each anchor.
    """
    way_m = _way_m(xy_m)
    if way_m[-1] < SHORTEST_M:
        return None
    exact = _unrounded(xy_m, way_m, rounded_m)
    width_m = float(np.clip(SMOOTHED_OVER * _jitter_m(exact), *WIDTH_M))
    even_m = _even_m(way_m[-1])
    smooth = _smoothed(_at(even_m, way_m, exact), width_m)
    # A stop has two samples at one place: the way between them grows by a hair.
    twice_m = np.stack([way_m, way_m + 1e-6], axis=1).ravel()
    sample = np.interp(even_m, twice_m, np.stack([first, last], axis=1).ravel())
    smooth_m = _way_m(smooth)
    if smooth_m[-1] < SHORTEST_M:
        return None
    steps_m = _even_m(smooth_m[-1])
    numbers = np.interp(steps_m, smooth_m, sample)
    numbers[0], numbers[-1] = first[0], last[-1]
    return Piece(drive, _at(steps_m, smooth_m, smooth), numbers)


def _unrounded(xy_m: Floats, way_m: Floats, rounded_m: Floats) -> Floats:
    """
    Rounded coordinates laid through the places where they change.

    Between two fixes whose rounded values differ the true one was half way; on a road that runs
    nearly along the axis these are the only fixes that say anything.
    """
    exact = xy_m.copy()
    for axis in np.flatnonzero(rounded_m > 0.0):
        value = xy_m[:, axis]
        change = np.flatnonzero(np.abs(np.diff(value)) > rounded_m[axis] / 2.0)
        known_m = [way_m[0], *((way_m[change] + way_m[change + 1]) / 2.0), way_m[-1]]
        known = [value[0], *((value[change] + value[change + 1]) / 2.0), value[-1]]
        exact[:, axis] = np.interp(way_m, known_m, known)
    return exact


def _even_m(length_m: float) -> Floats:
    """Both ends, and between them steps of `STEP_M` as nearly as they divide the length."""
    return np.linspace(0.0, length_m, max(1, round(length_m / STEP_M)) + 1)


def _way_m(xy_m: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy_m, axis=0).T))])


def _at(wanted_m: Floats, way_m: Floats, xy_m: Floats) -> Floats:
    return np.stack([np.interp(wanted_m, way_m, xy_m[:, axis]) for axis in (0, 1)], axis=1)


def _jitter_m(xy_m: Floats) -> float:
    """Standard deviation of a fix across its way, from how three neighbours bend."""
    if len(xy_m) < 3:
        return 0.0
    chord, bend = xy_m[2:] - xy_m[:-2], np.diff(xy_m, n=2, axis=0)
    across_m = chord[:, 0] * bend[:, 1] - chord[:, 1] * bend[:, 0]
    across_m /= np.maximum(np.hypot(*chord.T), 1e-9)
    return float(np.median(np.abs(across_m))) / (CALM * np.sqrt(6.0))


def _smoothed(xy_m: Floats, width_m: float) -> Floats:
    """Gaussian mean along the way; mirrored through its ends, so that they stay where they are."""
    reach = min(int(3.0 * width_m / STEP_M) + 1, len(xy_m) - 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * STEP_M / width_m) ** 2)
    kernel /= kernel.sum()
    padded = np.concatenate(
        [2.0 * xy_m[0] - xy_m[reach:0:-1], xy_m, 2.0 * xy_m[-1] - xy_m[-2 : -reach - 2 : -1]]
    )
    return np.stack([np.convolve(padded[:, axis], kernel, mode="valid") for axis in (0, 1)], axis=1)
