"""
Chains: strokes joined end to end, the lines of the roads to be.

Straight on first: where several strokes meet, the straightest pair is one street. Then round
corners, but only where no third street meets: a corner that leaves no choice divides nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from app.numerics.geodesy import Floats
from app.numerics.network.links import END_STEPS, End, Link

LINK_M = 120.0  # ends farther apart are not one corner
APART_M = 20.0  # a third street this close to a corner makes it a crossing...
END_APART_M = 40.0  # ...and one that ends for its turn so near to it
LEAST_STEPS = 13  # 60 m: what is shorter is no road and makes no crossing
JOINT_M = 70.0  # two chains that join may be close to each other so near their joint
MEETS_M = 25.0  # elsewhere a road must not come back to itself: its chainages would be mistaken


class Chains:
    """Polylines that grow by joining; each end of a stroke is used once."""

    def __init__(self, lines: Sequence[Floats]) -> None:
        self._lines = dict(enumerate(lines))
        self._ends = {i: (End(i, last=False), End(i, last=True)) for i in self._lines}
        self._chain = {end: i for i, ends in self._ends.items() for end in ends}

    @property
    def lines(self) -> list[Floats]:
        """All chains, each a polyline in local metres."""
        return list(self._lines.values())

    def join_straight(self, link: Link) -> None:
        """Join two chains that go on from one to the other."""
        self._join(link, corner=False)

    def join_corner(self, link: Link) -> None:
        """Join two chains at a corner, unless a third comes there too."""
        self._join(link, corner=True)

    def _join(self, link: Link, *, corner: bool) -> None:
        one, other = self._chain.get(link.one), self._chain.get(link.other)
        if one is None or other is None or one == other:
            return
        first, second = self._towards(one, link.one), self._towards(other, link.other)[::-1]
        if np.hypot(*(second[0] - first[-1])) > LINK_M or _meet(first, second):
            return
        if corner and self._is_crossing(first, link.way_m, second, {one, other}):
            return
        if corner:
            first = _until(first, [*link.way_m, second[0]][0])
            second = _until(second[::-1], [first[-1], *link.way_m][-1])[::-1]
        else:
            second = second[(second - first[-1]) @ _heading(first) > 0.0]
        free = [self._other_end(one, link.one), self._other_end(other, link.other)]
        for gone in (link.one, link.other):
            del self._chain[gone]
        del self._lines[other], self._ends[other]
        self._lines[one] = np.concatenate([first, link.way_m, second])
        self._ends[one] = (free[0], free[1])
        self._chain[free[1]] = one

    def _towards(self, chain: int, end: End) -> Floats:
        """The chain's line, so turned that it leads to this end."""
        line = self._lines[chain]
        return line if self._ends[chain][1] == end else line[::-1]

    def _other_end(self, chain: int, end: End) -> End:
        first, last = self._ends[chain]
        return first if last == end else last

    def _is_crossing(self, first: Floats, way_m: Floats, second: Floats, own: set[int]) -> bool:
        corner = cKDTree(np.concatenate([first[-1:], way_m, second[:1]]))
        for number, line in self._lines.items():
            if number in own or len(line) < LEAST_STEPS:
                continue
            if np.min(corner.query(line)[0]) < APART_M:
                return True
            if np.min(corner.query(line[[0, -1]])[0]) < END_APART_M:
                return True
        return False


def _meet(first: Floats, second: Floats) -> bool:
    """Whether two chains that would be joined come close to each other far from their joint."""
    joint = (first[-1] + second[0]) / 2.0
    far = [line[np.hypot(*(line - joint).T) > JOINT_M] for line in (first, second)]
    if min(len(line) for line in far) == 0:
        return False
    return bool(np.min(cKDTree(far[0]).query(far[1])[0]) < MEETS_M)


def _until(line: Floats, place: Floats) -> Floats:
    """The line without what of its end lies beyond the step nearest to where drives left it."""
    tail = line[-END_STEPS - 1 :]
    beyond = len(tail) - 1 - int(np.argmin(np.hypot(*(tail - place).T)))
    return line[: len(line) - beyond]


def _heading(line: Floats) -> Floats:
    away = line[-1] - line[max(-5, -len(line))]
    return away / max(float(np.hypot(*away)), 1e-9)
