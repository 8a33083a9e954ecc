"""
Where the next drive helps most, and why, in words.

A stretch's loss is the error that its windows are to expect, a wrong road counting as `WRONG_M`.
The worth of a drive is what it takes off that, on the way to the next number of passes that made
a measured difference (`app.numerics.expectation.ROAD_RIGHT`), times the stretch's length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from app.numerics.expectation import ROAD_RIGHT, pass_class, road_right
from app.numerics.geodesy import Floats

# All measured on the windows of `ROAD_RIGHT`:
WRONG_M = 250.0  # a wrong road of a grid is off by two blocks: nine in ten by less than this
ONE_DAY_M = 15.0  # median error where all passes are of one day against two days: 24 and 9 m
ONE_WAY_M = 5.0  # against the way driven: 2 % more wrong roads, 11 m for 6, every other window
ENOUGH = 3  # row of `ROAD_RIGHT` from which on more passes change little
LEAST_WORTH_M = 5.0  # a drive that takes less off the error is not worth it


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """
    Stretches of roads, in the order of road and chainage; arrays of shape ``(stretches,)``.

    Attributes:
        passes: -1 where it is not known.
        expected_error_m: NaN where nothing can be expected.
    """

    road_id: Sequence[str]
    start_m: Float[np.ndarray, " stretches"]
    end_m: Float[np.ndarray, " stretches"]
    passes: Int[np.ndarray, " stretches"]
    forward: Int[np.ndarray, " stretches"]
    days: Int[np.ndarray, " stretches"]
    expected_error_m: Float[np.ndarray, " stretches"]

    @property
    def length_m(self) -> Floats:
        """Of each stretch."""
        return self.end_m - self.start_m

    @property
    def one_way(self) -> Bool[np.ndarray, " stretches"]:
        """Driven, and in one direction only."""
        return (self.passes > 0) & ((self.forward == 0) | (self.forward == self.passes))


@dataclass(frozen=True, slots=True)
class CoverageSummary:
    """
    Lengths in metres, shares of the driven length.

    ``error_m``: percentiles of the expected error over the driven length; empty when nothing is.
    """

    length_m: float
    by_passes_m: dict[str, float]
    both_directions: float | None
    several_days: float | None
    error_m: dict[str, float]


@dataclass(frozen=True, slots=True)
class Advice:
    """Neighbours ``first:end`` of one road, what a drive takes off their error, and why."""

    road_id: str
    first: int
    end: int
    start_m: float
    end_m: float
    gain_m: float
    expected_error_m: float | None
    reason: str


def gain_m(ground: Ground) -> Float[np.ndarray, " stretches"]:
    """What one more drive takes off the expected loss of each stretch; 0 where nothing is known."""
    passes = np.maximum(ground.passes, 0)
    error_m = np.where(np.isfinite(ground.expected_error_m), ground.expected_error_m, 0.0)
    right, row = road_right(passes), np.minimum(pass_class(passes) + 1, len(ROAD_RIGHT) - 1)
    least, share = np.array(ROAD_RIGHT)[row].T
    drives = np.maximum(least - passes, 1.0)
    fewer_wrong = (share - right) * WRONG_M / drives
    better_curves = error_m * (
        1.0 - np.sqrt((passes + 2.0) * np.maximum(passes, 1)) / (passes + 1.0)
    )
    gain = fewer_wrong + np.where(passes > 0, np.maximum(better_curves, 0.0), 0.0)
    gain += np.where((passes > 0) & (ground.days <= 1), ONE_DAY_M, 0.0)
    gain += np.where(ground.one_way, ONE_WAY_M, 0.0)
    return np.asarray(np.where(ground.passes < 0, 0.0, gain))


def reason(passes: tuple[int, int], days: int, way: str | None) -> str:
    """
    Why a stretch is worth a drive.

    Args:
        passes: The fewest and the most over it; -1 when they are not known.
        days: The most over it.
        way: The only direction in which it was driven, None when both were.
    """
    fewest, most = passes
    if most < 0:
        return "built before coverage was kept: build again to have it"
    if most == 0:
        return "never driven: no window can be located here"
    words = [f"driven {_times(fewest, most)}"]
    if days <= 1 and most > 1:
        words.append("all on one day")
    if way is not None:
        words.append(f"only {way}")
    told = ", ".join(words)
    row = int(pass_class(np.array([fewest]))[0])
    if row >= ENOUGH:
        return told
    now, (least, then) = ROAD_RIGHT[row][1], ROAD_RIGHT[ENOUGH]
    return f"{told}; {now:.0%} of windows find the road with so few passes, {then:.0%} with {least}"


def advise(ground: Ground, most: int = 10) -> list[Advice]:
    """The stretches most worth a drive, neighbours of one kind joined; the best first."""
    starts = _starts(ground)
    if not len(starts):
        return []
    ends = np.append(starts[1:], len(ground.road_id))
    gain = gain_m(ground)
    worth = np.add.reduceat(gain * ground.length_m, starts)
    length_m = np.add.reduceat(ground.length_m, starts)
    enough = np.flatnonzero((worth >= LEAST_WORTH_M * length_m) & (worth > 0.0))
    best = enough[np.argsort(-worth[enough], kind="stable")[:most]]
    return [
        _joined(ground, gain, first, end)
        for first, end in zip(starts[best].tolist(), ends[best].tolist(), strict=True)
    ]


def summarise(ground: Ground) -> CoverageSummary:
    """Lengths by passes, shares, and the errors to expect."""
    length_m, passes = ground.length_m, ground.passes
    driven = passes > 0
    driven_m = float(length_m[driven].sum())
    known = np.isfinite(ground.expected_error_m)
    bounds = {"unknown": passes < 0, **{str(n): passes == n for n in range(3)}, "3+": passes >= 3}
    return CoverageSummary(
        length_m=float(length_m.sum()),
        by_passes_m={name: float(length_m[which].sum()) for name, which in bounds.items()},
        both_directions=_share(length_m, driven & ~ground.one_way, driven_m),
        several_days=_share(length_m, driven & (ground.days > 1), driven_m),
        error_m=_percentiles(ground.expected_error_m[known], length_m[known]),
    )


def _share(length_m: Floats, which: Bool[np.ndarray, " stretches"], of_m: float) -> float | None:
    return float(length_m[which].sum()) / of_m if of_m > 0.0 else None


def _percentiles(error_m: Floats, length_m: Floats) -> dict[str, float]:
    """Of the length, not of the stretches: a stretch's size is an accident of its signals."""
    if not len(error_m):
        return {}
    order = np.argsort(error_m)
    share = (np.cumsum(length_m[order]) - 0.5 * length_m[order]) / max(length_m.sum(), 1e-9)
    return {
        f"p{percent}": float(np.interp(percent / 100.0, share, error_m[order]))
        for percent in (10, 50, 90)
    }


