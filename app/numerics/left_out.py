"""
Each pass against the curves of the others: all splines of all passes left out, in one banded solve.

The normal equations of a road's curves are sums over its passes, so what the others say is the sum
less one's own part. Systems of different cells and passes share no spline: laid end to end they are
one banded matrix, which one Cholesky factorisation solves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_solve_banded, cholesky_banded

from app.numerics.curves import DEGREE, MAX_LEVERAGE, NOISE_PRIOR_SAMPLES, RIDGE, Basis, penalty
from app.numerics.geodesy import Floats
from app.numerics.observation import sample_weight
from app.numerics.passes import RoadPass

LEAST_SUPPORT = 0.1  # readings of others a knot; with fewer about, their curve says nothing


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """
    A pass's readings one by one.

    Attributes:
        row, cell: Of each reading, its row in the pass and its column.
        rsrp_db: Above the cell's median on the road.
        weight: Share of an independent sample, for the shadowing that neighbours have in common.
    """

    row: Int[np.ndarray, " readings"]
    cell: Int[np.ndarray, " readings"]
    rsrp_db: Float[np.ndarray, " readings"]
    weight: Float[np.ndarray, " readings"]


@dataclass(frozen=True, slots=True, eq=False)
class Others:
    """
    What all passes but one say.

    Attributes:
        coefficients_db: Of every pass left out, shape ``(passes, cells, splines)``.
        support: Readings of the others about each spline, same shape.
        noise_db: Of each cell, shape ``(cells,)``.
        share: How much of the curves at a pass's readings comes from each other pass; rows sum to
            1 where there are others. Shape ``(passes, passes)``.
        strength: Of the penalty.
    """

    coefficients_db: Float[np.ndarray, "passes cells splines"]
    support: Float[np.ndarray, "passes cells splines"]
    noise_db: Float[np.ndarray, " cells"]
    share: Float[np.ndarray, "passes passes"]
    strength: float

    def spread_db(
        self,
        number: int,
        readings: Readings,
        first: Int[np.ndarray, " rows"],
        value: Float[np.ndarray, "rows 2"],
    ) -> Floats:
        """
        Spread of the readings about the others' curves; infinite where these say nothing.

        A penalty on first differences averages over ``2 sqrt(strength / support)`` knots, which
        puts ``1 / (4 sqrt(strength support))`` of the noise's variance into the curve.
        """
        near = self._at(self.support[number], readings, first[readings.row], value[readings.row])
        with np.errstate(divide="ignore"):
            leverage = np.minimum(0.25 / np.sqrt(self.strength * near), MAX_LEVERAGE)
        spread_db = self.noise_db[readings.cell] * np.sqrt(1.0 + leverage)
        return np.asarray(np.where(near >= LEAST_SUPPORT, spread_db, np.inf))

    def expected_db(
        self,
        number: int,
        readings: Readings,
        first: Int[np.ndarray, "lags rows"],
        value: Float[np.ndarray, "lags rows 2"],
    ) -> Float[np.ndarray, "lags readings"]:
        """The others' curves where the readings would be at each lag."""
        row = readings.row
        return self._at(self.coefficients_db[number], readings, first[:, row], value[:, row])

    @staticmethod
    def _at(table: Floats, readings: Readings, first: np.ndarray, value: Floats) -> Floats:
        flat = table.ravel()
        at = first + readings.cell * table.shape[1]
        total = flat[at] * value[..., 0]
        for j in range(1, DEGREE + 1):
            total += flat[at + j] * value[..., j]
        return total


def readings_of(passes: Sequence[RoadPass]) -> list[Readings]:
    """Of every pass, about the cells' medians over all of them."""
    rsrp_dbm = np.concatenate([one.rsrp_dbm for one in passes])
    silent = np.isnan(rsrp_dbm).all(axis=0)
    level_dbm = np.zeros(rsrp_dbm.shape[1])
    level_dbm[~silent] = np.nanmedian(rsrp_dbm[:, ~silent], axis=0)
    found = []
    for one in passes:
        row, cell = np.nonzero(~np.isnan(one.rsrp_dbm))
        weight = sample_weight(one.travelled_m)[row]
        found.append(Readings(row, cell, one.rsrp_dbm[row, cell] - level_dbm[cell], weight))
    return found


