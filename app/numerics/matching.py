"""
Two-scale matching: which road, which sub-segment, where on it.

Coarse to fine, nothing lost: the salient cells, averaged over coarse steps, score every sub-segment
of every road that hears any of them; the stretches that hold all but `LEFT_OUT` of the posterior are
then aligned reading by reading with the fitted curves, and only those scores make the answer.
`app.numerics.exhaustive` is the definition of what this must return.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.domain import Fix, Window
from app.numerics.alignment import align, score_positions
from app.numerics.answer import answer
from app.numerics.index import COARSE_STEPS_M, GAP, CoarseProfile, MapIndex
from app.numerics.observation import TERMS, coefficients, marginal_score
from app.numerics.posterior import Places, kept_by_mass
from app.numerics.query import Query, ask, choose
from app.numerics.refinement import refine

LEFT_OUT = 1e-4  # share of the coarse posterior that the fine scale may never see
COARSE_FLATTENING = 2.0  # coarse scores err; flattening them keeps what they would lose
MOST_KEPT = 1000  # coarse positions a query may align: bounds the time of a hopeless window
BOTH = (1, -1)


def locate(index: MapIndex, window: Window, *, confidence: float = 0.68) -> Fix:
    """
    Where the last sample of a window was taken.

    Args:
        window: At least one sample; cells in any order.
        confidence: Of the accuracy radius, between 0 and 1.

    Returns:
        The fix; its candidates' posteriors and ``off_map_posterior`` sum to 1.
    """
    query = ask(index, window)
    places = fine_places(index, query, shortlist(index, query))
    return answer(index, query, refine(index, query, places), confidence)


@dataclass(frozen=True, slots=True, eq=False)
class Coarse:
    """Coarse positions and their scores; ``step_m`` of road about each."""

    road: Int[np.ndarray, " positions"]
    sign: Int[np.ndarray, " positions"]
    chainage_m: Float[np.ndarray, " positions"]
    score: Float[np.ndarray, " positions"]
    step_m: float


def shortlist(index: MapIndex, query: Query) -> Coarse:
    """The coarse positions that hold all but `LEFT_OUT` of the posterior."""
    level = next(i for i, step in enumerate(COARSE_STEPS_M) if query.length_m <= step * (GAP - 1))
    step_m = COARSE_STEPS_M[level]
    tapes = [t for t in index.tapes if not t.column.keys().isdisjoint(query.cells)]
    parts = [
        part
        for tape in tapes or index.tapes
        for part in _score_tape(index, query, tape.levels[level], tape.column)
    ]
    road = np.concatenate([part.road for part in parts])
    sign = np.concatenate([part.sign for part in parts])
    chainage_m = np.concatenate([part.chainage_m for part in parts])
    score = np.concatenate([part.score for part in parts])
    flat = index.calibration.temperature * COARSE_FLATTENING
    kept = kept_by_mass(score, flat, LEFT_OUT, MOST_KEPT)
    return Coarse(road[kept], sign[kept], chainage_m[kept], score[kept], step_m)


def _score_tape(
    index: MapIndex, query: Query, level: CoarseProfile, column: dict[str, int]
) -> list[Coarse]:
    seen = query.at_step(level.step_m)
    chosen = choose(query, column)
    rows = np.empty((TERMS * len(chosen.there) + 2, len(level.outside)), dtype=np.float32)
    rows[:-2] = level.along.terms[chosen.there].reshape(-1, len(level.outside))
    rows[-2], rows[-1] = level.along.base, level.outside
    factors = coefficients(seen, chosen.here)
    behind = np.rint(seen.behind_m / level.step_m).astype(np.intp)
    out = []
    for sign in BOTH:
        channels = score_positions(rows, factors, behind, level.positions, sign)
        score = marginal_score(channels, index.calibration.offset_sd_db)
        out.append(
            Coarse(level.road, np.full(len(score), sign), level.chainage_m, score, level.step_m)
        )
    return out


def fine_places(index: MapIndex, query: Query, kept: Coarse) -> Places:
    """Align the window at every metre of the stretches kept, each stretch with its neighbours."""
    parts = []
    key = kept.road * 2 + (kept.sign > 0)
    for one in np.unique(key):
        mine = np.sort(kept.chainage_m[key == one])
        road, sign = index.roads[one >> 1], 1 if one & 1 else -1
        for run in np.split(mine, np.flatnonzero(np.diff(mine) > 2.5 * kept.step_m) + 1):
            first = max(int((run[0] - kept.step_m) / road.step_m), 0)
            last = min(int(np.ceil((run[-1] + kept.step_m) / road.step_m)), road.grid_size - 1)
            parts.append(_stretch(index, query, int(one) >> 1, sign, first, last))
    return Places.join(parts)


def whole_roads(index: MapIndex, query: Query) -> Places:
    """Every metre of every road in both directions: what `app.numerics.exhaustive` looks at."""
    return Places.join(
        [
            _stretch(index, query, number, sign, 0, road.grid_size - 1)
            for number, road in enumerate(index.roads)
            for sign in BOTH
        ]
    )


def _stretch(
    index: MapIndex, query: Query, number: int, sign: int, first: int, last: int
) -> Places:
    road = index.roads[number]
    grid = np.arange(first, last + 1)
    fit = align(
        road.along, road.column, query, grid, sign, road.step_m, index.calibration.offset_sd_db
    )
    return Places(
        np.full(len(grid), number),
        np.full(len(grid), sign),
        np.minimum(grid * road.step_m, road.length_m),
        np.full(len(grid), road.step_m),
        fit.score,
        fit.residual,
        fit.weight,
    )
