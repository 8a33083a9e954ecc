"""
How probable a window's readings are at each place where it may have been driven.

At a place the n readings of one cell are Gaussian, with the mean and covariance of the cell's curve
at the n chainages, to which the readings' noise adds:

    C = covariance of the curve + r I,    P = C^-1,    e = x - mean

A device offset of variance v, the same for all cells, is integrated out (the matrix determinant
lemma). With ``Q = sum e' P e + log det C``, ``R = sum 1' P e`` and ``W = sum 1' P 1`` over cells

    log density = -Q / 2 + v R^2 / (2 (1 + v W)) - log(1 + v W) / 2 + constant
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.evaluation.survey_bound.curves import Curve


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """The Gaussian law of one cell's readings at each of many places."""

    mean_dbm: Float[np.ndarray, "places samples"]
    precision: Float[np.ndarray, "places samples samples"]
    log_det: Float[np.ndarray, " places"]


@dataclass(slots=True, eq=False)
class Terms:
    """``Q``, ``R`` and ``W`` at every place of every window, summed over cells."""

    misfit: Float[np.ndarray, "places windows"]
    residual: Float[np.ndarray, "places windows"]
    weight: Float[np.ndarray, "places windows"]

    @classmethod
    def none(cls, places: int, windows: int) -> Terms:
        """Of no cell."""
        return cls(*(np.zeros((places, windows)) for _ in range(3)))

    def add(self, law: Law, readings_dbm: Float[np.ndarray, "windows samples"]) -> None:
        """
        Add a cell; of each window other readings may be missing (NaN).

        All windows at once by matrix products, the forms multiplied out; levels are told against
        their mean, so that little cancels. Where readings are missing any value stands in first.
        """
        lost = np.isnan(readings_dbm)
        mine = np.flatnonzero(~lost.all(axis=1))
        if not len(mine):
            return
        lost, middle = lost[mine], float(np.nanmean(readings_dbm))
        x, mean = np.nan_to_num(readings_dbm[mine] - middle, nan=0.0), law.mean_dbm - middle
        pull = np.einsum("pij,pj->pi", law.precision, mean)
        each = law.precision.sum(axis=2)
        squares = (x[:, :, None] * x[:, None, :]).reshape(len(x), -1)
        misfit = law.precision.reshape(len(mean), -1) @ squares.T - 2.0 * pull @ x.T
        misfit += ((mean * pull).sum(axis=1) + law.log_det)[:, None]
        residual = each @ x.T - pull.sum(axis=1)[:, None]
        weight = np.repeat(each.sum(axis=1)[:, None], len(x), axis=1)
        for number in np.flatnonzero(lost.any(axis=1)).tolist():
            less = _lost(law, lost[number], pull, each, x[number])
            misfit[:, number] -= less.misfit
            residual[:, number] -= less.residual
            weight[:, number] -= less.weight
        self.misfit[:, mine] += misfit
        self.residual[:, mine] += residual
        self.weight[:, mine] += weight

    def log_density(self, offset_db2: float) -> Float[np.ndarray, "places windows"]:
        """The logarithm of the density, but for a constant of each window."""
        spread = 1.0 + offset_db2 * self.weight
        gain = offset_db2 * self.residual**2 / spread - np.log(spread)
        return 0.5 * (gain - self.misfit)


@dataclass(frozen=True, slots=True, eq=False)
class _Less:
    """What missing readings take from ``Q``, ``R`` and ``W``."""

    misfit: Float[np.ndarray, " places"]
    residual: Float[np.ndarray, " places"]
    weight: Float[np.ndarray, " places"]


def _lost(
    law: Law,
    lost: Bool[np.ndarray, " samples"],
    pull: Float[np.ndarray, "places samples"],
    each: Float[np.ndarray, "places samples"],
    x: Float[np.ndarray, " samples"],
) -> _Less:
    """
    The marginal law of what was heard, whatever stands in for the lost readings m.

    Its forms are the least over e_m: ``u' P v - (P u)_m' P_mm^-1 (P v)_m`` for u, v in {e, 1}; the
    determinant of its covariance is that of all readings' times ``det P_mm``.
    """
    rows = law.precision[:, lost]
    within = rows[:, :, lost]
    slope = np.stack([rows @ x - pull[:, lost], each[:, lost]], axis=2)
    moved = np.linalg.solve(within, slope)
    forms = np.einsum("pmi,pmj->pij", slope, moved)
    log_det = np.linalg.slogdet(within)[1]
    return _Less(forms[:, 0, 0] - log_det, forms[:, 0, 1], forms[:, 1, 1])


def law_at(
    curve: Curve, reading_db2: float, chainage_m: Float[np.ndarray, "places samples"]
) -> Law:
    """
    The law of a cell's readings.

    Args:
        chainage_m: Of each sample, of a window at each place.
    """
    covariance = curve.covariance_at_db2(chainage_m) + reading_db2 * np.eye(chainage_m.shape[1])
    log_det = np.linalg.slogdet(covariance)[1]
    return Law(curve.mean_at_dbm(chainage_m), np.linalg.inv(covariance), log_det)
