"""The coarse scale: all places of the map at coarse steps, and the likely ones among them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from app.numerics import native, native_chosen
from app.numerics.alignment import score_positions
from app.numerics.corners import Laid, LaidArms, score_arms
from app.numerics.index import MapIndex
from app.numerics.newcomers import Columns
from app.numerics.observation import TERMS
from app.numerics.offsets import take_offsets
from app.numerics.posterior import kept_by_mass
from app.numerics.query import Query
from app.numerics.tapes import (
    COARSE_STEPS_M,
    GAP,
    NUMBERS,
    CoarsePlaces,
    CoarseProfile,
    joined_runs,
)

LEFT_OUT = 1e-4  # share of the coarse posterior that no answer counts
COARSE_FLATTENING = 2.0  # coarse scores err; flattening them keeps what they would lose
MOST_KEPT = 4000  # coarse positions of a `shortlist`
LACKED = 4  # cells that a tape may lack which another knows, and still be where the window was
KNOWN_SHARE = 0.25  # of the cells that the best tape knows: who knows as many may lack more
LOOKED_AT = 0.995  # share of the posterior that is aligned; the rest keeps its coarse scores
MOST_ALIGNED = 192  # coarse positions, not counting neighbours: bounds the time of a query
FLANK = 1  # neighbours on either side that are aligned with a position


@dataclass(frozen=True, slots=True, eq=False)
class Coarse:
    """
    Coarse positions along each road in order, and their scores; ``step_m`` of road about each.

    Attributes:
        closer: Which of them are worth aligning; None = all.
    """

    places: CoarsePlaces
    score: Float[np.ndarray, " positions"]
    step_m: float
    closer: Bool[np.ndarray, " positions"] | None = None

    @property
    def road(self) -> Int[np.ndarray, " positions"]:
        """Road number."""
        return self.places.road

    @property
    def sign(self) -> Int[np.ndarray, " positions"]:
        """Direction of travel."""
        return self.places.sign

    @property
    def chainage_m(self) -> Float[np.ndarray, " positions"]:
        """Chainage of the window's last sample."""
        return self.places.chainage_m

    @property
    def beside(self) -> Bool[np.ndarray, " pairs"]:
        """Whether each position and the next are neighbours on a road."""
        number = self.places.number
        return np.asarray(number[1:] - number[:-1] == 1)

    def take(self, rows: np.ndarray) -> Coarse:
        """The positions at these indices."""
        closer = None if self.closer is None else self.closer[rows]
        return Coarse(self.places.take(rows), self.score.take(rows), self.step_m, closer)


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
    scored = score_roads(index, query, tapes_of(index, query, without), None)
    if without is None and foreseen is None:
        rows, closer = _kept(index, query, scored.score)
        return _flanked(scored.take(rows), closer)
    every = scored.all()
    if without is not None:
        every = every.take((every.road != without).nonzero()[0])
    rank = every.score if foreseen is None else foreseen(every).score
    rows, closer = _kept(index, query, rank)
    return _flanked(every.take(rows), closer)


def tapes_of(index: MapIndex, query: Query, without: int | None = None) -> list[int]:
    """
    Numbers of the tapes that have business with a window: those where a cell is heard that is
    salient there, and those that know not many fewer of its cells than the one that knows most.

    Args:
        without: Number of a road that the map is to lack.
    """
    if len(index.tapes) == 1 and without is None:
        return [0]
    known, salient = index.acquaintance.of(query.cells)
    if without is not None:
        alone = [tape.roads == (without,) for tape in index.tapes]
        known[alone], salient[alone] = -LACKED - 1, 0
    most = known.max(initial=0)
    wanted = (salient > 0) | (known >= min(KNOWN_SHARE * most, most - LACKED))
    return wanted.nonzero()[0].tolist()


def size_of(query: Query) -> int:
    """Number of the coarse step that a window of this length needs."""
    return next(i for i, step in enumerate(COARSE_STEPS_M) if query.length_m <= step * (GAP - 1))


def flattened(index: MapIndex, query: Query) -> float:
    """What coarse scores are divided by."""
    return query.temperature(index.calibration) * COARSE_FLATTENING


def _kept(
    index: MapIndex, query: Query, rank: Float[np.ndarray, " positions"]
) -> tuple[Int[np.ndarray, " kept"], Bool[np.ndarray, " kept"] | None]:
    """Positions that hold all but `LEFT_OUT`, and which of them to align; None = all."""
    flat = flattened(index, query)
    keep = kept_by_mass if query.told is None else native_chosen.kept_by_mass
    rows = keep(rank, flat, LEFT_OUT, MOST_KEPT)
    if len(rows) <= MOST_ALIGNED:
        return rows, None
    closer = np.zeros(len(rows), dtype=bool)
    closer[keep(rank[rows], flat, 1.0 - LOOKED_AT, MOST_ALIGNED)] = True
    return rows, closer


def _flanked(kept: Coarse, closer: Bool[np.ndarray, " positions"] | None) -> Coarse:
    """The positions, those beside one that is looked at closer marked, too."""
    if closer is None:
        return kept
    for _ in range(FLANK):
        closer = closer | neighbours(closer, kept.beside)
    return replace(kept, closer=closer)


