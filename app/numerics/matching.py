"""
Two-scale matching: which road, which sub-segment, where on it.

Coarse to fine, nothing lost: all cells, averaged over coarse steps, score every sub-segment of the
roads that have any of the window's cells among their salient ones; the stretches where that is
highest are then aligned reading by reading with the fitted curves. Where the posterior is spread
over more than these, the rest of it stays as the coarse scale has it: no probability is lost.
`app.numerics.exhaustive` is the definition of what this must return.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from app.domain import Fix, Window
from app.numerics import native
from app.numerics.alignment import align, score_positions
from app.numerics.answer import answer
from app.numerics.index import MapIndex
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
from app.numerics.tapes import BOTH, COARSE_STEPS_M, GAP, Tape

LEFT_OUT = 1e-4  # share of the coarse posterior that no answer counts
COARSE_FLATTENING = 2.0  # coarse scores err; flattening them keeps what they would lose
JOINED_STEPS = 2.5  # stretches closer than this are aligned in one product
MOST_KEPT = 4000  # coarse positions that an answer may count
LOOKED_AT = 0.995  # share of the posterior that is aligned; the rest keeps its coarse scores
MOST_ALIGNED = 96  # coarse positions, not counting neighbours: bounds the time of a query
FLANK = 1  # neighbours on either side that are aligned with a position


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
    """
    Coarse positions along each road in order, and their scores; ``step_m`` of road about each.

    Attributes:
        closer: Which of them are worth aligning; None = all.
    """

    road: Int[np.ndarray, " positions"]
    sign: Int[np.ndarray, " positions"]
    chainage_m: Float[np.ndarray, " positions"]
    score: Float[np.ndarray, " positions"]
    step_m: float
    closer: Bool[np.ndarray, " positions"] | None = None

    @property
    def beside(self) -> Bool[np.ndarray, " pairs"]:
        """Whether each position and the next are neighbours on a road."""
        apart_m = np.diff(self.chainage_m)
        near = (apart_m > 0.0) & (apart_m <= self.step_m)
        return np.asarray(near & (np.diff(self.road) == 0) & (np.diff(self.sign) == 0))

    def take(self, rows: np.ndarray) -> Coarse:
        """The positions at these indices, or where a mask says so."""
        closer = None if self.closer is None else self.closer[rows]
        columns = (self.road[rows], self.sign[rows], self.chainage_m[rows], self.score[rows])
        return Coarse(*columns, self.step_m, closer)


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
            `app.numerics.tracking`; it chooses positions and stays out of the scores returned.
    """
    size = next(i for i, step in enumerate(COARSE_STEPS_M) if query.length_m <= step * (GAP - 1))
    tapes = [tape for tape in index.tapes if not tape.salient.isdisjoint(query.cells)]
    scored = [_score_tape(index, query, tape, size) for tape in tapes or index.tapes]
    for tape, part in zip(tapes, scored, strict=False):
        if not tape.column.keys() >= set(query.cells):
            # Tapes compare only when each pays for the cells that none of its roads has heard.
            part.score[:] += query.unmapped_score(tape.column.keys())
    every = scored[0] if len(scored) == 1 else _joined(scored)
    if without is not None:
        every = every.take((every.road != without).nonzero()[0])
    rank = every.score if foreseen is None else foreseen(every).score
    flat = query.temperature(index.calibration) * COARSE_FLATTENING
    keep = kept_by_mass if query.told is None else native.kept_by_mass
    rows = keep(rank, flat, LEFT_OUT, MOST_KEPT)
    kept = every.take(rows)
    if len(rows) <= MOST_ALIGNED:
        return kept
    closer = np.zeros(len(rows), dtype=bool)
    closer[keep(rank[rows], flat, 1.0 - LOOKED_AT, MOST_ALIGNED)] = True
    for _ in range(FLANK):
        closer |= _neighbours(closer, kept.beside)
    return replace(kept, closer=closer)


def _neighbours(
    chosen: Bool[np.ndarray, " positions"], beside: Bool[np.ndarray, " pairs"]
) -> Bool[np.ndarray, " positions"]:
    """The positions beside those chosen."""
    found = np.zeros_like(chosen)
    found[1:] |= chosen[:-1] & beside
    found[:-1] |= chosen[1:] & beside
    return found


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
    """
    Where the window may end: metre by metre along the stretches that are worth it, each stretch
    with its neighbours, and by coarse steps elsewhere.
    """
    closer = kept.closer
    stretches = _stretches(index, kept if closer is None else kept.take(closer))
    if query.told is not None:
        aligned = _lay_stretches(index, query, query.told, stretches)
    else:
        parts = [_stretch(index, query, *one) for one in stretches]
        aligned = parts[0] if len(parts) == 1 else Places.join(parts)
    if closer is None or closer.all():
        return aligned
    return Places.join((aligned, _elsewhere(index, kept, closer, float(aligned.score.max()))))


def _elsewhere(index: MapIndex, kept: Coarse, closer: np.ndarray, highest: float) -> Places:
    """
    Coarse positions as places, but for those that are looked at closer, or beside one that is.

    Args:
        highest: Score of the best place aligned; a coarse score is no reason to look elsewhere.
    """
    rest = kept.take(~(closer | _neighbours(closer, kept.beside)))
    values = np.zeros((VALUES, len(rest.score)))
    values[CHAINAGE] = np.minimum(rest.chainage_m, index.lengths_m[rest.road])
    values[WIDTH], values[SCORE] = rest.step_m, np.minimum(rest.score, highest)
    return Places(np.stack((rest.road, rest.sign)), values)


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
