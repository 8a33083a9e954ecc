"""
Which coarse positions are aligned, and what is kept of the rest.

A window lies along one road, or round one corner (`app.numerics.corners`). All places of both kinds
are scored at coarse steps and share one posterior. Few are worth aligning; of the others each
sub-segment and direction keeps one place that stands for all of its road, so that a window which
fits in many places loses none of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from app.numerics import native_chosen
from app.numerics.coarse import (
    FLANK,
    LEFT_OUT,
    LOOKED_AT,
    MOST_ALIGNED,
    Coarse,
    Scored,
    flattened,
    score_roads,
    size_of,
    tapes_of,
)
from app.numerics.corners import (
    TURN_SHARE,
    Corner,
    lay,
    may_turn,
    score_turns,
    worth_laying,
)
from app.numerics.index import MapIndex
from app.numerics.posterior import Heaviest, Places, heaviest
from app.numerics.query import Query

UNNAMED = 5e-4  # share of the posterior that the lightest sub-segments may hold together


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """
    All coarse positions, and those of them that are worth aligning.

    Attributes:
        closer: Those, along each road in order.
        whole: Whether the others hold no more than `LEFT_OUT`.
        rows: Which of all they are.
    """

    every: Scored
    closer: Coarse
    whole: bool
    rows: Int[np.ndarray, " aligned"]


def choose(index: MapIndex, query: Query, *, strays: bool = False) -> tuple[Chosen, list[Corner]]:
    """
    The coarse positions worth aligning, and the turns that the window is worth laying round.

    Places along roads and round corners share one posterior. The best place along a road is always
    among those chosen.

    Args:
        strays: See `app.numerics.corners.may_turn`.
    """
    if not may_turn(index, query, strays=strays):
        every = score_roads(index, query, tapes_of(index, query), None)
        found = _worth_aligning(index, query, every.score)
        return _chosen(query, every, found.rows, whole=found.whole), []
    tapes = tapes_of(index, query)
    laid = lay(index, query, size_of(query), tapes)
    every = score_roads(index, query, tapes, laid)
    straight, flat = len(every.score), flattened(index, query)
    prior = np.float32(flat * np.log(TURN_SHARE))  # what is known beforehand is not flattened
    rank = np.concatenate((every.score, score_turns(index, query, laid).ravel() + prior))
    found = _worth_aligning(index, query, rank)
    rows = found.rows[: found.rows.searchsorted(straight)]
    round_ = found.rows[len(rows) :]
    mass = np.exp((rank[round_] - rank.max()) / flat) / found.total
    corners = worth_laying(index, query, laid, round_ - straight, mass)
    best = int(every.score.argmax())
    at = int(rows.searchsorted(best))
    if at == len(rows) or rows[at] != best:
        rows = np.insert(rows, at, best)
    return _chosen(query, every, rows, whole=found.whole), corners


def _worth_aligning(index: MapIndex, query: Query, rank: np.ndarray) -> Heaviest:
    keep = heaviest if query.told is None else native_chosen.heaviest
    return keep(rank, flattened(index, query), (LEFT_OUT, 1.0 - LOOKED_AT), MOST_ALIGNED)


def _chosen(query: Query, every: Scored, rows: np.ndarray, *, whole: bool) -> Chosen:
    """Where more carries the posterior than is aligned, those beside are aligned, too."""
    for _ in range(0 if whole else FLANK):
        rows = every.with_neighbours(rows, in_c=query.told is not None)
    return Chosen(every, every.take(rows), whole, rows)


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """
    What is kept of positions that are not aligned.

    Attributes:
        best: Index of the best position of each sub-segment and direction.
        width_m: Length of road that has its density and as much mass as all of them together.
    """

    best: Int[np.ndarray, " runs"]
    width_m: Float[np.ndarray, " runs"]


@dataclass(frozen=True, slots=True)
class Scale:
    """
    What scores of a `Rest` are held against.

    Attributes:
        highest: Higher ones count as this: the best place aligned.
        aligned_m: Length of road at that density which all that is aligned is worth.
    """

    temperature: float
    step_m: float
    highest: float
    aligned_m: float


def sum_rest(
    score: Float32[np.ndarray, " positions"],
    runs: Int[np.ndarray, " runs"],
    covered: Int[np.ndarray, " covered"],
    scale: Scale,
) -> Rest:
    """
    One place for each sub-segment and direction, but for the lightest, `UNNAMED` together.

    Args:
        runs: Which position is the first of each sub-segment and direction.
        covered: Positions that do not count.
    """
    free = score.astype(np.float64)
    free[covered] = -np.inf
    density = np.exp((np.minimum(free, scale.highest) - scale.highest) / scale.temperature)
    mass_m = scale.step_m * np.add.reduceat(density, runs)
    top = np.repeat(np.maximum.reduceat(free, runs), np.diff(runs, append=len(score)))
    first = (free == top).nonzero()[0]
    best = first[first.searchsorted(runs)]
    least_m = UNNAMED / len(runs) * (float(mass_m.sum()) + scale.aligned_m)
    kept = mass_m > least_m
    return Rest(best[kept], mass_m[kept] / density[best[kept]])


def rest_of(
    index: MapIndex, query: Query, chosen: Chosen, aligned: Places
) -> tuple[Coarse, Float[np.ndarray, " rest"]]:
    """What is kept of the positions that were not aligned, and length of road it stands for."""
    every, highest = chosen.every, float(aligned.score.max())
    runs = every.runs()
    temperature = query.temperature(index.calibration)
    aligned_m = float(np.exp((aligned.score - highest) / temperature) @ aligned.width_m)
    scale = Scale(temperature, every.step_m, highest, aligned_m)
    in_c = query.told is not None
    covered = every.with_neighbours(chosen.rows, in_c=in_c)  # what aligning says all of
    if in_c:
        against = (temperature, every.step_m, highest, aligned_m)
        rest = Rest(*native_chosen.rest(every.score, runs, covered, against, UNNAMED))
    else:
        rest = sum_rest(every.score, runs, covered, scale)
    return every.take(rest.best), rest.width_m
