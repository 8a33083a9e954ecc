"""
Sub-segments: a road cut at the singular points where the trend of some cell changes (Eq. 5).

The search is `ruptures.BottomUp`; the objective is ours. Gradients are those of the fitted curves:
the gradient of raw samples is all noise (2.8 dB/m of it against slopes of 0.1 dB/m). A fitted curve
is as rough as its field, so a trend is looked for in its gradient over some metres; each cut then
moves to where, within these metres, the curve itself breaks.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from ruptures.base import BaseCost
from ruptures.detection import BottomUp
from scipy.ndimage import uniform_filter1d


@dataclass(frozen=True, slots=True)
class SegmentationParams:
    """
    What a sub-segment may look like.

    Attributes:
        penalty_m: The price of a cut: it must save as much of the objective as this many metres of
            the road hold on average. Eq. (5) alone falls with every cut and would cut everywhere.
        min_length_m: Shorter ones join a neighbour; below some 16 m features are noise.
        max_length_m: Longer ones are cut evenly, so that a sub-segment names a place.
        trend_m: A trend is the gradient over so many metres; roughness within them is none.
    """

    penalty_m: float = 6.0
    min_length_m: float = 16.0
    max_length_m: float = 60.0
    trend_m: float = 5.0


class GradientVarianceCost(BaseCost):  # type: ignore[misc]  # ruptures ships no types
    """
    The gradient's squared deviation from its mean within a stretch, summed over cells.

    Eq. (5) also divides by the stretch's length; that makes joining two long stretches of different
    trend free, so the length stays in. Prefix sums make a stretch cost two subtractions.
    """

    model = "gradient-variance"
    min_size = 1

    def fit(self, signal: Float[np.ndarray, "samples cells"]) -> GradientVarianceCost:
        """Take the gradients in dB/m, one row a position; returns itself, as ruptures expects."""
        centred = np.asarray(signal, dtype=float) - np.mean(signal, axis=0)
        start = np.zeros((1, centred.shape[1]))
        self.signal = centred
        self._sums = np.concatenate([start, np.cumsum(centred, axis=0)])
        self._squares = np.concatenate([[0.0], np.cumsum((centred**2).sum(axis=1))])
        return self

    def error(self, start: int, end: int) -> float:
        """Sum over rows ``start:end`` and cells of the squared deviation, (dB/m)^2."""
        total = self._sums[end] - self._sums[start]
        squares = self._squares[end] - self._squares[start]
        return max(float(squares - (total @ total) / (end - start)), 0.0)


def cut_road(
    mean_dbm: Float[np.ndarray, "grid cells"],
    step_m: float,
    length_m: float,
    params: SegmentationParams = SegmentationParams(),
) -> Float[np.ndarray, " boundaries"]:
    """
    Boundaries of the sub-segments as chainages, from 0 to ``length_m``.

    Args:
        mean_dbm: Fitted curves on a grid of ``step_m``; NaN where a cell is not mapped, which
            counts as no trend.

    Returns:
        Increasing chainages in metres, the first 0 and the last ``length_m``.
    """
    gradient = np.nan_to_num(np.diff(mean_dbm, axis=0) / step_m)
    cuts: list[int] = []
    if len(gradient) > 1:
        # Sums in another order differ in the last bit, which decides ties: the columns' own values
        # order them, so that the order of the cells does not.
        gradient = gradient[:, np.lexsort(gradient)]
        reach = max(round(0.5 * (params.trend_m / step_m - 1.0)), 0)  # steps to either side
        trend = uniform_filter1d(gradient, 2 * reach + 1, axis=0)
        cost = GradientVarianceCost().fit(trend)
        price = params.penalty_m * cost.error(0, len(trend)) / length_m
        search = BottomUp(custom_cost=cost, min_size=1, jump=1).fit(trend)
        cuts = search.predict(pen=max(price, 1e-12))[:-1]
        BottomUp.merge.cache_clear()  # its lru_cache would keep every road's arrays alive
        cuts = _at_breaks(cuts, GradientVarianceCost().fit(gradient), reach)
        cuts = _absorb_short(cuts, cost, max(1, round(params.min_length_m / step_m)))
    edges_m = [0.0, *(cut * step_m for cut in cuts), length_m]
    return np.concatenate([*_even_parts(edges_m, params.max_length_m), [length_m]])


def _at_breaks(cuts: list[int], cost: GradientVarianceCost, reach: int) -> list[int]:
    """Each cut where it costs least between its neighbours, at most ``reach`` rows away."""
    moved = set()
    for before, cut, after in zip([0, *cuts], cuts, [*cuts[1:], len(cost.signal)], strict=False):
        near = range(max(cut - reach, before + 1), min(cut + reach, after - 1) + 1)
        moved.add(min(near, key=lambda at: cost.error(before, at) + cost.error(at, after)))
    return sorted(moved)


def _absorb_short(cuts: list[int], cost: GradientVarianceCost, shortest: int) -> list[int]:
    """Drop the cheapest cut beside the shortest stretch until every stretch is long enough."""
    edges = [0, *cuts, len(cost.signal)]
    while len(edges) > 2:
        lengths = np.diff(edges)
        short = int(np.argmin(lengths))
        if lengths[short] >= shortest:
            break
        beside = [edge for edge in (short, short + 1) if 0 < edge < len(edges) - 1]
        del edges[min(beside, key=lambda edge: cost.error(edges[edge - 1], edges[edge + 1]))]
    return edges[1:-1]


def _even_parts(edges_m: list[float], max_length_m: float) -> list[Float[np.ndarray, " parts"]]:
    parts = []
    for start_m, end_m in pairwise(edges_m):
        count = max(1, int(np.ceil((end_m - start_m) / max_length_m - 1e-9)))
        parts.append(np.linspace(start_m, end_m, count, endpoint=False))
    return parts
