"""
A window laid along a road: how well it fits when its last sample is at each position.

`score_positions` is the one kernel of every matcher: the exhaustive one hands it whole roads, the
two-scale one tapes first and then the few stretches that matter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from app.numerics.observation import Profile
from app.numerics.query import Aim


class Between(NamedTuple):
    """
    Samples that lie between two columns, where terms of a profile are taken to be straight.

    Attributes:
        columns: The farther ones from the window's end.
        share: Of the way to these.
    """

    columns: Int[np.ndarray, "samples positions"]
    share: Float[np.ndarray, " samples"]


def score_positions(
    rows: Float[np.ndarray, "rows stretch"],
    factors: Float[np.ndarray, "channels samples rows"],
    columns: Int[np.ndarray, "samples positions"],
    between: Between | None = None,
) -> Float[np.ndarray, "channels positions"]:
    """
    Score, residuals and weights of a window at positions: each sample at its own column, added up.

    Args:
        rows: A profile's, or a stretch of it.
        factors: From `app.numerics.observation.coefficients`, for the same rows.
        columns: Of ``rows``, where each sample lies when the window ends at each position.
        between: Where samples lie beyond that; None = nowhere.
    """
    channels, samples, width = len(factors), columns.shape[0], rows.shape[1]
    each = factors.reshape(channels * samples, -1) @ rows
    starts = np.arange(0, samples * width, width)[:, None]
    each = each.reshape(channels, -1)
    if between is None:
        return np.asarray(each.take(columns + starts, axis=1).sum(axis=1))
    share = between.share[:, None]
    here, there = (each.take(one + starts, axis=1) for one in (columns, between.columns))
    return np.asarray((here + share * (there - here)).sum(axis=1))


def align(
    along: Profile, aim: Aim, first: int, last: int, sign: int
) -> Float[np.ndarray, "channels positions"]:
    """
    Score, residuals and weights of a window ending at each column from ``first`` to ``last``.

    Samples beyond the profile's ends lie on its outermost columns, outside the road; those between
    two columns have a share of either one's terms. In float64: a position must be the same on every
    machine, whatever order its products add up in.

    Args:
        sign: +1 for travel towards growing columns, -1 against.
    """
    columns = np.arange(first, last + 1) - sign * aim.behind[:, None]
    reach = int(aim.behind[-1]) + 1
    low, high = (first - reach, last) if sign > 0 else (first, last + reach)
    beyond = columns - sign
    if low < 0 or high >= along.columns:
        low, high = max(low, 0), min(high, along.columns - 1)
        columns, beyond = (np.minimum(np.maximum(one, low), high) for one in (columns, beyond))
    rows = along.rows[:, low : high + 1]
    if aim.rows is not None:
        rows = rows[aim.rows]
    between = Between(beyond - low, aim.share) if aim.share.any() else None
    return score_positions(rows.astype(np.float64), aim.factors, columns - low, between)