def leave_out(
    basis: Basis,
    readings: Sequence[Readings],
    chainage_m: Sequence[Floats],
    cells: int,
    strength: float,
) -> Others:
    """
    Fit the others of every pass.

    Args:
        readings: Of each pass, what is known of its level already taken out.
        chainage_m: Of each pass, where its rows are taken to be.
        cells: How many columns the passes have.
    """
    parts = [
        _sums(basis, one, where_m, cells) for one, where_m in zip(readings, chainage_m, strict=True)
    ]
    sums = np.stack(parts)  # passes, kinds of sum, cells, splines
    every = sums.sum(axis=0)
    # Asked of a pass are only the cells that it heard; of all passes together, for the noise, each.
    owner, cell = np.nonzero(sums[:, DEGREE + 2].any(axis=2))
    left = np.concatenate([every[:, cell] - sums[owner, :, cell].swapaxes(0, 1), every], axis=1)
    solved = _solve(left[: DEGREE + 1], left[DEGREE + 1], strength)
    coefficients_db = np.zeros((len(sums), cells, basis.size))
    coefficients_db[owner, cell] = solved[: len(owner)]
    count = np.bincount(np.concatenate([one.cell for one in readings]), minlength=cells)
    square = sum(
        (np.bincount(one.cell, one.rsrp_db**2, cells) for one in readings), np.zeros(cells)
    )
    misfit = np.maximum(square - (solved[len(owner) :] * every[DEGREE + 1]).sum(axis=1), 0.0)
    pooled = float(misfit.sum()) / max(int(count.sum()), 1)
    noise_db = np.sqrt((misfit + NOISE_PRIOR_SAMPLES * pooled) / (count + NOISE_PRIOR_SAMPLES))
    support = sums[:, DEGREE + 2]
    return Others(
        coefficients_db,
        every[DEGREE + 2] - support,
        np.maximum(noise_db, 1e-3),
        _share(support),
        strength,
    )


def _sums(
    basis: Basis, readings: Readings, chainage_m: Floats, cells: int
) -> Float[np.ndarray, "sums cells splines"]:
    """Bands of the Gram matrix, its right side, and the readings about each spline."""
    weights = basis.at(chainage_m)
    first, value = weights.first[readings.row], weights.value[readings.row]
    at = readings.cell * basis.size + first
    sums = np.zeros((DEGREE + 3, cells * basis.size))
    width = sums.shape[1]
    for i in range(DEGREE + 1):
        sums[DEGREE + 1] += np.bincount(at + i, value[:, i] * readings.rsrp_db, width)
        sums[DEGREE + 2] += np.bincount(at + i, value[:, i], width)
        for j in range(i, DEGREE + 1):
            sums[DEGREE - (j - i)] += np.bincount(at + j, value[:, i] * value[:, j], width)
    return sums.reshape(DEGREE + 3, cells, basis.size)


def _solve(
    gram: Float[np.ndarray, "bands systems splines"],
    right: Float[np.ndarray, "systems splines"],
    strength: float,
) -> Float[np.ndarray, "systems splines"]:
    """All systems end to end: no band reaches from one into the next."""
    matrix = gram + strength * penalty(gram.shape[2])[:, None]
    matrix[DEGREE] += RIDGE
    banded = matrix.reshape(DEGREE + 1, -1)
    factor = cholesky_banded(banded, overwrite_ab=True, check_finite=False)
    solved = cho_solve_banded((factor, False), right.ravel(), check_finite=False)
    return np.asarray(solved.reshape(right.shape))


def _share(support: Float[np.ndarray, "passes cells splines"]) -> Floats:
    flat = support.reshape(len(support), -1)
    every = flat.sum(axis=0)
    share = np.empty((len(flat), len(flat)))
    for number, own in enumerate(flat):
        others = every - own
        there = others > LEAST_SUPPORT
        share[number] = flat[:, there] @ (own[there] / others[there])
        share[number, number] = 0.0
    return share / np.maximum(share.sum(axis=1, keepdims=True), 1e-9)
