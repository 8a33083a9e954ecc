"""
A window laid along a road: how well it fits when its last sample is at each position.

`score_positions` is the one kernel of every matcher: the exhaustive one hands it whole roads, the
two-scale one tapes first and then the few stretches that matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from app.numerics.observation import CHANNELS, TERMS, Profile, coefficients, marginal_score
from app.numerics.query import Query, choose, unmapped_score


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """
    How well a window fits at some positions.

    Attributes:
        score: Log likelihood against the background, device offset integrated out.
        residual, weight: What the device offset is estimated from, see
            `app.numerics.observation.offset_db`.
    """

    score: Float[np.ndarray, " positions"]
    residual: Float[np.ndarray, " positions"]
    weight: Float[np.ndarray, " positions"]


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
    starts = np.arange(samples) * width - sign * behind
    laid = each.reshape(CHANNELS, -1).take(starts[:, None] + positions, axis=1)
    return np.asarray(laid.sum(axis=1))


def align(
    along: Profile,
    column: dict[str, int],
    query: Query,
    grid: Int[np.ndarray, " positions"],
    sign: int,
    step_m: float,
    offset_sd_db: float,
) -> Aligned:
    """
    Fit of a window at grid positions of one road, in one direction of travel.

    Args:
        along, column: The road's profile and its row of each cell.
        grid: Increasing columns of the profile.
        step_m: Metres between columns.
    """
    chosen = choose(query, column)
    behind = np.rint(query.fine.behind_m / step_m).astype(np.intp)
    reach = int(behind[-1])
    first, last = int(grid[0]), int(grid[-1])
    low, high = (first - reach, last) if sign > 0 else (first, last + reach)
    rows = scoring_rows(along, chosen.there, low, high)
    factors = coefficients(query.fine, chosen.here)
    channels = score_positions(rows, factors, behind, grid - low, sign)
    score = marginal_score(channels, offset_sd_db) + unmapped_score(query.fine, chosen.missing)
    return Aligned(score, channels[1], channels[2])
