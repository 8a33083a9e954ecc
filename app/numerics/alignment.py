"""
A window laid along a road: how well it fits when its last sample is at each position.

`score_positions` is the one kernel of every matcher: the exhaustive one hands it whole roads, the
two-scale one tapes first and then the few stretches that matter.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int

from app.numerics.observation import CHANNELS, TERMS, Profile
from app.numerics.query import Aim


def scoring_rows(
    along: Profile, cells: Int[np.ndarray, " chosen"], first: int, last: int
) -> Float32[np.ndarray, "rows stretch"]:
    """
    Terms of the chosen cells, the base and "outside the road", for columns ``first..last``.

    Args:
        first, last: Any integers, both included; columns beyond the profile are outside.
    """
    size = along.base.shape[0]
    rows = np.zeros((TERMS * len(cells) + 2, last + 1 - first), dtype=np.float32)
    rows[-1] = 1.0
    low, high = max(first, 0), min(last + 1, size)
    if low < high:
        part = slice(low - first, high - first)
        rows[:-2, part] = along.terms[cells, :, low:high].reshape(-1, high - low)
        rows[-2, part] = along.base[low:high]
        rows[-1, part] = 0.0
    return rows


def score_positions(
    rows: Float32[np.ndarray, "rows stretch"],
    aim: Aim,
    positions: Int[np.ndarray, " positions"],
    signs: tuple[int, ...],
) -> Float32[np.ndarray, "3 places"]:
    """
    Score, residual and weight of the window ending at each position, direction after direction.

    Args:
        rows: From `scoring_rows`, or a tape's, for the cells of ``aim``.
        positions: Columns of ``rows``; every ``positions - sign * aim.behind`` must lie in them.
        signs: +1 for travel towards growing columns, -1 against.
    """
    samples, width = len(aim.behind), rows.shape[1]
    each = aim.factors.reshape(CHANNELS * samples, -1) @ rows
    starts = np.arange(0, samples * width, width)
    laid = [(starts - sign * aim.behind)[:, None] + positions for sign in signs]
    places = laid[0] if len(laid) == 1 else np.concatenate(laid, axis=1)
    return np.asarray(each.reshape(CHANNELS, -1).take(places, axis=1).sum(axis=1))


def align(
    along: Profile, aim: Aim, grid: Int[np.ndarray, " positions"], sign: int
) -> Float32[np.ndarray, "3 positions"]:
    """
    Score, residual and weight of the window at grid positions of one road, in one direction.

    Args:
        grid: Increasing columns of the profile.
    """
    reach, first, last = int(aim.behind[-1]), int(grid[0]), int(grid[-1])
    low, high = (first - reach, last) if sign > 0 else (first, last + reach)
    return score_positions(scoring_rows(along, aim.cells, low, high), aim, grid - low, (sign,))
