"""
Two-scale matching: which road, which sub-segment, where on it.

Coarse to fine, nothing lost: all cells, averaged over coarse steps, score every sub-segment of the
roads that have any of the window's cells among their salient ones; the stretches where that is
highest are then aligned reading by reading with the fitted curves. Where the posterior is spread
over more than these, the rest of it stays as the coarse scale has it: no probability is lost.
`app.numerics.exhaustive` is the definition of what this must return.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Fix, Window
from app.numerics import native
from app.numerics.answer import answer
from app.numerics.coarse import COARSE_FLATTENING, Coarse, neighbours, shortlist, shortlists
from app.numerics.corners import TURN_SHARE, Corner, places_round_corners
from app.numerics.index import MapIndex
from app.numerics.odometer import under_other_factors
from app.numerics.posterior import (
    CHAINAGE,
    RESIDUAL,
    SCORE,
    WIDTH,
    Places,
)
from app.numerics.query import Query, ask
from app.numerics.refinement import refine
from app.numerics.stretches import Stretch, lay

__all__ = ["COARSE_FLATTENING", "Coarse", "fine_places", "locate", "place", "shortlist"]

TURN_LOG = float(np.log(TURN_SHARE))
JOINED_STEPS = 2.5  # stretches closer than this are aligned in one product


def locate(
    index: MapIndex, window: Window, *, confidence: float = 0.68, in_c: bool = native.BUILT
) -> Fix:
    """
    Where the last sample of a window was taken.

    Args:
        window: At least one sample; cells in any order.
        confidence: Of the accuracy radius, between 0 and 1.
        in_c: Use the kernels in C; without, the numpy code that defines them.

    Returns:
        The fix; its candidates' posteriors and ``off_map_posterior`` sum to 1.
    """
    query = ask(index, window, in_c=in_c)
    placed = place(index, query)
    return answer(index, query, placed.places, confidence, placed.log_prior)


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """
    Where a window may end.

    Attributes:
        log_prior: What is known beforehand of the last places, whose scores hold it times the
            window's temperature, against those of a road that the window lies along. Of these
            nothing is known; None = there are no others.
    """

    places: Places
    log_prior: Float[np.ndarray, " last"] | None


def place(index: MapIndex, query: Query) -> Placed:
    """Both scales, along roads and round corners."""
    kept, corners = shortlists(index, query)
    return with_hypotheses(index, query, finest_places(index, query, kept), corners)


def with_hypotheses(
    index: MapIndex, query: Query, straight: Places, corners: list[Corner]
) -> Placed:
    """
    Places along roads, and beside them what else may have happened, each with its prior: the
    vehicle came round a corner, or its odometer is off.
    """
    if not corners:
        others = under_other_factors(index, query, straight, straight)
        return Placed(straight, None) if others is None else Placed(others.places, others.log_prior)
    turned = places_round_corners(index, query, corners)
    log_prior = np.full(len(turned), TURN_LOG)
    turned.values[SCORE] += TURN_LOG * query.temperature(index.calibration)
    places = Places.join((straight, turned))
    others = under_other_factors(index, query, straight, places)
    if others is None:
        return Placed(places, log_prior)
    return Placed(others.places, np.concatenate((log_prior, others.log_prior)))


def fine_places(index: MapIndex, query: Query, kept: Coarse) -> Places:
    """
    Where the window may end: metre by metre along the stretches that are worth it, each stretch
    with its neighbours, and by coarse steps elsewhere.
    """
    aligned = _aligned(index, query, kept)
    return _with_others(index, kept, aligned, aligned)


def finest_places(index: MapIndex, query: Query, kept: Coarse) -> Places:
    """`fine_places` with the neighbourhoods of peaks drawn anew (`app.numerics.refinement`)."""
    aligned = _aligned(index, query, kept)
    return _with_others(index, kept, aligned, refine(index, query, aligned))


def _aligned(index: MapIndex, query: Query, kept: Coarse) -> Places:
    closer = kept.closer
    stretches = _stretches(index, kept if closer is None else kept.take(closer.nonzero()[0]))
    return lay(index, query, stretches)


def _with_others(index: MapIndex, kept: Coarse, aligned: Places, drawn: Places) -> Places:
    """
    The places aligned, as they were drawn, and beside them the coarse positions that are not looked
    at closer, nor lie beside one that is. A coarse score is no reason to look elsewhere: none is
    higher than the best place aligned.
    """
    closer = kept.closer
    if closer is None or closer.all():
        return drawn
    rows = (~(closer | neighbours(closer, kept.beside))).nonzero()[0]
    rest, count = kept.places.take(rows), len(drawn)
    places = native.no_places(count + len(rows))
    where, values = places.where, places.values
    where[:, :count], values[:, :count] = drawn.where, drawn.values
    where[0, count:], where[1, count:] = rest.road, rest.sign
    np.minimum(rest.chainage_m, index.lengths_m.take(rest.road), out=values[CHAINAGE, count:])
    values[WIDTH, count:] = kept.step_m
    np.minimum(kept.score.take(rows), aligned.score.max(), out=values[SCORE, count:])
    values[RESIDUAL:, count:] = 0.0
    return places


def _stretches(index: MapIndex, kept: Coarse) -> list[Stretch]:
    """Road, direction, first and last grid position of every unbroken row of coarse positions."""
    road, sign, chainage_m = kept.road.tolist(), kept.sign.tolist(), kept.chainage_m.tolist()
    reach_m, apart_m = kept.step_m, JOINED_STEPS * kept.step_m
    stretches, start = [], 0
    for end in range(1, len(road) + 1):
        if (
            end < len(road)
            and road[end] == road[start]
            and sign[end] == sign[start]
            and chainage_m[end] - chainage_m[end - 1] <= apart_m
        ):
            continue
        target = index.roads[road[start]]
        first = max(int((chainage_m[start] - reach_m) / target.step_m), 0)
        last = int((chainage_m[end - 1] + reach_m) / target.step_m) + 1
        last = min(last, target.grid_size - 1)
        stretches.append((road[start], sign[start], first, last))
        start = end
    return stretches
