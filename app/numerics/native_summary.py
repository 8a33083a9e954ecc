"""The kernels of `app.numerics.summary` and its answer; whether they are there says `native`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from app.domain import Candidate, Direction
from app.numerics.native import Floats, Wholes
from app.numerics.posterior import Places

with suppress(ImportError):
    from app.numerics import _native

Rival = tuple[int, int, int, float, float, float, float]


def summary(
    places: Places,
    atlas: tuple[Wholes, Wholes, Wholes, Floats, Floats, Floats, Wholes],
    temperature: float,
    peak: tuple[float, float],
    radius: tuple[float, float],
    spread: tuple[float, float],
    negligible: tuple[float, float, float],
) -> tuple[int, float, int, float, float, float, float, float, list[Rival]]:
    """
    Twin of `app.numerics.summary.summarise`.

    Args:
        atlas: Start, size, sub-segments, steps, plane, edges and each road's first edge.
        peak: How far about it the position is averaged in metres, and its foot.
        radius: Confidence, and the error of surveyed positions in metres.
        spread: That error for sub-segments, and how many standard deviations of a place count.
        negligible: Mass of a place that does not count, unless such hold more than the second
            number together, and mass of a rival that is not listed.
    """
    return _native.summary(
        places.where,
        places.values,
        *atlas,
        temperature,
        *peak,
        *radius,
        *spread,
        *negligible,
    )


def candidates(
    rivals: Sequence[Rival], names: tuple[str, ...], share: float
) -> tuple[Candidate, ...]:
    """Twin of `app.numerics.answer.as_candidates`."""
    ways = Direction.FORWARD, Direction.BACKWARD
    return _native.candidates(Candidate, rivals, names, *ways, share)
