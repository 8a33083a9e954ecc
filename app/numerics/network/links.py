"""Links: ends of strokes between which drives go on, straight or round a corner."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.numerics.geodesy import Floats
from app.numerics.network.runs import Run
from app.numerics.network.steps import Piece
from app.numerics.network.strokes import Followed, Strokes

END_STEPS = 8  # 40 m: a stroke that was cut for a turn ends so far from the crossing
END_HEADING_STEPS = 4
TAKEN_SHARE = 0.5  # of the drives at an end that must go round the corner
STRAIGHT_COS = float(np.cos(np.radians(35.0)))


@dataclass(frozen=True, slots=True, order=True)
class End:
    """One end of a stroke: its last step, or its first."""

    stroke: int
    last: bool


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """Two ends that drives went between; ``way_m`` leads from ``one`` to ``other``."""

    one: End
    other: End
    way_m: Float[np.ndarray, "steps 2"]


def straight_links(strokes: Strokes, followed: Sequence[Followed]) -> list[Link]:
    """Links within runs, the straightest first."""
    bends: dict[tuple[End, End], float] = {}
    for under in followed:
        known = np.flatnonzero(under.stroke >= 0)
        change = np.flatnonzero(np.diff(under.stroke[known]) != 0)
        for a, b in zip(known[change].tolist(), known[change + 1].tolist(), strict=True):
            one, other = _end(strokes, under, a), _end(strokes, under, b)
            if one is not None and other is not None and one.stroke != other.stroke:
                pair = (min(one, other), max(one, other))
                bends[pair] = float(-outward(strokes, pair[0]) @ outward(strokes, pair[1]))
    order = sorted(bends, key=lambda pair: (-round(bends[pair], 2), pair))
    return [Link(*pair, np.zeros((0, 2))) for pair in order if bends[pair] >= STRAIGHT_COS]


def corner_links(
    strokes: Strokes,
    pieces: Sequence[Piece],
    runs: Sequence[Run],
    followed: Sequence[Followed],
) -> list[Link]:
    """
    Links between one run and the next, those that most drives took first.

    Only where most of the drives that come to either end take it: elsewhere the road ends.
    """
    ways: dict[tuple[End, End], list[Floats]] = defaultdict(list)
    took: dict[tuple[End, End], set[int]] = defaultdict(set)
    for drive, link in _turns(strokes, pieces, runs, followed):
        if link.one == link.other:
            continue
        pair = (min(link.one, link.other), max(link.one, link.other))
        ways[pair].append(link.way_m if link.one == pair[0] else link.way_m[::-1])
        took[pair].add(drive)
    came = _drives_at_ends(strokes, runs, followed)
    order = sorted(ways, key=lambda pair: (-len(took[pair]), pair))
    return [
        Link(*pair, _typical(ways[pair]))
        for pair in order
        if len(took[pair]) >= TAKEN_SHARE * max(len(came[end]) for end in pair)
    ]


def outward(strokes: Strokes, end: End) -> Floats:
    """Unit vector out of a stroke's end."""
    line = strokes.lines[end.stroke]
    line = line if end.last else line[::-1]
    away = line[-1] - line[max(-END_HEADING_STEPS - 1, -len(line))]
    return away / max(float(np.hypot(*away)), 1e-9)


def _turns(
    strokes: Strokes,
    pieces: Sequence[Piece],
    runs: Sequence[Run],
    followed: Sequence[Followed],
) -> Iterator[tuple[int, Link]]:
    """What each drive did at the end of a run."""
    leaves, piece, left_at = None, -1, 0
    for run, under in zip(runs, followed, strict=True):
        known = np.flatnonzero(under.stroke >= 0)
        if len(known) == 0:
            continue
        arrives = _end(strokes, under, int(known[0]))
        if piece == run.piece and leaves is not None and arrives is not None:
            way_m = pieces[piece].xy_m[left_at + 1 : run.first + int(known[0])]
            yield run.drive, Link(leaves, arrives, way_m)
        leaves, piece = _end(strokes, under, int(known[-1])), run.piece
        left_at = run.first + int(known[-1])


def _drives_at_ends(
    strokes: Strokes, runs: Sequence[Run], followed: Sequence[Followed]
) -> dict[End, set[int]]:
    drives: dict[End, set[int]] = defaultdict(set)
    for run, under in zip(runs, followed, strict=True):
        for at in np.flatnonzero(under.stroke >= 0).tolist():
            end = _end(strokes, under, at)
            if end is not None:
                drives[end].add(run.drive)
    return drives


def _end(strokes: Strokes, under: Followed, at: int) -> End | None:
    """The end of its stroke that a step of a run is at, if it is at one."""
    stroke, step = int(under.stroke[at]), int(under.step[at])
    left = len(strokes.lines[stroke]) - 1 - step
    if min(step, left) > END_STEPS:
        return None
    return End(stroke, last=left < step)


def _typical(ways: list[Floats]) -> Floats:
    """The way of median length."""
    return sorted(ways, key=lambda way: (len(way), way.tolist()))[len(ways) // 2]