def neighbours(
    chosen: Bool[np.ndarray, " positions"], beside: Bool[np.ndarray, " pairs"]
) -> Bool[np.ndarray, " positions"]:
    """The positions beside those chosen."""
    found = np.zeros_like(chosen)
    found[1:] |= chosen[:-1] & beside
    found[:-1] |= chosen[1:] & beside
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """
    The scores of some of a map's tapes, one after the other.

    Attributes:
        levels: The tapes at the window's step.
        starts: Where each tape's scores begin; None = all tapes were scored.
        shift: How much farther on its places begin among those of all tapes.
    """

    every: CoarsePlaces
    score: Float32[np.ndarray, " positions"]
    step_m: float
    levels: list[CoarseProfile]
    starts: Int[np.ndarray, " tapes"] | None = None
    shift: Int[np.ndarray, " tapes"] | None = None

    def take(self, rows: Int[np.ndarray, " chosen"]) -> Coarse:
        """The positions at these indices, increasing: most are never looked at."""
        return Coarse(self.every.take(self._numbers(rows)), self.score.take(rows), self.step_m)

    def runs(self) -> Int[np.ndarray, " runs"]:
        """Which position is the first of each sub-segment and direction."""
        return joined_runs(self.levels)

    def with_neighbours(
        self, rows: Int[np.ndarray, " chosen"], *, in_c: bool
    ) -> Int[np.ndarray, " more"]:
        """Indices of the positions at these, increasing, and of those beside them on a road."""
        number, here = self.every.number, self._numbers(rows)
        if in_c:
            return native_chosen.with_neighbours(number, rows, here, len(self.score))
        own = number[here]
        marked = np.zeros(len(self.score), dtype=bool)
        marked[rows] = True
        marked[rows[number.take(here + 1, mode="clip") - own == 1] + 1] = True
        marked[rows[own - number.take(here - 1, mode="clip") == 1] - 1] = True
        return marked.nonzero()[0]

    def _numbers(self, rows: Int[np.ndarray, " chosen"]) -> Int[np.ndarray, " chosen"]:
        """Indices among the places of all tapes."""
        if self.starts is None or self.shift is None:
            return rows
        return np.asarray(rows + self.shift[self.starts.searchsorted(rows, side="right") - 1])

    def all(self) -> Coarse:
        """All positions."""
        if self.starts is None:
            return Coarse(self.every, self.score, self.step_m)
        return self.take(np.arange(len(self.score)))


def score_roads(index: MapIndex, query: Query, tapes: list[int], laid: Laid | None) -> Scored:
    """All places along the tapes' roads; what the window says on their arms is filled in."""
    size = size_of(query)
    levels = [index.tapes[number].levels[size] for number in tapes]
    starts = list(accumulate([len(level.places) for level in levels], initial=0))
    score = np.empty(starts.pop(), dtype=np.float32)
    for number, level, start in zip(tapes, levels, starts, strict=True):
        arms = None if laid is None else laid.of(number)
        own = score[start : start + len(level.places)]
        _score_tape(index, query, index.tapes[number].column, level, arms, own)
    every, step_m = index.coarse_places[size], COARSE_STEPS_M[size]
    if len(tapes) == len(index.tapes):
        return Scored(every, score, step_m, levels)
    first = np.array(starts)
    shift = every.number.searchsorted(np.array(tapes) * NUMBERS) - first
    return Scored(every, score, step_m, levels, first, shift)


def merged(
    factors: Float[np.ndarray, "channels samples rows"],
) -> Float32[np.ndarray, "channels samples merged"]:
    """Factors of a `CoarseProfile`'s rows; precise enough to choose what to look at closer."""
    by_cell = factors[:, :, :-1].reshape(*factors.shape[:2], -1, TERMS)
    chosen = by_cell[..., [0, 1, 2, 4]] * np.array([1.0, 1.0, -2.0, 1.0])  # C's factor is -h / 2
    rows = chosen.reshape(*factors.shape[:2], -1)
    return np.concatenate((rows, factors[:, :, -1:]), axis=2).astype(np.float32)


def _score_tape(
    index: MapIndex,
    query: Query,
    column: Columns,
    level: CoarseProfile,
    arms: LaidArms | None,
    score: Float32[np.ndarray, " places"],
) -> None:
    """Fill in the scores of all places along a tape's roads, and what is said on its arms."""
    if query.told is not None:
        native.score_tape(
            query.aimed(query.told, column),
            (level.blocks, level.outside),
            level.positions,
            level.step_m,
            query.likelihood(index),
            score,
            () if arms is None else (arms.where, arms.parts),
        )
        return
    aim = query.aim(column, level.step_m, joined=True)
    rows = level.rows(aim.cells(len(column)))
    behind = aim.behind[:, None]
    ways = np.concatenate((level.positions - behind, level.positions + behind), axis=1)
    factors = merged(aim.factors)
    plain, *sums = score_positions(rows, factors, ways)
    score[:] = plain + take_offsets(np.array(sums), query.prior(index)).gain
    if arms is not None:
        score_arms(factors, aim.behind, rows, arms)
