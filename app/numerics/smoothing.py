"""
Positions of a drive without their jitter.

A car's speed changes slowly, a receiver's error does not. The error is read off the fixes' distance
from the road, to which driving adds nothing; how much the speed changes is what makes the fixes'
progress along the road most probable. The smoothed progress is the maximum a posteriori given both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve_banded, cholesky_banded

from app.numerics.geodesy import Floats

FAINT_M = 0.5  # receivers that filter their own fixes show less; smoothing them again adds nothing
MIN_FIXES = 8
ACCELERATIONS_MPS2 = tuple(np.geomspace(0.05, 3.2, 13).tolist())  # a steady drive .. a town's
ASKED = 32  # fixes, evenly over a drive, whose doubt stands for all of them
CALM = 0.6745  # median of |N(0, 1)|: a few sharp turns of the wheel must not count as jitter


class Smooth(NamedTuple):
    """
    A drive's progress.

    Attributes:
        doubt_m: How far a place may still be wrong: standard deviation, over all of the drive.
    """

    chainage_m: Float[np.ndarray, " fixes"]
    doubt_m: float


class _Smoothed(NamedTuple):
    """
    Progress without jitter, how improbable it makes the fixes, and what it was solved with.

    Attributes:
        factor: Of the normal equations, whose inverse is the covariance in units of the jitter's.
    """

    progress_m: Floats
    deviance: float
    factor: Float[np.ndarray, "3 fixes"]

    def doubt_m(self, jitter_m: float) -> float:
        """Standard deviation of the progress, the mean over fixes."""
        size = len(self.progress_m)
        asked = np.unique(np.rint(np.linspace(0, size - 1, ASKED)).astype(int))
        units = np.zeros((size, len(asked)))
        units[asked, np.arange(len(asked))] = 1.0
        solved = cho_solve_banded((self.factor, True), units)
        return jitter_m * float(np.sqrt(solved[asked, np.arange(len(asked))].mean()))


def smooth_chainage(
    chainage_m: Float[np.ndarray, " fixes"],
    offset_m: Float[np.ndarray, " fixes"],
    time_s: Float[np.ndarray, " fixes"],
) -> Smooth:
    """
    Chainage of each fix with the receiver's jitter taken out.

    Minimises ``sum((c - z)^2) / sigma^2 + sum(a^2) / q^2`` over the progress ``z``, where ``a`` are
    its accelerations, ``sigma`` the jitter and ``q`` the spread of accelerations.

    Args:
        chainage_m, offset_m: Of each fix on the road; offset across it.
        time_s: Non-decreasing.

    Returns:
        ``chainage_m`` itself, without doubt, where there are too few fixes or too little jitter to
        speak of.
    """
    moving = np.concatenate(([True], np.diff(time_s) > 0.0))
    if moving.sum() < MIN_FIXES:
        return Smooth(chainage_m, 0.0)
    second = _second_differences(time_s[moving])
    jitter_m = _spread(second, offset_m[moving], _noise_gain(second))
    if jitter_m < FAINT_M:
        return Smooth(chainage_m, 0.0)
    tried = [
        _smoothed(second, chainage_m[moving], jitter_m, acceleration)
        for acceleration in ACCELERATIONS_MPS2
    ]
    best = min(tried, key=lambda one: one.deviance)
    return Smooth(best.progress_m[np.cumsum(moving) - 1], best.doubt_m(jitter_m))


def _second_differences(time_s: Floats) -> Float[np.ndarray, "inner 3"]:
    """Weights of three neighbouring fixes that make their acceleration, m/s^2 for metres."""
    before, after = np.diff(time_s)[:-1], np.diff(time_s)[1:]
    middle = (before + after) / 2.0
    left, right = 1.0 / (before * middle), 1.0 / (after * middle)
    return np.stack([left, -left - right, right], axis=1)


def _noise_gain(second: Float[np.ndarray, "inner 3"]) -> Float[np.ndarray, " inner"]:
    return np.asarray(np.sqrt((second**2).sum(axis=1)))


def _spread(second: Floats, values: Floats, gain: Floats) -> float:
    triples = np.lib.stride_tricks.sliding_window_view(values, 3)
    return float(np.median(np.abs((second * triples).sum(axis=1)) / gain)) / CALM


def _smoothed(
    second: Floats, chainage_m: Floats, jitter_m: float, acceleration_mps2: float
) -> _Smoothed:
    """
    The smoother for one spread of accelerations: pentadiagonal normal equations, lower banded.

    The progress is a Gaussian process known but for its start and speed. With ``P`` the sum of
    squared second differences and ``s = (sigma / q)^2``, twice the restricted log likelihood is
    ``-(misfit / sigma^2 + log det(1 + s P) - rank(P) log s)`` and a constant (Wood 2011).
    """
    size, strength = len(chainage_m), (jitter_m / acceleration_mps2) ** 2
    banded = np.zeros((3, size))
    banded[0] = 1.0
    for i in range(3):
        for j in range(i, 3):
            banded[j - i, i : size - 2 + i] += strength * second[:, i] * second[:, j]
    factor = cholesky_banded(banded, lower=True)
    progress_m = cho_solve_banded((factor, True), chainage_m)
    misfit = float(chainage_m @ (chainage_m - progress_m)) / jitter_m**2
    determinant = 2.0 * float(np.log(factor[0]).sum())
    return _Smoothed(
        progress_m, misfit + determinant - len(second) * float(np.log(strength)), factor
    )
