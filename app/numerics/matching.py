"""
Two-scale matching: which road, which sub-segment, where on it.

Coarse to fine, nothing lost: the salient cells, averaged over coarse steps, score every sub-segment
of every road that hears any of them; the stretches that hold all but `LEFT_OUT` of the posterior
are then aligned reading by reading with the fitted curves, and only those scores make the answer.
`app.numerics.exhaustive` is the definition of what this must return.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.domain import Fix, Window
from app.numerics import native
from app.numerics.alignment import align, score_positions
from app.numerics.answer import answer
from app.numerics.index import BOTH, COARSE_STEPS_M, GAP, MapIndex, Tape
from app.numerics.observation import offset_gain
from app.numerics.posterior import (
    CHAINAGE,
    RESIDUAL,
    SCORE,
    VALUES,
    WEIGHT,
    WIDTH,
    Places,
    kept_by_mass,
)
from app.numerics.query import Query, ask
from app.numerics.refinement import refine

LEFT_OUT = 1e-4  # share of the coarse posterior that the fine scale may never see
COARSE_FLATTENING = 2.0  # coarse scores err; flattening them keeps what they would lose
JOINED_STEPS = 2.5  # stretches closer than this are aligned in one product
MOST_KEPT = 1000  # coarse positions a query may align: bounds the time of a hopeless window


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

    def take(self, rows: Int[np.ndarray, " kept"]) -> Coarse:
        """The positions at these indices."""
        return Coarse(
            self.road[rows], self.sign[rows], self.chainage_m[rows], self.score[rows], self.step_m
        )


def shortlist(
    index: MapIndex,
    query: Query,
    without: int | None = None,
    foreseen: Callable[[Coarse], Coarse] | None = None,
) -> Coarse:
    """
    The coarse positions that hold all but `LEFT_OUT` of the posterior, along each road in order.

    Args:
        without: Number of a road to leave out, as if the map lacked it.
        foreseen: Adds to the scores what is known before the window is heard, see
            `app.numerics.tracking`.
    """
    size = next(i for i, step in enumerate(COARSE_STEPS_M) if query.length_m <= step * (GAP - 1))
    tapes = [tape for tape in index.tapes if not tape.column.keys().isdisjoint(query.cells)]
    scored = [_score_tape(index, query, tape, size) for tape in tapes or index.tapes]
    for tape, part in zip(tapes, scored, strict=False):
        if not tape.known.issuperset(query.cells):
            # Tapes compare only when each pays for the cells that none of its roads has heard.
            part.score[:] += query.unmapped_score(tape.known)
    every = scored[0] if len(scored) == 1 else _joined(scored)
    if without is not None:
        every = every.take((every.road != without).nonzero()[0])
    if foreseen is not None:
        every = foreseen(every)
    flat = query.temperature(index.calibration) * COARSE_FLATTENING
    keep = kept_by_mass if query.told is None else native.kept_by_mass
    return every.take(keep(every.score, flat, LEFT_OUT, MOST_KEPT))


def _score_tape(index: MapIndex, query: Query, tape: Tape, size: int) -> Coarse:
    level = tape.levels[size]
    if query.told is not None:
        score = native.score_tape(
            query.aimed(query.told, tape.column),
            level.along.rows,
            level.positions,
            level.step_m,
            index.likelihood,
        )
        return Coarse(level.road, level.sign, level.chainage_m, score, level.step_m)
    aim = query.aim(tape.column, level.step_m, joined=True)
    rows = level.along.rows if aim.rows is None else level.along.rows[aim.rows]
    behind = aim.behind[:, None]
    ways = np.concatenate((level.positions - behind, level.positions + behind), axis=1)
    factors = aim.factors.astype(np.float32)  # precise enough to choose what to look at closer
    score, residual, weight = score_positions(rows, factors, ways)
    score += offset_gain(residual, weight, index.offset_prior)
    return Coarse(level.road, level.sign, level.chainage_m, score, level.step_m)


def _joined(parts: list[Coarse]) -> Coarse:
    return Coarse(
        np.concatenate([part.road for part in parts]),
        np.concatenate([part.sign for part in parts]),
        np.concatenate([part.chainage_m for part in parts]),
        np.concatenate([part.score for part in parts]),
        parts[0].step_m,
    )


def fine_places(index: MapIndex, query: Query, kept: Coarse) -> Places:
    """Align the window at every metre of the stretches kept, each stretch with its neighbours."""
    stretches = _stretches(index, kept)
    if query.told is not None:
        return _lay_stretches(index, query, query.told, stretches)
    parts = [_stretch(index, query, *one) for one in stretches]
    return parts[0] if len(parts) == 1 else Places.join(parts)


def _stretches(index: MapIndex, kept: Coarse) -> list[tuple[int, int, int, int]]:
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


def _lay_stretches(
    index: MapIndex, query: Query, told: native.Told, stretches: list[tuple[int, int, int, int]]
) -> Places:
    """Twin of `_stretch` and `Places.join`."""
    places = native.no_places(sum([last + 1 - first for _, _, first, last in stretches]))
    at = 0
    for one in stretches:
        road = index.roads[one[0]]
        aimed, metres = query.aimed(told, road.column), (road.step_m, road.length_m)
        native.score_stretch(aimed, road.along.rows, one, metres, index.likelihood, places, at)
        at += one[3] + 1 - one[2]
    return places


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
    road, aim = index.roads[number], query.aim_at(index, number)
    score, residual, weight = align(road.along, aim, first + 1, last + 1, sign)
    values = np.empty((VALUES, last + 1 - first))
    values[CHAINAGE] = np.arange(first, last + 1) * road.step_m
    values[WIDTH] = road.step_m
    values[SCORE] = score + offset_gain(residual, weight, index.offset_prior)
    values[SCORE] += aim.constant
    values[RESIDUAL], values[WEIGHT] = residual, weight
    if last == road.grid_size - 1:
        values[CHAINAGE, -1] = road.length_m
    return Places(np.full((2, last + 1 - first), ((number,), (sign,))), values)
