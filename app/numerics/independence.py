"""
Whether a road's readings err independently of each other, as windows drawn from its curves do.

The cells of a sample are heard by one phone at one place behind one lorry: where that matters they
err together, and so do samples of a drive, by more than a drive can tell of itself. Then windows
drawn reading by reading are far easier than driven ones and would make a map much too sure. What a
road with few cells cannot tell, all roads of a map can.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from app.numerics.curves import FittedCurves
from app.numerics.passes import RoadPass

FEWEST_PAIRS = 40.0  # of readings of one sample; fewer tell nothing
MOST_SHARED = 0.06  # of the variance, beyond chance; real drives: 0.2, 19 in 20 above 0.08
CHANCES_SDS = 1.0  # so much of what independent noise would show may be chance
WINDOWS_SDS = 2.0  # as far as windows go, which are drawn in vain where the map says otherwise


class Shared(NamedTuple):
    """
    What the cells of a sample have in common.

    Attributes:
        part: Of their variance.
        pairs: Of readings of one sample that tell so.
    """

    part: float
    pairs: float

    def may_be_chance(self, sds: float) -> bool:
        """
        Whether they may err independently, for all that these pairs tell.

        Where hardly any sample heard two of them, as where phones report their serving cell, nobody
        can tell, and they are not taken to.

        Args:
            sds: Standard deviations of what independent noise would show.
        """
        if self.pairs < FEWEST_PAIRS:
            return False
        return self.part <= MOST_SHARED + sds * self.pairs**-0.5


NOT_SEEN = Shared(0.0, FEWEST_PAIRS)  # nothing more is known of a road that older code drew from
ALONE = Shared(0.0, np.inf)  # one cell has none to err with


def shared_about(passes: Sequence[RoadPass], curves: FittedCurves, step_m: float) -> Shared:
    """
    What the cells of a sample have in common about the curves.

    Args:
        passes: That the curves were fitted to; their columns are the curves'.
        step_m: Of the curves' grid.
    """
    if curves.mean_dbm.shape[1] == 1:
        return ALONE
    last = len(curves.mean_dbm) - 1
    residual = []
    for one in passes:
        at = np.clip(np.rint(one.chainage_m / step_m), 0, last).astype(int)
        residual.append((one.rsrp_dbm - curves.mean_dbm[at]) / curves.noise_db)
    return shared_part(np.concatenate(residual))


def shared_part(residual: Float[np.ndarray, "samples cells"]) -> Shared:
    """
    The mean product of two cells' residuals in a sample over their mean square.

    Args:
        residual: NaN = not heard.
    """
    known = ~np.isnan(residual)
    heard = known.sum(axis=1)
    pairs = 0.5 * float((heard * (heard - 1)).sum())
    square = np.where(known, residual, 0.0) ** 2
    product = 0.5 * float((np.nansum(residual, axis=1) ** 2 - square.sum(axis=1)).sum())
    mean_square = max(float(square.sum()) / max(float(known.sum()), 1.0), 1e-12)
    return Shared(product / max(pairs, 1.0) / mean_square, pairs)


def pooled(roads: Sequence[Shared]) -> Shared:
    """What the roads of a map say together: few pairs of each are many of all."""
    told = [one for one in roads if one.pairs < np.inf]
    if not told:
        return ALONE if roads else Shared(0.0, 0.0)
    pairs = sum(one.pairs for one in told)
    return Shared(sum(one.part * one.pairs for one in told) / max(pairs, 1.0), pairs)
