"""
Where roads meet, found from their lines alone.

Two roads are *linked* where they come within `REACH_M` of each other: a crossing, a junction, ends
that touch. A map has no topology of its own: its roads were found or drawn one by one, and lines
that meet on the ground pass each other by some metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from app.domain import Line
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import vertex_chainage_m
from app.numerics.neighbourhoods import neighbourhoods

REACH_M = 20.0  # lines that meet on the ground pass each other by less: lane, receiver, drawing
PIECE_M = 60.0  # lines are compared in pieces this short: few pairs are near without meeting
APART_M = 60.0  # meetings of the same two roads closer than this are one: the nearest


@dataclass(frozen=True, slots=True)
class Link:
    """A way off a road: at ``at_m`` of it one may go on at ``there_m`` of another."""

    at_m: float
    road: int
    there_m: float


@dataclass(frozen=True, slots=True, eq=False)
class RoadGraph:
    """All links of a map; ``links[road]`` in the order of their chainage."""

    links: tuple[tuple[Link, ...], ...]

    @classmethod
    def of(cls, lines: Sequence[Line]) -> RoadGraph:
        """
        The graph of roads with these lines.

        One plane and spatial grid a neighbourhood: 1,000 roads of a city take some 50 ms.
        """
        found: list[list[Link]] = [[] for _ in lines]
        for group in neighbourhoods(lines):
            pieces = _cut(lines, group)
            first, second = _near_pairs(pieces)
            for one, other, one_m, other_m in _meetings(pieces, first, second):
                found[one].append(Link(one_m, other, other_m))
                found[other].append(Link(other_m, one, one_m))
        order = [sorted(links, key=lambda link: (link.at_m, link.road)) for links in found]
        return cls(tuple(tuple(links) for links in order))


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """Straight pieces of all lines: start and way in metres of the plane, chainage of the start."""

    road: Int[np.ndarray, " pieces"]
    start_m: Float[np.ndarray, "pieces 2"]
    way_m: Float[np.ndarray, "pieces 2"]
    at_m: Float[np.ndarray, " pieces"]
    length_m: Float[np.ndarray, " pieces"]


def _cut(lines: Sequence[Line], group: Sequence[int]) -> _Pieces:
    """The lines of these numbers, in a plane of their own."""
    first = lines[group[0]]
    frame = LocalFrame(float(first.lon[0]), float(first.lat[0]))
    columns: list[list[np.ndarray]] = [[] for _ in range(5)]
    for number in group:
        line = lines[number]
        plane, at_m = frame.to_xy(line.lon, line.lat), vertex_chainage_m(line)
        count = np.maximum(np.ceil(np.diff(at_m) / PIECE_M), 1).astype(int)
        piece = np.repeat(np.arange(len(count)), count)
        share = (np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)) / count[piece]
        vertices = np.stack([plane.x_m, plane.y_m], axis=1)
        way_m = np.diff(vertices, axis=0)[piece]
        columns[0].append(np.full(len(piece), number))
        columns[1].append(vertices[:-1][piece] + share[:, None] * way_m)
        columns[2].append(way_m / count[piece][:, None])
        columns[3].append(at_m[:-1][piece] + share * np.diff(at_m)[piece])
        columns[4].append(np.diff(at_m)[piece] / count[piece])
    return _Pieces(*(np.concatenate(column) for column in columns))


def _near_pairs(pieces: _Pieces) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Pieces of different roads whose middles are near enough to meet; each pair once."""
    side_m = PIECE_M + REACH_M
    box = np.floor((pieces.start_m + 0.5 * pieces.way_m) / side_m).astype(np.int64)
    box -= box.min(axis=0) - 1
    width = int(box[:, 1].max()) + 2
    key = box[:, 0] * width + box[:, 1]
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    firsts, seconds = [], []
    for step in (0, 1, width - 1, width, width + 1):
        low = np.searchsorted(ranked, key + step, side="left")
        count = np.searchsorted(ranked, key + step, side="right") - low
        first = np.repeat(np.arange(len(key)), count)
        offset = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
        second = order[np.repeat(low, count) + offset]
        wanted = pieces.road[first] != pieces.road[second]
        if step == 0:
            wanted &= pieces.road[first] < pieces.road[second]
        firsts.append(first[wanted])
        seconds.append(second[wanted])
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    swap = pieces.road[first] > pieces.road[second]
    return np.where(swap, second, first), np.where(swap, first, second)


