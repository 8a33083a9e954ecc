"""The kernels that look at readings alone; whether they are there says `app.numerics.native`."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float

from app.numerics import listing, wild
from app.numerics.native import BUILT, Told

with suppress(ImportError):
    from app.numerics import _native

__all__ = ["BUILT", "listen", "without_wild"]

RAMP = (listing.FEW, listing.USUAL, listing.LEAST)
HAMPEL = (wild.NEIGHBOURS, wild.LEAST_TO_TELL, wild.REACH_M, wild.SURE_DB, wild.TIMES)


def without_wild(
    distance_m: Float[np.ndarray, " samples"], rsrp_dbm: Float[np.ndarray, "samples cells"]
) -> Float[np.ndarray, "samples cells"]:
    """Twin of `app.numerics.wild.without_wild`."""
    left_dbm = np.empty(rsrp_dbm.shape)
    return left_dbm if _native.without_wild(distance_m, rsrp_dbm, *HAMPEL, left_dbm) else rsrp_dbm


def listen(told: Told, usual: Float[np.ndarray, " cells"]) -> tuple[float, float]:
    """
    Twin of `app.numerics.listing.as_listed`, in place; `times_usual`, and what the readings weigh
    together.
    """
    return _native.listen(told.block, told.samples, usual, *RAMP)
