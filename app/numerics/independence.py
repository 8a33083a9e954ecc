"""
Whether a road's readings err independently of each other, as windows drawn from its curves do.

The cells of a sample are heard by one phone at one place behind one lorry: where that matters they
err together, and so do samples of a drive, by more than a drive can tell of itself. Then windows
drawn reading by reading are far easier than driven ones and would make a map much too sure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from app.numerics.curves import FittedCurves
from app.numerics.passes import RoadPass

FEWEST_PAIRS = 40.0  # of readings of one sample; fewer tell nothing, and a map asks all its roads
MOST_SHARED = 0.06  # of the variance, beyond chance; real drives: 0.2, 19 in 20 above 0.08
CHANCES_SDS = 1.0  # so much of what independent noise would show may be chance


def errs_apart(passes: Sequence[RoadPass], curves: FittedCurves, step_m: float) -> bool:
    """
    Whether the cells of a sample err independently of each other about the curves.

    One cell alone has none to err with. Where there are several, but hardly any sample heard two of
    them, as where phones report their serving cell, nobody can tell, and they are not taken to.

    Args:
        passes: That the curves were fitted to; their columns are the curves'.
        step_m: Of the curves' grid.
    """
    if curves.mean_dbm.shape[1] == 1:
        return True
    last = len(curves.mean_dbm) - 1
    residual = []
    for one in passes:
        at = np.clip(np.rint(one.chainage_m / step_m), 0, last).astype(int)
        residual.append((one.rsrp_dbm - curves.mean_dbm[at]) / curves.noise_db)
    shared = shared_part(np.concatenate(residual))
    return shared is not None and shared.part <= MOST_SHARED + CHANCES_SDS * shared.sd


class Shared(NamedTuple):
    """A part of the variance, and how much of it chance alone makes."""

    part: float
    sd: float


def shared_part(residual: Float[np.ndarray, "samples cells"]) -> Shared | None:
    """
    The part of the residuals' variance that a sample's cells have in common.

    Args:
        residual: NaN = not heard.

    Returns:
        The mean product of two cells' residuals over their mean square; None where too few samples
        heard two cells to tell.
    """
    known = ~np.isnan(residual)
    heard = known.sum(axis=1)
    pairs = 0.5 * float((heard * (heard - 1)).sum())
    if pairs < FEWEST_PAIRS:
        return None
    square = np.where(known, residual, 0.0) ** 2
    product = 0.5 * float((np.nansum(residual, axis=1) ** 2 - square.sum(axis=1)).sum())
    mean_square = max(float(square.sum()) / float(known.sum()), 1e-12)
    return Shared(product / pairs / mean_square, pairs**-0.5)