def _meetings(
    pieces: _Pieces, first: Int[np.ndarray, " pairs"], second: Int[np.ndarray, " pairs"]
) -> list[tuple[int, int, float, float]]:
    """Numbers of the two roads and the chainage on each, one entry a meeting."""
    away_m, share, other_share = _closest(pieces, first, second)
    near = (away_m <= REACH_M).nonzero()[0]
    if not len(near):
        return []
    one, other = pieces.road[first[near]], pieces.road[second[near]]
    one_m = pieces.at_m[first[near]] + share[near] * pieces.length_m[first[near]]
    other_m = pieces.at_m[second[near]] + other_share[near] * pieces.length_m[second[near]]
    order = np.lexsort((one_m, other, one))
    one, other, one_m, other_m = one[order], other[order], one_m[order], other_m[order]
    away_m = away_m[near][order]
    new = (np.diff(one) != 0) | (np.diff(other) != 0) | (np.diff(one_m) > APART_M)
    starts = np.concatenate(([0], new.nonzero()[0] + 1, [len(order)]))
    best = [low + int(np.argmin(away_m[low:high])) for low, high in pairwise(starts.tolist())]
    return [(int(one[i]), int(other[i]), float(one_m[i]), float(other_m[i])) for i in best]


def _closest(
    pieces: _Pieces, first: Int[np.ndarray, " pairs"], second: Int[np.ndarray, " pairs"]
) -> tuple[Float[np.ndarray, " pairs"], Float[np.ndarray, " pairs"], Float[np.ndarray, " pairs"]]:
    """Distance of each pair of pieces, and the shares of either's way where they are nearest."""
    start, way = pieces.start_m[first], pieces.way_m[first]
    other_start, other_way = pieces.start_m[second], pieces.way_m[second]
    apart = other_start - start
    turn = _cross(way, other_way)
    parallel = np.abs(turn) < 1e-9 * (1.0 + (way**2).sum(axis=1))
    safe = np.where(parallel, 1.0, turn)
    meets_at, other_meets_at = _cross(apart, other_way) / safe, _cross(apart, way) / safe
    crosses = ~parallel & (np.abs(meets_at - 0.5) <= 0.5) & (np.abs(other_meets_at - 0.5) <= 0.5)
    tries = [(np.where(crosses, meets_at, 0.0), np.where(crosses, other_meets_at, 0.0), crosses)]
    everywhere = np.ones(len(first), dtype=bool)
    for end in (0.0, 1.0):
        fixed = np.full(len(first), end)
        onto_other = _share(start + end * way - other_start, other_way)
        onto_one = _share(other_start + end * other_way - start, way)
        tries += [(fixed, onto_other, everywhere), (onto_one, fixed, everywhere)]
    gaps = []
    for share, other_share, valid in tries:
        gap = start + share[:, None] * way - other_start - other_share[:, None] * other_way
        gaps.append(np.where(valid, np.hypot(gap[:, 0], gap[:, 1]), np.inf))
    best = np.argmin(gaps, axis=0)
    row = np.arange(len(first))
    shares = np.stack([one[0] for one in tries]), np.stack([one[1] for one in tries])
    return np.min(gaps, axis=0), shares[0][best, row], shares[1][best, row]


def _cross(a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _share(
    point: Float[np.ndarray, "n 2"], way: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, " n"]:
    squared = np.maximum((way**2).sum(axis=1), 1e-12)
    return np.clip((point * way).sum(axis=1) / squared, 0.0, 1.0)
