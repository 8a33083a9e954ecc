"""
Strokes: streets as the longest stretches that runs cover, each driven stretch once.

Runs are taken longest first; what of a run no stroke covers yet becomes a stroke. Because runs go
straight over crossings, strokes do too (the natural streets of Jiang, Zhao and Yin 2008).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from app.numerics.geodesy import Floats
from app.numerics.network.contraction import PARALLEL_COS
from app.numerics.network.runs import Run, headings, stretches

COVERED_M = 15.0  # a contracted run this close to a stroke drives along it
NEIGHBOURS = 12  # steps of strokes looked at: some may cross
FEWEST_NEW_STEPS = 8  # 40 m: less is the edge of a street, or a lane change
SURE_STEPS = 20  # 100 m: a shorter stroke of a single drive is a car park, or the receiver's error
FOLLOWED_SHARE = 0.5  # of a short stroke's steps


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """
    Which stroke lies under each step of a run.

    Attributes:
        stroke: Its number, -1 where there is none. Shape ``(steps,)``.
        step: Number of the nearest step of that stroke.
    """

    stroke: Int[np.ndarray, " steps"]
    step: Int[np.ndarray, " steps"]


class Strokes:
    """Polylines in steps of some 5 m, and which of them lies where."""

    def __init__(self) -> None:
        self.lines: list[Floats] = []
        self._tree: cKDTree | None = None
        self._heading = np.zeros((0, 2))
        self._stroke = np.zeros(0, dtype=np.intp)
        self._step = np.zeros(0, dtype=np.intp)

    def add(self, xy_m: Float[np.ndarray, "steps 2"]) -> None:
        """One more stroke."""
        self.lines.append(xy_m)
        self._heading = np.concatenate([self._heading, headings(xy_m)])
        self._stroke = np.append(self._stroke, np.full(len(xy_m), len(self.lines) - 1))
        self._step = np.append(self._step, np.arange(len(xy_m)))
        self._tree = cKDTree(np.concatenate(self.lines))

    def under(self, xy_m: Float[np.ndarray, "steps 2"]) -> Followed:
        """The nearest stroke that is parallel to each step of a run."""
        nothing = np.full(len(xy_m), -1)
        if self._tree is None:
            return Followed(nothing, nothing)
        away_m, near = self._tree.query(xy_m, k=NEIGHBOURS, distance_upper_bound=COVERED_M)
        found = np.isfinite(away_m)
        near = np.where(found, near, 0)
        parallel = np.abs((self._heading[near] * headings(xy_m)[:, None]).sum(axis=2))
        fits = found & (parallel > PARALLEL_COS)
        best = np.argmax(fits, axis=1)  # neighbours come nearest first
        row = np.arange(len(xy_m))
        there = fits[row, best]
        index = near[row, best]
        return Followed(
            np.where(there, self._stroke[index], -1), np.where(there, self._step[index], -1)
        )


def cover(
    runs: Sequence[Run],
    contracted: Sequence[Floats],
    seeds: Sequence[Floats] = (),
    before: Sequence[Floats] = (),
) -> Strokes:
    """
    Strokes that cover the contracted runs, without short ones that a single drive made.

    The seeds are strokes already, whoever drove them; what was a road ``before`` is no car park.

    The order of the runs moves nothing: the longest comes first, of equals the one that begins
    farthest west.
    """
    strokes = Strokes()
    for seed in seeds:
        strokes.add(seed)
    order = sorted(range(len(runs)), key=lambda i: (-len(runs[i].xy_m), *_ends(contracted[i])))
    for number in order:
        run = contracted[number]
        for part in stretches(strokes.under(run).stroke < 0):
            if part.stop - part.start >= min(FEWEST_NEW_STEPS, len(run)):
                strokes.add(run[max(part.start - 1, 0) : part.stop + 1])
    sure = _sure(strokes, runs, contracted)
    sure |= set(range(len(seeds)))
    sure |= {i for i, line in enumerate(strokes.lines) if lies_on(line, before)}
    kept = Strokes()
    for number in sorted(sure):
        kept.add(strokes.lines[number])
    return kept


def lies_on(line: Floats, lines: Sequence[Floats]) -> bool:
    """Whether a line lies on others for most of its steps."""
    if not lines:
        return False
    others = shapely.MultiLineString([other.tolist() for other in lines])
    near = np.asarray(shapely.distance(others, shapely.points(line)) <= COVERED_M)
    return float(near.mean()) > FOLLOWED_SHARE


def _ends(line: Floats) -> tuple[float, ...]:
    return (*line[0].tolist(), *line[-1].tolist())


def _sure(strokes: Strokes, runs: Sequence[Run], contracted: Sequence[Floats]) -> set[int]:
    """The strokes that are long, or that several drives followed for half their length."""
    seen: dict[tuple[int, int], set[int]] = defaultdict(set)
    for run, line in zip(runs, contracted, strict=True):
        under = strokes.under(line)
        for number, step in zip(under.stroke.tolist(), under.step.tolist(), strict=True):
            seen[number, run.drive].add(step)
    drives = Counter(
        number
        for (number, _), steps in seen.items()
        if number >= 0 and len(steps) >= FOLLOWED_SHARE * len(strokes.lines[number])
    )
    return {
        number
        for number, line in enumerate(strokes.lines)
        if len(line) > SURE_STEPS or drives[number] > 1
    }
