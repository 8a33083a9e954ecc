"""
One curve a cell: RSRP as a penalised B-spline of chainage, all passes of a road fitted together.

The spline is a P-spline (Eilers and Marx 1996), straight between its knots, with a penalty on first
differences: a random walk, which is what shadowing that forgets exponentially (Gudmundson 1991) is
at short range. A smoother spline would round off what such a field does between two knots. The
penalty's strength is chosen for the whole road by restricted likelihood (Wood 2011): how rough the
radio field is and how noisy the readings are is a property of the place, not of one cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded

from app.numerics.geodesy import Floats

DEGREE = 1
STRENGTHS = tuple(float(10**power) for power in np.arange(-1.5, 2.51, 0.5))
RIDGE = 1e-4  # keeps stretches without a sample solvable; pulls to the cell's own median
NOISE_PRIOR_SAMPLES = 20  # a cell with few readings borrows the road's noise
LEAST_NOISE_DB = 0.1  # of levels that never moved: receivers report steps, of 1 dB most of them
ROUNDING = 1e-9  # dB^2: what is left of levels that a curve meets exactly
MAX_LEVERAGE = 8.0  # far from any sample the spread says "unknown", not infinity


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """Linear B-splines with evenly spaced knots over ``[0, length_m]``."""

    knots_m: Floats
    size: int

    @classmethod
    def over(cls, length_m: float, spacing_m: float) -> Basis:
        """Cover ``length_m`` with whole steps of ``spacing_m``."""
        spans = max(1, int(np.ceil(length_m / spacing_m)))
        knots_m = np.arange(-DEGREE, spans + DEGREE + 1, dtype=np.float64) * spacing_m
        return cls(knots_m, spans + DEGREE)

    def at(self, chainage_m: Floats) -> Weights:
        """The two splines that are not zero at each chainage; beyond an end, that end."""
        end_m = self.knots_m[-DEGREE - 1]
        inside = np.clip(chainage_m, 0.0, np.nextafter(end_m, 0.0))
        design = BSpline.design_matrix(inside, self.knots_m, DEGREE)
        width = DEGREE + 1
        return Weights(design.indices[::width].astype(int), design.data.reshape(-1, width))


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Non-zero spline values: ``value[i, j]`` belongs to spline ``first[i] + j``."""

    first: np.ndarray
    value: Floats

    def times(self, coefficients: Floats) -> Floats:
        """The spline with these coefficients, at the places the weights were made for."""
        reach = self.first[:, None] + np.arange(self.value.shape[1])
        return np.einsum("pj,pj...->p...", self.value, coefficients[reach])


@dataclass(frozen=True, slots=True, eq=False)
class FittedCurves:
    """
    All cells' splines of one road.

    Attributes:
        coefficients_dbm: Shape ``(splines, cells)``.
        noise_db: Spread of a reading about its cell's true curve, shape ``(cells,)``.
        mean_dbm: The curves on the grid, shape ``(grid, cells)``.
        spread_db: Spread of a new reading about ``mean_dbm``: noise and the fit's own doubt.
        strength: The penalty that the restricted likelihood chose.
    """

    basis: Basis
    coefficients_dbm: Floats
    noise_db: Floats
    mean_dbm: Floats
    spread_db: Floats
    strength: float


