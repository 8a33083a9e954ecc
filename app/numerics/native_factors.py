"""The kernels of `app.numerics.odometer`; whether they are there says `app.numerics.native`."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from app.numerics.native import Floats, Likelihood, Told, Wholes
from app.numerics.posterior import VALUES, Known, Places
from app.numerics.stretches import Stretch

with suppress(ImportError):
    from app.numerics import _native

# A road's rows and bend, numbers of the window's cells, a stretch, and the road's step and length.
Laid = tuple[NDArray[np.float32], NDArray[np.float32], list[int], int, int, int, int, float, float]


def stretches_about(
    places: Places,
    roads: tuple[Float[np.ndarray, " roads"], Wholes],
    near: tuple[float, float],
    limits: tuple[float, float, float],
) -> tuple[float, list[Stretch]]:
    """
    Width of the peak and stretches about it: twins of `app.numerics.odometer.peak_width_m` and
    `app.numerics.odometer.stretches_about`.

    Args:
        roads: Step and size of each road's grid.
        near: How far under the best score places are of the peak, and carry mass.
        limits: Widest peak that has stretches, their reach, and their length together at most.
    """
    return _native.stretches_about(places.where, places.values, *roads, *near, *limits)


def under_factors(
    told: Told,
    stretches: list[Laid],
    factors: tuple[Floats, Floats, float, int, float],
    terms: Likelihood,
    drawn: tuple[Floats, float, int, int, int, int],
    given: tuple[Places, int],
) -> tuple[Places, Known, float]:
    """
    The rest of `app.numerics.odometer.under_other_factors`, the places before included.

    Args:
        factors: What distances are multiplied by, the logs of its prior, the temperature, how many
            of the last are looked at on one side alone, a half each, and how far under the best
            the outermost of the others may be for that.
        drawn: Each road's step, how far under the best a peak may lie, places about a peak, places
            that a row needs, rows at most, and parts that a step is divided into.
        given: The places before, and how many of them lie along single roads.

    Returns:
        All places, what is known of the last ones, and the log prior of all factors together.
    """
    step_m, lowest, around, least, most, parts = drawn
    before, straight = given
    room = len(factors[0]) * sum([one[6] - one[5] + 1 for one in stretches])
    room += most * (parts - 1) * 2 * around
    count = len(before) + room
    where, values = np.empty(2 * count, dtype=np.int64), np.empty(VALUES * count)
    log_prior, factor = np.empty((2, room))
    found, together = _native.under_factors(
        told.block,
        told.samples,
        stretches[0][2],
        told.group,
        stretches,
        *factors,
        terms,
        step_m,
        lowest,
        around,
        least,
        most,
        parts,
        before.where,
        before.values,
        straight,
        where,
        values,
        log_prior,
        factor,
    )
    count = len(before) + found
    places = Places(
        where[: 2 * count].reshape(2, count), values[: VALUES * count].reshape(VALUES, count)
    )
    return places, Known(log_prior[:found], factor[:found]), together
