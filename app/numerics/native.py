"""
The kernels in C, and whether they are there.

Each is the twin of numpy code that stays its definition; `tests/numerics/test_native.py` holds them
equal. An installation without a compiler lacks the extension module and answers with numpy alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Float32, Int
from numpy.typing import NDArray

from app.numerics.observation import (
    CENTRE_DBM,
    CORRELATION_M,
    HEARING_WEIGHT,
    OUTSIDE_HEARD,
    Evidence,
)
from app.numerics.offsets import OffsetPrior
from app.numerics.posterior import VALUES, Places

try:
    from app.numerics import _native
except ImportError:
    BUILT = False
else:
    BUILT = _native.VERSION == 28  # a library left by an older version of the code is not used

OUTSIDE_LOG = math.log(OUTSIDE_HEARD)

Floats = NDArray[np.float64]
Wholes = NDArray[np.signedinteger[Any]]
Likelihood = tuple[float, float, float, float, float, float, float, float, float]


def likelihood(prior: OffsetPrior) -> Likelihood:
    """
    The constants of `app.numerics.observation` and a window's prior, as the kernels take them:
    variances are divided by its temperature, which is the last of all.
    """
    like_db2, like_log, any_db2, any_log, group_db2, apart, temperature = prior
    cooled = 1.0 / temperature
    return (
        *(HEARING_WEIGHT, OUTSIDE_LOG, like_db2 * cooled, like_log, any_db2 * cooled, any_log),
        *(group_db2 * cooled, apart, temperature),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """
    A window's evidence in one piece.

    Attributes:
        block: ``behind_m``, ``weight``, ``rsrp_db``, ``heard`` and ``share`` of an `Evidence`, end
            to end; what follows them is unused.
        samples: How many samples the evidence has.
        group: Number of each cell's group among the window's, from 0 on.
    """

    block: Float[np.ndarray, " numbers"]
    samples: int
    group: list[int]


class Aimed(NamedTuple):
    """
    A window for one profile.

    Attributes:
        block, samples, group: See `Told`.
        numbers: Of the window's cells in the profile, -1 where it lacks one.
    """

    block: Float[np.ndarray, " numbers"]
    samples: int
    numbers: list[int]
    group: list[int]


def heard_columns(rsrp_dbm: Float[np.ndarray, "samples cells"]) -> list[int]:
    """Columns that hold any reading."""
    return _native.heard_columns(np.ascontiguousarray(rsrp_dbm, dtype=np.float64))


def evidence(
    distance_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    columns: list[int],
    step_m: float,
    carrier: list[int],
    group: list[int],
) -> tuple[Told, Evidence]:
    """
    Twin of `app.numerics.observation.evidence` for some columns, in both forms.

    Args:
        carrier: Number of each column's carrier, any numbers.
        group: Number of each column's group, from 0 on.
    """
    count = len(columns)
    block = np.empty(len(distance_m) * (2 + 3 * count))
    samples = _native.evidence(
        np.ascontiguousarray(distance_m, dtype=np.float64),
        np.ascontiguousarray(rsrp_dbm, dtype=np.float64),
        columns,
        carrier,
        step_m,
        CENTRE_DBM,
        CORRELATION_M,
        block,
    )
    level, heard, share, end = [(2 + part * count) * samples for part in range(4)]
    seen = Evidence(
        block[:samples],
        block[level:heard].reshape(samples, count),
        block[heard:share].reshape(samples, count),
        block[share:end].reshape(samples, count),
        block[samples:level],
    )
    return Told(block, samples, group), seen


def score_tape(
    aimed: Aimed,
    profile: tuple[Float32[np.ndarray, "cells blocks 4 16"], Float32[np.ndarray, " columns"]],
    positions: Int[np.ndarray, " positions"],
    step_m: float,
    terms: Likelihood,
    score: Float32[np.ndarray, " scores"],
    arms: tuple[()] | tuple[Wholes, Float32[np.ndarray, "arms channels ends"]] = (),
) -> None:
    """
    Fill in scores of all positions of a tape in one direction of travel, then in the other.

    Args:
        profile: Blocks and outside of an `app.numerics.tapes.CoarseProfile`.
        arms: Of the tape's junctions, and the parts to fill in: twin of
            `app.numerics.corners.score_arms`.
    """
    _native.tape(*aimed, *profile, positions, step_m, terms, score, *arms)


def score_turns(
    parts: Float32[np.ndarray, "arms channels ends"],
    turns: tuple[Wholes, Wholes, Wholes],
    span: tuple[int, int],
    terms: Likelihood,
) -> Float32[np.ndarray, "turns ends"]:
    """
    Twin of `app.numerics.corners.score_turns`.

    Args:
        turns: The arms that each turn goes onto and comes by, and its columns of road.
        span: First and last column past a junction that a window may end at.
    """
    score = np.empty((len(turns[0]), parts.shape[2]), dtype=np.float32)
    _native.turns(parts, *turns, *span, terms, score)
    return score


def no_places(count: int) -> Places:
    """Room for so many places, to be filled stretch by stretch."""
    return Places(np.empty((2, count), dtype=np.int64), np.empty((VALUES, count)))


def score_stretch(
    aimed: Aimed,
    rows: Float32[np.ndarray, "rows columns"],
    stretch: tuple[int, int, int, int],
    metres: tuple[float, float],
    terms: Likelihood,
    places: Places,
    at: int,
) -> None:
    """
    Fill in places along a stretch of road, as `app.numerics.matching` does with numpy.

    Args:
        stretch: Number of the road, +1 or -1, first and last grid position.
        metres: Step and length of the road.
        at: Which of ``places`` is the first.
    """
    _native.stretch(
        *aimed,
        rows,
        *stretch,
        *metres,
        terms,
        places.where,
        places.values,
        at,
    )


def rows(
    places: Places,
    step_m: Float[np.ndarray, " roads"],
    lowest: float,
    limits: tuple[int, int, int],
) -> list[tuple[int, int, int]]:
    """
    Road, first and end of the rows that are drawn anew: twin of `app.numerics.refinement._rows`.

    Args:
        limits: Places about a peak, places that a row needs, and rows at most.
    """
    return _native.rows(places.where, places.values, step_m, lowest, *limits)


def redrawn(
    aimed: Aimed,
    bend: Float32[np.ndarray, "cells columns"],
    places: Places,
    row: tuple[int, int],
    parts: int,
    step_m: float,
    like_db2: float,
) -> Places:
    """All places, those of a row drawn anew: the rest of `app.numerics.refinement.refine`."""
    first, end = row
    finer = no_places(len(places) + (parts - 1) * (end - first - 1))
    _native.redrawn(
        *aimed,
        bend,
        places.where,
        places.values,
        first,
        end,
        parts,
        step_m,
        like_db2,
        finer.where,
        finer.values,
    )
    return finer
