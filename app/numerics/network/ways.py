"""
Ways of a drawn network to roads: joined where a street goes on, cut where a way turns off it.

Map makers cut a street wherever a tag changes, and sometimes draw a way round a corner. A road here
is what a driver calls one street: it goes straight over its crossings.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Line, Road
from app.numerics.geodesy import Floats, LocalFrame

STRAIGHT_COS = float(np.cos(np.radians(45.0)))
TURN_COS = float(np.cos(np.radians(60.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """
    A drawn way; ``nodes`` are shared with the ways that it meets.

    Attributes:
        way_id: A number that its maker keeps.
        nodes: Their ids, in order. ``lon`` and ``lat`` are theirs, degrees.
    """

    way_id: int
    name: str | None
    nodes: tuple[int, ...]
    lon: Float[np.ndarray, " nodes"]
    lat: Float[np.ndarray, " nodes"]


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A stretch of a way without a turn at a crossing; ``part`` counts within the way."""

    way: Way
    part: int
    first: int
    end: int

    @property
    def nodes(self) -> tuple[int, ...]:
        return self.way.nodes[self.first : self.end]

    def outward(self, *, last: bool) -> Floats:
        """Unit vector out of one end, over the first piece."""
        at = (self.end - 2, self.end - 1) if last else (self.first + 1, self.first)
        return _heading(self.way, *at)


def roads_of_ways(ways: Iterable[Way], prefix: str) -> list[Road]:
    """
    Roads of ways, by id.

    The id is that of the smallest way of a road: it outlives a new file, and ways that are added.
    """
    known = sorted({way.way_id: way for way in ways}.values(), key=lambda way: way.way_id)
    known = [way for way in known if len(way.nodes) > 1]
    uses = Counter(node for way in known for node in set(way.nodes))
    parts = [part for way in known for part in _parts(way, uses)]
    return sorted(
        (_road(parts, chain, prefix) for chain in _chains(parts)), key=lambda road: road.road_id
    )


def _parts(way: Way, uses: Counter[int]) -> Iterator[_Part]:
    first, number = 0, 0
    for at in range(1, len(way.nodes) - 1):
        if uses[way.nodes[at]] > 1:
            bend = float(_heading(way, at - 1, at) @ _heading(way, at, at + 1))
            if bend < TURN_COS:
                yield _Part(way, number, first, at + 1)
                first, number = at, number + 1
    yield _Part(way, number, first, len(way.nodes))


def _heading(way: Way, one: int, other: int) -> Floats:
    frame = LocalFrame(float(way.lon[one]), float(way.lat[one]))
    to = frame.to_xy(way.lon[other], way.lat[other])
    away = np.array([float(to.x_m), float(to.y_m)])
    return away / max(float(np.hypot(*away)), 1e-9)


def _chains(parts: Sequence[_Part]) -> list[list[tuple[int, bool]]]:
    """Numbers of the parts of each road in order, each with whether it is turned round."""
    mate = _mates(parts)
    chains, seen = [], set()
    starts = [(i, last) for i in range(len(parts)) for last in (False, True)]
    for start in sorted(starts, key=lambda end: end in mate):  # free ends first, then rings
        number, last = start
        if number in seen:
            continue
        chain = []
        while number not in seen:
            seen.add(number)
            chain.append((number, last))  # entered at its last node: turned round
            leaving = (number, not last)
            if leaving not in mate:
                break
            number, last = mate[leaving]
        chains.append(chain)
    return chains


def _mates(parts: Sequence[_Part]) -> dict[tuple[int, bool], tuple[int, bool]]:
    """Which end of a part goes on at which end of another: the straightest of one name."""
    at_node: dict[int, list[tuple[int, bool]]] = defaultdict(list)
    for number, part in enumerate(parts):
        if part.nodes[0] != part.nodes[-1]:
            at_node[part.nodes[0]].append((number, False))
            at_node[part.nodes[-1]].append((number, True))
    mate: dict[tuple[int, bool], tuple[int, bool]] = {}
    for ends in at_node.values():
        options = []
        for i, one in enumerate(ends):
            for other in ends[i + 1 :]:
                if one[0] == other[0] or parts[one[0]].way.name != parts[other[0]].way.name:
                    continue
                bend = -float(
                    parts[one[0]].outward(last=one[1]) @ parts[other[0]].outward(last=other[1])
                )
                if bend >= STRAIGHT_COS or len(ends) == 2:
                    options.append((-round(bend, 6), one, other))
        for _, one, other in sorted(options):
            if one not in mate and other not in mate:
                mate[one], mate[other] = other, one
    return mate


def _road(parts: Sequence[_Part], chain: Sequence[tuple[int, bool]], prefix: str) -> Road:
    lon: list[float] = []
    lat: list[float] = []
    for number, turned in chain:
        part = parts[number]
        order = slice(part.first, part.end)
        step = -1 if turned else 1
        skip = 1 if lon else 0  # the node where two parts meet stands once
        lon += part.way.lon[order][::step][skip:].tolist()
        lat += part.way.lat[order][::step][skip:].tolist()
    smallest = min((parts[number] for number, _ in chain), key=lambda p: (p.way.way_id, p.part))
    suffix = f".{smallest.part}" if smallest.part else ""
    names = [parts[number].way.name for number, _ in chain]
    road_id = f"{prefix}{smallest.way.way_id}{suffix}"
    return Road(road_id, next((name for name in names if name), None),
                Line(np.array(lon), np.array(lat)))  # fmt: skip
