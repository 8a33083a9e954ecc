"""The rows of a road model: each sub-segment with its features and one curve a cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Curve, Line, Salience, Segment
from app.numerics.curves import DEGREE, FittedCurves
from app.numerics.features import feature_matrix
from app.numerics.geodesy import Floats
from app.numerics.lines import point_at
from app.numerics.passes import RoadPass


@dataclass(frozen=True, slots=True, eq=False)
class FittedRoad:
    """
    A road's curves, and what they were fitted to.

    Attributes:
        curves: One spline a cell of ``cells``.
        passes: The passes on the road; their columns are ``cells``.
        mean_dbm: The curves on a grid of ``step_m``, NaN where a cell is not mapped.
        reference: Column of the reference cell.
    """

    cells: tuple[str, ...]
    curves: FittedCurves
    passes: Sequence[RoadPass]
    mean_dbm: Float[np.ndarray, "grid cells"]
    step_m: float
    reference: int


def describe_segments(
    line: Line,
    edges_m: Float[np.ndarray, " edges"],
    fitted: FittedRoad,
    salience: Sequence[Salience],
) -> tuple[Segment, ...]:
    """
    One `Segment` between each pair of edges.

    A sub-segment on which a cell is mapped nowhere has no curve of it.

    Args:
        salience: Of each sub-segment.
    """
    middle = point_at(line, (edges_m[:-1] + edges_m[1:]) / 2.0)
    readings = _residuals(fitted)
    mean_dbm, step_m = fitted.mean_dbm, fitted.step_m
    segments = []
    for index, part in enumerate(salience):
        start_m, end_m = float(edges_m[index]), float(edges_m[index + 1])
        last = min(int(end_m / step_m) + 1, len(mean_dbm))
        grid = np.arange(int(np.ceil(start_m / step_m)), last)
        segments.append(
            Segment(
                index=index,
                start_m=start_m,
                end_m=end_m,
                mid_lon=float(middle.lon[index]),
                mid_lat=float(middle.lat[index]),
                features=feature_matrix(mean_dbm[grid], grid * step_m, fitted.reference),
                salience=part,
                curves=_curves(
                    fitted,
                    ~np.isnan(mean_dbm[grid]).all(axis=0),
                    (start_m, end_m),
                    readings.between(start_m, end_m),
                ),
            )
        )
    return tuple(segments)


@dataclass(frozen=True, slots=True, eq=False)
class _Residuals:
    """Every reading less its curve, and the number of its pass."""

    chainage_m: Floats
    residual_db: Floats
    owner: np.ndarray

    def between(self, start_m: float, end_m: float) -> _Residuals:
        inside = (self.chainage_m >= start_m) & (self.chainage_m < end_m)
        return _Residuals(self.chainage_m[inside], self.residual_db[inside], self.owner[inside])


def _residuals(fitted: FittedRoad) -> _Residuals:
    passes, curves = fitted.passes, fitted.curves
    chainage_m = np.concatenate([one.chainage_m for one in passes])
    rsrp = np.concatenate([one.rsrp_dbm for one in passes])
    owner = np.repeat(np.arange(len(passes)), [len(one.chainage_m) for one in passes])
    curve_dbm = curves.basis.at(chainage_m).times(curves.coefficients_dbm)
    return _Residuals(chainage_m, rsrp - curve_dbm, owner)


def _curves(
    fitted: FittedRoad,
    mapped: np.ndarray,
    stretch_m: tuple[float, float],
    readings: _Residuals,
) -> tuple[Curve, ...]:
    curves, residual_db = fitted.curves, readings.residual_db
    spacing_m = float(curves.basis.knots_m[1] - curves.basis.knots_m[0])
    first = int(stretch_m[0] / spacing_m)
    last = max(int(np.ceil(stretch_m[1] / spacing_m)), first + 1)
    knots_m = curves.basis.knots_m[first : last + 2 * DEGREE + 1]
    read = ~np.isnan(residual_db)
    squares = np.where(read, residual_db, 0.0) ** 2
    spread_db = np.where(
        read.sum(axis=0) >= 2,  # one reading has no spread: the whole road's stands in
        np.sqrt(squares.sum(axis=0) / np.maximum(read.sum(axis=0), 1)),
        curves.noise_db,
    )
    return tuple(
        Curve(
            cell=fitted.cells[column],
            knots_m=knots_m,
            coefficients_dbm=curves.coefficients_dbm[first : last + DEGREE, column],
            degree=DEGREE,
            residual_db=float(spread_db[column]),
            pass_count=len(np.unique(readings.owner[read[:, column]])),
        )
        for column in np.flatnonzero(mapped)
    )
