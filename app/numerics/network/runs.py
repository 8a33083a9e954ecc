"""Runs: the stretches of pieces between sharp turns, with their headings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.numerics.geodesy import Floats
from app.numerics.network.steps import Piece

HEADING_STEPS = 2  # to either side: a heading is that of 20 m
TURN_STEPS = 6  # to either side: a turn at a crossing, jitter smoothed, is over after 60 m
SHARP_COS = float(np.cos(np.radians(45.0)))  # a bend of a street that is sharper is joined again
FEWEST_STEPS = 6  # 30 m: shorter stretches between turns are manoeuvres


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """
    A stretch without a sharp turn.

    Attributes:
        xy_m: Local metres, `STEP_M` apart. Shape ``(steps, 2)``.
        heading: Unit vectors of travel. Shape ``(steps, 2)``.
        drive, piece: Numbers of the drive and of the piece that it is from.
        first: Number of its first step within the piece.
    """

    xy_m: Float[np.ndarray, "steps 2"]
    heading: Float[np.ndarray, "steps 2"]
    drive: int
    piece: int
    first: int


def cut_at_turns(pieces: Sequence[Piece]) -> list[Run]:
    """The runs of all pieces, in driving order."""
    runs: list[Run] = []
    for number, piece in enumerate(pieces):
        heading = headings(piece.xy_m)
        calm = ~_turning(piece.xy_m)
        runs += [
            Run(piece.xy_m[part], heading[part], piece.drive, number, part.start)
            for part in stretches(calm)
            if part.stop - part.start >= FEWEST_STEPS
        ]
    return runs


def headings(xy_m: Float[np.ndarray, "steps 2"]) -> Float[np.ndarray, "steps 2"]:
    """Unit vectors of travel at each step, from the steps about it."""
    at = np.arange(len(xy_m))
    ahead = np.minimum(at + HEADING_STEPS, len(xy_m) - 1)
    behind = np.maximum(at - HEADING_STEPS, 0)
    return _unit(xy_m[ahead] - xy_m[behind])


def stretches(inside: Bool[np.ndarray, " steps"]) -> list[slice]:
    """The maximal stretches of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _turning(xy_m: Floats) -> Bool[np.ndarray, " steps"]:
    """Whether the way before and the way after a step differ by more than a street bends."""
    at = np.arange(len(xy_m))
    inner = (at > 0) & (at < len(xy_m) - 1)
    before = _unit(xy_m - xy_m[np.maximum(at - TURN_STEPS, 0)])
    after = _unit(xy_m[np.minimum(at + TURN_STEPS, len(xy_m) - 1)] - xy_m)
    sharp: Bool[np.ndarray, " steps"] = inner & ((before * after).sum(axis=1) < SHARP_COS)
    return sharp


def _unit(vector: Floats) -> Floats:
    return vector / np.maximum(np.hypot(*vector.T), 1e-9)[:, None]