def fit_curves(
    chainage_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    grid_m: Float[np.ndarray, " grid"],
    spacing_m: float,
    strength: float | None = None,
) -> FittedCurves:
    """
    Fit every cell of a road.

    Args:
        chainage_m: Where each sample was taken, any order, all passes together.
        rsrp_dbm: NaN = not heard; a cell never heard gets a flat curve of no meaning.
        grid_m: Chainages at which the curves are wanted.
        spacing_m: Distance of the knots.
        strength: Penalty to use; None chooses it by restricted likelihood.
    """
    basis = Basis.over(float(grid_m[-1]), spacing_m)
    problems = _normal_equations(basis, chainage_m, rsrp_dbm)
    chosen = _best_strength(problems) if strength is None else strength
    solved = [_solve(problem, chosen) for problem in problems]
    pooled = sum(s.misfit for s in solved) / max(sum(p.count for p in problems), 1)
    misfit, count = np.array([s.misfit for s in solved]), np.array([p.count for p in problems])
    noise_db = np.sqrt((misfit + NOISE_PRIOR_SAMPLES * pooled) / (count + NOISE_PRIOR_SAMPLES))
    noise_db = np.maximum(noise_db, LEAST_NOISE_DB)
    coefficients = np.stack(
        [s.coefficients_dbm + p.level_dbm for s, p in zip(solved, problems, strict=True)], axis=1
    )
    leverage = _leverage(basis, solved, grid_m)
    return FittedCurves(
        basis,
        coefficients,
        noise_db,
        basis.at(grid_m).times(coefficients),
        noise_db * np.sqrt(1.0 + leverage),
        chosen,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Normal equations of one cell, in upper banded form, about its median level."""

    gram: Floats
    right: Floats
    square_sum: float
    count: int
    level_dbm: float


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    coefficients_dbm: Floats
    factor: Floats
    misfit: float
    log_determinant: float


def _normal_equations(basis: Basis, chainage_m: Floats, rsrp_dbm: Floats) -> list[_Problem]:
    weights = basis.at(np.asarray(chainage_m, dtype=float))
    return [_one_problem(basis.size, weights, column) for column in rsrp_dbm.T]


def _one_problem(size: int, weights: Weights, rsrp_dbm: Floats) -> _Problem:
    heard = ~np.isnan(rsrp_dbm)
    first, value = weights.first[heard], weights.value[heard]
    level = float(np.median(rsrp_dbm[heard])) if heard.any() else 0.0
    deviation = rsrp_dbm[heard] - level
    gram = np.zeros((DEGREE + 1, size))
    right = np.zeros(size)
    for i in range(DEGREE + 1):
        right += np.bincount(first + i, value[:, i] * deviation, size)
        for j in range(i, DEGREE + 1):
            gram[DEGREE - (j - i)] += np.bincount(first + j, value[:, i] * value[:, j], size)
    return _Problem(gram, right, float(deviation @ deviation), int(heard.sum()), level)


def penalty(size: int) -> Floats:
    """First differences squared, upper banded: 1 -1 along the diagonal pair."""
    banded = np.zeros((DEGREE + 1, size))
    banded[DEGREE] = 2.0
    banded[DEGREE, [0, -1]] = 1.0
    banded[DEGREE - 1, 1:] = -1.0
    return banded


def _solve(problem: _Problem, strength: float) -> _Solution:
    matrix = problem.gram + strength * penalty(problem.gram.shape[1])
    matrix[DEGREE] += RIDGE
    factor = cholesky_banded(matrix, check_finite=False)
    coefficients = cho_solve_banded((factor, False), problem.right, check_finite=False)
    misfit = max(problem.square_sum - float(coefficients @ problem.right), 0.0)
    return _Solution(coefficients, factor, misfit, 2.0 * float(np.log(factor[DEGREE]).sum()))


def _best_strength(problems: list[_Problem]) -> float:
    """
    Strength of the largest restricted likelihood with one noise level for the road.

    Profiled over the noise: minus twice its logarithm is ``n log(misfit / n) + log det(G + sP)
    - rank(P) log s``, summed over the cells (Wood 2011, Eq. 4, with a Gaussian response).
    """
    count = sum(problem.count for problem in problems)

    def deviance(strength: float) -> float:
        solved = [_solve(problem, strength) for problem in problems]
        misfit = sum(solution.misfit for solution in solved)
        determinant = sum(solution.log_determinant for solution in solved)
        rank = sum(problem.gram.shape[1] - 1 for problem in problems)
        return count * np.log(max(misfit, ROUNDING) / count) + determinant - rank * np.log(strength)

    return min(STRENGTHS, key=deviance)


def _leverage(
    basis: Basis, solved: list[_Solution], grid_m: Floats
) -> Float[np.ndarray, "grid cells"]:
    """Variance of the fit over the variance of the noise, at every grid point."""
    variance = _inverse_diagonal(np.stack([solution.factor for solution in solved], axis=2))
    columns = [np.interp(grid_m, basis.knots_m[DEGREE:-DEGREE], column) for column in variance.T]
    return np.minimum(np.stack(columns, axis=1), MAX_LEVERAGE)


def _inverse_diagonal(
    factor: Float[np.ndarray, "bands splines cells"],
) -> Float[np.ndarray, "splines cells"]:
    """
    The diagonal of the inverse, from the Cholesky factor.

    Backward from the last spline, each from the one after it (Takahashi, Fagan and Chin 1973); the
    rest of the inverse is never made.
    """
    own = 1.0 / factor[DEGREE] ** 2
    inverse = np.empty_like(own)
    inverse[-1] = own[-1]
    passed_on = factor[DEGREE - 1, 1:] ** 2 * own[:-1]
    for row in range(len(own) - 2, -1, -1):
        inverse[row] = own[row] + passed_on[row] * inverse[row + 1]
    return inverse
