"""
Spurs: short dead ends that few of the drives on a much driven road go into.

A car starts in a drive way and ends in a car park; on a road that dozens of drives share, what one
or two of them did at its end is no street.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from app.numerics.geodesy import Floats
from app.numerics.network.runs import Run
from app.numerics.network.strokes import Strokes, lies_on

FEW = 0.15  # of the drives on the road that a spur belongs to
LONGEST_STEPS = 40  # 200 m: a longer way is a street, however few took it
MOST = 2.0 / 3.0  # of a road's drives come to where it ends...
MANY = 10.0  # ...if so many drives came at all
LONGEST_END_STEPS = 25  # 125 m
UNMOVED_M = 1.0
TOUCH_M = 45.0  # strokes end so far from the crossing that they were cut for

Counts = NDArray[np.int64]  # drives by each step of a chain


def without_spurs(
    chains: Sequence[Floats],
    runs: Sequence[Run],
    contracted: Sequence[Floats],
    seeds: Sequence[Floats] = (),
    before: Sequence[Floats] = (),
) -> list[Floats]:
    """
    The chains, their ends cut back to where more than a few drives go, without short spurs.

    What comes from seeds stays, because the drives that made it are not at hand, and so does what
    was a road ``before``.
    """
    lookup = Strokes()
    for line in chains:
        lookup.add(line)
    driven = _drives(lookup, runs, contracted)
    known = [on_seeds(line, seeds) for line in chains]
    for there, counts in zip(known, driven, strict=True):
        counts[there] = max(int(counts.max()), 1)
    everything = range(len(chains))
    kept = [
        i
        for i in everything
        if known[i].any()
        or lies_on(chains[i], before)
        or not _is_spur(_touched(i, everything, lookup), i, driven)
    ]
    trimmed = []
    for number in kept:
        open_ends = [not touched for touched in _touched(number, kept, lookup)]
        trimmed.append(lookup.lines[number][_part(driven[number], open_ends)])
    return trimmed


def on_seeds(
    line: Float[np.ndarray, "steps 2"], seeds: Sequence[Floats]
) -> Bool[np.ndarray, " steps"]:
    """Which steps of a line were a seed's."""
    if not seeds:
        return np.zeros(len(line), dtype=bool)
    lines = shapely.MultiLineString([seed.tolist() for seed in seeds])
    return np.asarray(shapely.distance(lines, shapely.points(line)) < UNMOVED_M)


def _drives(lookup: Strokes, runs: Sequence[Run], contracted: Sequence[Floats]) -> list[Counts]:
    """Number of drives that come by each step of each chain."""
    seen: set[tuple[int, int, int]] = set()
    for run, line in zip(runs, contracted, strict=True):
        under = lookup.under(line)
        seen.update(
            (chain, step, run.drive)
            for chain, step in zip(under.stroke.tolist(), under.step.tolist(), strict=True)
        )
    driven = [np.zeros(len(line), dtype=np.int64) for line in lookup.lines]
    for chain, step, _ in seen:
        if chain >= 0:
            driven[chain][step] += 1
    return driven


def _part(driven: Counts, open_ends: Sequence[bool]) -> slice:
    """The steps between dead ends to which few of the road's drives come."""
    many = float(np.quantile(driven, 0.9))
    if many < MANY:
        return slice(None)
    often = np.flatnonzero(driven >= MOST * many)
    first, beyond = int(often[0]), len(driven) - 1 - int(often[-1])
    return slice(
        first if open_ends[0] and first <= LONGEST_END_STEPS else 0,
        len(driven) - (beyond if open_ends[1] and beyond <= LONGEST_END_STEPS else 0),
    )


def _is_spur(touched: Sequence[Sequence[int]], number: int, driven: Sequence[Counts]) -> bool:
    if len(driven[number]) > LONGEST_STEPS or all(touched):
        return False
    own = float(np.quantile(driven[number], 0.9))
    drives = [float(np.quantile(driven[other], 0.9)) for ends in touched for other in ends]
    return any(own < FEW * there for there in drives)


def _touched(number: int, among: Iterable[int], lookup: Strokes) -> list[list[int]]:
    """The chains that come to the first and to the last step of a chain."""
    line = lookup.lines[number]
    others = [(i, lookup.lines[i]) for i in among if i != number]
    return [
        [i for i, other in others if np.hypot(*(other - end).T).min() <= TOUCH_M]
        for end in (line[0], line[-1])
    ]
