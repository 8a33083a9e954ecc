"""
A window laid along a road: how well it fits when its last sample is at each position.

`score_positions` is the one kernel of every matcher: the exhaustive one hands it whole roads, the
two-scale one the few stretches that matter.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int

from app.numerics.observation import CHANNELS, Profile


def scoring_rows(
    along: Profile,
    cells: Int[np.ndarray, " chosen"],
    columns: Int[np.ndarray, " stretch"] | None = None,
) -> Float32[np.ndarray, "rows positions"]:
    """
    Terms of the chosen cells, the base and "outside", one row each.

    Args:
        columns: Positions wanted, any integers; those beyond the profile are outside the road.
            None = the whole profile.
    """
    size = along.base.shape[0]
    if columns is None:
        rows = np.empty((4 * len(cells) + 2, size), dtype=np.float32)
        rows[:-2] = along.terms[cells].reshape(-1, size)
        rows[-2] = along.base
        rows[-1] = 0.0
        return rows
    inside = (columns >= 0) & (columns < size)
    rows = np.zeros((4 * len(cells) + 2, len(columns)), dtype=np.float32)
    first, last = int(columns[0]), int(columns[-1])
    low, high = max(first, 0), min(last + 1, size)
    if low < high:
        part = slice(low - first, high - first)
        rows[:-2, part] = along.terms[cells, :, low:high].reshape(-1, high - low)
        rows[-2, part] = along.base[low:high]
    rows[-1] = ~inside
    return rows


def score_positions(
    rows: Float32[np.ndarray, "rows stretch"],
    factors: Float32[np.ndarray, "3 samples rows"],
    behind: Int[np.ndarray, " samples"],
    positions: Int[np.ndarray, " positions"],
    sign: int,
) -> Float32[np.ndarray, "3 positions"]:
    """
    Score, residual and weight of the window ending at each position.

    Args:
        rows: From `scoring_rows`.
        factors: From `app.numerics.observation.coefficients`, for the same cells.
        behind: Columns from each sample to the window's end, not negative.
        positions: Columns of ``rows``; every ``positions - sign * behind`` must lie in them.
        sign: +1 for travel towards growing columns, -1 against.
    """
    samples, width = len(behind), rows.shape[1]
    each = factors.reshape(CHANNELS * samples, -1) @ rows
    start = np.arange(samples) * width - sign * behind
    gathered = each.reshape(CHANNELS, samples * width).take(
        start[:, None] + positions[None, :], axis=1
    )
    return gathered.sum(axis=1)
