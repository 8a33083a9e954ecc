"""
The kernels that choose coarse positions (`app.numerics.coarse`, `app.numerics.chosen`); whether
they are there says `app.numerics.native`.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float, Float32, Int

from app.numerics.native import Wholes
from app.numerics.posterior import Heaviest

with suppress(ImportError):
    from app.numerics import _native


def kept_by_mass(
    score: Float32[np.ndarray, " places"], temperature: float, left_out: float, most: int
) -> Int[np.ndarray, " kept"]:
    """Twin of `app.numerics.posterior.kept_by_mass`."""
    kept = np.empty(min(len(score), most), dtype=np.int64)
    return kept[: _native.kept_by_mass(score, temperature, left_out, most, kept)]


def heaviest(
    score: Float32[np.ndarray, " places"],
    temperature: float,
    left_out: tuple[float, float],
    most: int,
) -> Heaviest:
    """Twin of `app.numerics.posterior.heaviest`."""
    kept = np.empty(most + 1, dtype=np.int64)
    count, whole, total = _native.heaviest(score, temperature, *left_out, most, kept)
    return Heaviest(kept[:count], whole, total)


def with_neighbours(
    number: Int[np.ndarray, " places"],
    rows: Int[np.ndarray, " chosen"],
    here: Int[np.ndarray, " chosen"],
    scores: int,
) -> Int[np.ndarray, " more"]:
    """
    Twin of `app.numerics.coarse.Scored.with_neighbours`.

    Args:
        here: Which of all places each row's is.
        scores: How many rows there are.
    """
    found = np.empty(3 * len(rows), dtype=np.int64)
    return found[: _native.with_neighbours(number, rows, here, scores, found)]


def stretches_of_coarse(
    chainage_m: Float[np.ndarray, " kept"],
    where: tuple[Wholes, Wholes],
    metres: tuple[float, float],
    roads: tuple[Float[np.ndarray, " roads"], Wholes],
) -> list[tuple[int, int, int, int]]:
    """
    Twin of `app.numerics.matching.stretches_of`.

    Args:
        where: Road and direction of each position.
        metres: The coarse step, and how far apart positions of one row may be.
        roads: Step and size of each road's grid.
    """
    return _native.stretches_of_coarse(chainage_m, *where, *metres, *roads)


def rest(
    score: Float32[np.ndarray, " places"],
    runs: Int[np.ndarray, " runs"],
    covered: Int[np.ndarray, " covered"],
    scale: tuple[float, float, float, float],
    left_out: float,
) -> tuple[Int[np.ndarray, " kept"], Float[np.ndarray, " kept"]]:
    """
    Twin of `app.numerics.chosen.sum_rest`.

    Args:
        scale: Temperature, step in metres, highest score, metres of road that are aligned.
    """
    best, width_m = np.empty(len(runs), dtype=np.int64), np.empty(len(runs))
    kept = _native.rest(score, runs, covered, *scale, left_out, best, width_m)
    return best[:kept], width_m[:kept]
