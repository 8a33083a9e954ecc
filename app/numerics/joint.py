"""Passes measured against each other: by what each differs, solved for all of them at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.numerics.geodesy import Floats

SMALLEST_PRECISION = 1e-6  # of a pass that says nothing


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """
    Values of passes of which only differences were measured: ``off = design value + noise``.

    Attributes:
        design: Each pass less what the others have of it. Shape ``(passes, passes)``.
        off: How far each pass was found from the others, shape ``(passes,)``.
        variance: Of the noise, same shape.
    """

    design: Float[np.ndarray, "passes passes"]
    off: Float[np.ndarray, " passes"]
    variance: Float[np.ndarray, " passes"]

    @classmethod
    def of(cls, found: Floats, precision: Floats, relative: Floats, now: Floats) -> Joint:
        """
        Each pass held against the others as they were corrected by ``now``.

        Args:
            found: Value at which the pass fits the others best, with its precision.
            relative: How much of each other pass's error is in that. Shape ``(passes, passes)``.
        """
        # Two passes tell their difference twice; of many each tells its own nearly once.
        once = (len(found) - 1) / len(found)
        variance = 1.0 / np.maximum(once * precision, SMALLEST_PRECISION)
        return cls(np.eye(len(found)) - relative, found - relative @ now, variance)

    def log_evidence(self, prior: Float[np.ndarray, "models passes passes"]) -> Floats:
        """Of each model of the values' covariance, up to a constant."""
        cover = self.design @ prior @ self.design.T + np.diag(self.variance)
        off = np.broadcast_to(self.off[:, None], (len(prior), len(self.off), 1))
        solved = np.linalg.solve(cover, off)[..., 0]
        return np.asarray(-0.5 * (solved @ self.off + np.linalg.slogdet(cover)[1]))

    def mean(self, prior: Float[np.ndarray, "passes passes"]) -> Floats:
        """Posterior mean of the values."""
        cover = self.design @ prior @ self.design.T + np.diag(self.variance)
        return np.asarray(prior @ self.design.T @ np.linalg.solve(cover, self.off))


def days_apart(
    joint: Joint, prior: Floats, day: Bool[np.ndarray, "passes passes"], log_odds: float
) -> Bool[np.ndarray, " passes"]:
    """
    Passes of the most probable set of days that differ from 0, changed day by day from none and
    from all.

    Args:
        prior: Covariance of the values where every day differs.
        day: Which passes are of one day.
        log_odds: Of a day's differing, before its passes are looked at.
    """
    days = np.unique(day, axis=0)
    flips = np.concatenate([np.zeros((1, day.shape[0]), dtype=bool), days])
    none = np.zeros(day.shape[0], dtype=bool)
    ends = [_climb(joint, prior, (days, flips), start, log_odds) for start in (none, ~none)]
    return max(ends, key=lambda end: end.log).which


@dataclass(frozen=True, slots=True, eq=False)
class _Set:
    """Which passes differ from 0, and the log probability of that."""

    which: np.ndarray
    log: float


def _climb(
    joint: Joint,
    prior: Floats,
    changes: tuple[np.ndarray, np.ndarray],
    start: np.ndarray,
    log_odds: float,
) -> _Set:
    days, flips = changes
    best = _Set(start, -np.inf)
    while True:
        tried = best.which ^ flips
        covered = prior * (tried[:, :, None] & tried[:, None, :])
        count = (tried[:, None, :] & days).any(axis=2).sum(axis=1)
        log = joint.log_evidence(covered) + log_odds * count
        first = int(np.argmax(log))
        if log[first] <= best.log + 1e-9:
            return best
        best = _Set(tried[first], float(log[first]))
