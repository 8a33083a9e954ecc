"""The rows of a road model: each sub-segment with its features and one curve a cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from app.domain import Curve, Line, Salience, Segment
from app.numerics.curves import DEGREE, FittedCurves
from app.numerics.features import feature_matrix
from app.numerics.geodesy import Floats
from app.numerics.lines import point_at
from app.numerics.passes import RoadPass


def describe_segments(
    line: Line,
    edges_m: Float[np.ndarray, " edges"],
    cells: tuple[str, ...],
    mean_dbm: Float[np.ndarray, "grid cells"],
    step_m: float,
    reference: int,
    curves: FittedCurves,
    passes: Sequence[RoadPass],
    salience: Sequence[Salience],
) -> tuple[Segment, ...]:
    """
    One `Segment` between each pair of edges.

    Args:
        mean_dbm: Curves on the grid, NaN where a cell is not mapped; a sub-segment on which a cell
            is mapped nowhere has no curve of it.
    """
    middle = point_at(line, (edges_m[:-1] + edges_m[1:]) / 2.0)
    chainage_m = np.concatenate([one.chainage_m for one in passes])
    rsrp = np.concatenate([one.rsrp_dbm for one in passes])
    owner = np.repeat(np.arange(len(passes)), [len(one.chainage_m) for one in passes])
    residual_db = rsrp - curves.basis.at(chainage_m).times(curves.coefficients_dbm)
    segments = []
    for index, part in enumerate(salience):
        start_m, end_m = float(edges_m[index]), float(edges_m[index + 1])
        grid = np.arange(
            int(np.ceil(start_m / step_m)), min(int(end_m / step_m) + 1, len(mean_dbm))
        )
        inside = (chainage_m >= start_m) & (chainage_m < end_m)
        segments.append(
            Segment(
                index=index,
                start_m=start_m,
                end_m=end_m,
                mid_lon=float(middle.lon[index]),
                mid_lat=float(middle.lat[index]),
                features=feature_matrix(mean_dbm[grid], grid * step_m, reference),
                salience=part,
                curves=_curves(
                    cells,
                    ~np.isnan(mean_dbm[grid]).all(axis=0),
                    curves,
                    (start_m, end_m),
                    residual_db[inside],
                    owner[inside],
                ),
            )
        )
    return tuple(segments)


def _curves(
    cells: tuple[str, ...],
    mapped: np.ndarray,
    curves: FittedCurves,
    stretch_m: tuple[float, float],
    residual_db: Floats,
    owner: np.ndarray,
) -> tuple[Curve, ...]:
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
            cell=cells[column],
            knots_m=knots_m,
            coefficients_dbm=curves.coefficients_dbm[first : last + DEGREE, column],
            degree=DEGREE,
            residual_db=float(spread_db[column]),
            pass_count=len(np.unique(owner[read[:, column]])),
        )
        for column in np.flatnonzero(mapped)
    )