def _times(fewest: int, most: int) -> str:
    if fewest == most <= 2:
        return ("never", "once", "twice")[most]
    return f"{most} times" if fewest == most else f"{fewest} to {most} times"


def _way(ground: Ground, at: int) -> str | None:
    forward, passes = int(ground.forward[at]), int(ground.passes[at])
    if passes <= 0 or 0 < forward < passes:
        return None
    return "forward" if forward else "backward"


def _starts(ground: Ground) -> Int[np.ndarray, " runs"]:
    """First of each run of neighbours that deserve the same words."""
    if not len(ground.road_id):
        return np.zeros(0, dtype=int)
    road = np.array(ground.road_id)
    one_way = np.where(ground.one_way, np.where(ground.forward > 0, 1, 2), 0)
    kinds = (pass_class(ground.passes), ground.days > 1, one_way)
    new = np.ones(len(road), dtype=bool)
    new[1:] = road[1:] != road[:-1]
    for kind in kinds:
        new[1:] |= kind[1:] != kind[:-1]
    return np.flatnonzero(new)


def _joined(ground: Ground, gain: Floats, first: int, end: int) -> Advice:
    part = slice(first, end)
    length_m = np.maximum(ground.length_m[part], 1e-9)
    error_m = ground.expected_error_m[part]
    known = bool(np.isfinite(error_m).all())
    passes = ground.passes[part]
    return Advice(
        road_id=ground.road_id[first],
        first=first,
        end=end,
        start_m=float(ground.start_m[first]),
        end_m=float(ground.end_m[end - 1]),
        gain_m=float(np.average(gain[part], weights=length_m)),
        expected_error_m=float(np.average(error_m, weights=length_m)) if known else None,
        reason=reason(
            (int(passes.min()), int(passes.max())),
            int(ground.days[part].max()),
            _way(ground, first),
        ),
    )
