"""
Two-scale matching: which road, which sub-segment, where on it.

Coarse to fine, nothing lost: all cells, averaged over coarse steps, score every sub-segment of the
roads that know some of the window's cells; the stretches where that is highest are then aligned
reading by reading with the fitted curves. Where the posterior is spread over more than these, the
rest of it stays as the coarse scale has it, summed by sub-segment and direction.
`app.numerics.exhaustive` is the definition of what this must return.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Fix, Window
from app.numerics import native, native_chosen
from app.numerics.answer import answer
from app.numerics.chosen import Chosen, choose, rest_of
from app.numerics.coarse import COARSE_FLATTENING, Coarse, neighbours, shortlist
from app.numerics.corners import TURN_SHARE, Corner, may_turn, reached
from app.numerics.index import MapIndex
from app.numerics.odometer import LIGHTEST, under_other_factors
from app.numerics.posterior import (
    CHAINAGE,
    RESIDUAL,
    SCORE,
    WIDTH,
    Known,
    Places,
)
from app.numerics.query import Query, ask
from app.numerics.refinement import refine
from app.numerics.stretches import Stretch, lay
from app.numerics.ways import places_round_corners

__all__ = ["COARSE_FLATTENING", "Coarse", "fine_places", "locate", "place", "shortlist"]

TURN_LOG = float(np.log(TURN_SHARE))
STRAYS = 0.01  # chance of being off the map from which a short window is laid round corners
OFF_M = 5.0  # from a junction: a window that ends there may have turned just before
JOINED_STEPS = 2.5  # coarse positions closer than this are aligned in one product


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
    return located(index, ask(index, window, in_c=in_c), confidence)[1]


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """
    Where a window may end.

    Attributes:
        known: Of the last places, those that are not along a road at the window's word; None =
            there are no others.
    """

    places: Places
    known: Known | None


def located(index: MapIndex, query: Query, confidence: float) -> tuple[Placed, Fix]:
    """
    Where a window may end, and what is answered.

    A short window is laid along roads alone, and round corners as well if it may have come so.
    """
    placed = place(index, query)
    fix = answer(index, query, placed.places, confidence, placed.known)
    if may_have_turned(index, query, fix):
        placed = place(index, query, strays=True)
        fix = answer(index, query, placed.places, confidence, placed.known)
    return placed, fix


def may_have_turned(index: MapIndex, query: Query, fix: Fix) -> bool:
    """
    Whether a short window must be laid round corners, too, by its answer along roads: it strays
    from them all, it is longer than the road behind its end, or it ends where a turn goes off.
    """
    if may_turn(index, query) or not may_turn(index, query, strays=True):
        return False
    if fix.off_map_posterior > STRAYS:
        return True
    number, sign = index.road_ids.index(fix.road_id), fix.direction.sign
    length_m = index.roads[number].length_m
    behind_m = fix.chainage_m if sign > 0 else length_m - fix.chainage_m
    return behind_m < query.length_m or index.turns.away_m(number, sign, fix.chainage_m) <= OFF_M


def place(index: MapIndex, query: Query, *, strays: bool = False) -> Placed:
    """Both scales, along roads and round corners: see `app.numerics.corners.may_turn`."""
    chosen, corners = choose(index, query, strays=strays)
    return with_hypotheses(index, query, finest_places(index, query, chosen), corners)


def with_hypotheses(
    index: MapIndex, query: Query, straight: Places, corners: list[Corner]
) -> Placed:
    """
    Places along roads, and beside them what else may have happened, each with its prior: the
    vehicle came round a corner, or its odometer is off.
    """
    others = under_other_factors(index, query, straight, straight)
    along = Placed(straight, None) if others is None else Placed(others.places, others.known)
    if not corners:
        return along
    temperature = query.temperature(index.calibration)
    worth = float(straight.score.max()) - temperature * (LIGHTEST + TURN_LOG)
    ways = [reached(index, query, one) for one in corners]
    turned = places_round_corners(index, query, ways, worth)
    # Scores are against the prior of an exact odometer, which is another for other factors.
    before = TURN_LOG - turned.together + (0.0 if others is None else others.together)
    turned.places.values[SCORE] += before * temperature
    known = Known(before + turned.known.log_prior, turned.known.factor)
    if along.known is not None:
        known = Known(*map(np.concatenate, zip(along.known, known, strict=True)))
    return Placed(Places.join((along.places, turned.places)), known)


def fine_places(index: MapIndex, query: Query, kept: Coarse) -> Places:
    """
    Where the window may end: metre by metre along the stretches that are worth it, each stretch
    with its neighbours, and by coarse steps elsewhere. Scores alone, good at any temperature: of
    the posterior under a known one `finest_places` loses less.
    """
    closer = kept.closer
    if closer is None or closer.all():
        return lay(index, query, stretches_of(index, query, kept))
    aligned = lay(index, query, stretches_of(index, query, kept.take(closer.nonzero()[0])))
    rest = kept.take((~(closer | neighbours(closer, kept.beside))).nonzero()[0])
    return joined(index, aligned, rest, np.full(len(rest.score), kept.step_m), aligned)


def finest_places(index: MapIndex, query: Query, chosen: Chosen) -> Places:
    """
    Where the window may end: metre by metre along the stretches that are worth it, the
    neighbourhoods of peaks drawn anew (`app.numerics.refinement`), and one place for each
    sub-segment and direction elsewhere.
    """
    aligned = lay(index, query, stretches_of(index, query, chosen.closer))
    drawn = refine(index, query, aligned)
    if chosen.whole:
        return drawn
    return joined(index, aligned, *rest_of(index, query, chosen, aligned), drawn)


def joined(
    index: MapIndex,
    aligned: Places,
    rest: Coarse,
    width_m: Float[np.ndarray, " rest"],
    drawn: Places,
) -> Places:
    """
    The places aligned, as they were drawn, and beside them the rest. A coarse score is no reason to
    look elsewhere: none is higher than the best place aligned.
    """
    count = len(drawn)
    places = native.no_places(count + len(width_m))
    where, values = places.where, places.values
    where[:, :count], values[:, :count] = drawn.where, drawn.values
    where[0, count:], where[1, count:] = rest.road, rest.sign
    np.minimum(rest.chainage_m, index.lengths_m.take(rest.road), out=values[CHAINAGE, count:])
    values[WIDTH, count:] = width_m
    np.minimum(rest.score, aligned.score.max(), out=values[SCORE, count:])
    values[RESIDUAL:, count:] = 0.0
    return places


def stretches_of(index: MapIndex, query: Query, kept: Coarse) -> list[Stretch]:
    """The metres about every unbroken row of coarse positions, by a coarse step more either way."""
    step_m, start, stretches = kept.step_m, 0, []
    if query.told is not None:
        where, metres = (kept.road, kept.sign), (step_m, JOINED_STEPS * step_m)
        grid = index.atlas.step_m, index.atlas.size
        return native_chosen.stretches_of_coarse(kept.chainage_m, where, metres, grid)
    chainage_m, road, sign = kept.chainage_m.tolist(), kept.road.tolist(), kept.sign.tolist()
    for end in range(1, len(road) + 1):
        if (
            end < len(road)
            and chainage_m[end] - chainage_m[end - 1] <= JOINED_STEPS * step_m
            and road[end] == road[start]
            and sign[end] == sign[start]
        ):
            continue
        target = index.roads[road[start]]
        first = max(int((chainage_m[start] - step_m) / target.step_m), 0)
        last = min(int((chainage_m[end - 1] + step_m) / target.step_m) + 1, target.grid_size - 1)
        stretches.append((target.number, sign[start], first, last))
        start = end
    return stretches
