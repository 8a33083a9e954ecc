"""
Newcomers: cells that came on the air when a road had been surveyed, or went before it was.

A cell's silence on a road is evidence for the days on which the cell was on the air. A road whose
passes listened to its carrier on none of the days on which it was heard, anywhere on the map, says
nothing of it. Which cells these are depends on the days of all roads (`app.numerics.days`), so it
is worked out when a map is laid out, and no model remembers it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from app.numerics.carriers import NEWCOMER_HEARD, carrier_of, columns_of, stand_in
from app.numerics.days import Days
from app.numerics.observation import TERMS, Profile


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """
    Which of a profile's cells says what of a cell, its stand-ins included.

    Attributes:
        cell: Number of every cell in the profile, and of the stand-in of each carrier.
        count: All of them, with the stand-ins for newcomers, which have no name.
        number: Number of every cell of the map; empty where nothing is a newcomer.
        newcomer: Of each cell of the map the stand-in for it, -1 = it needs none.
    """

    cell: dict[str, int]
    count: int
    number: dict[str, int]
    newcomer: Int[np.ndarray, " map_cells"]

    def __len__(self) -> int:
        return self.count

    @classmethod
    def plain(cls, cells: Sequence[str], others: Sequence[str] = ()) -> Columns:
        """Of a profile that stands alone: nothing is a newcomer there; see `columns_of`."""
        cell = columns_of(cells, others)
        return cls(cell, len(cell), {}, np.zeros(0, dtype=np.int32))

    def numbers(self, cells: Sequence[str]) -> list[int]:
        """Each cell's column, that of what stands in for it where it has none; -1 = nothing."""
        found = [self.cell.get(cell, -1) for cell in cells]
        if -1 not in found:
            return found
        return self.filled(found, cells, [stand_in(carrier_of(cell)) for cell in cells])

    def filled(
        self, found: Sequence[int], cells: Sequence[str], stand_ins: Sequence[str]
    ) -> list[int]:
        """
        Columns of cells with those that are -1 filled in.

        Args:
            stand_ins: Name of what stands for each cell where a profile lacks it.
        """
        every = zip(found, cells, stand_ins, strict=True)
        return [at if at >= 0 else self._elsewhere(cell, other) for at, cell, other in every]

    def _elsewhere(self, cell: str, other: str) -> int:
        number = self.number.get(cell, -1)
        if number >= 0 and (at := int(self.newcomer[number])) >= 0:
            return at
        return self.cell.get(other, -1)


@dataclass(frozen=True, slots=True, eq=False)
class Laid:
    """
    What of a profile of some roads says nothing.

    Attributes:
        columns: Of the profile once it is `muted`.
        known: Of the profile's cells that are newcomers to some of the roads: the number, and to
            which roads.
        groups: Of the stand-ins for newcomers, in order: the number of the stand-in whose silence
            they share, and the roads to which their cells are newcomers.
    """

    columns: Columns
    known: list[tuple[int, Bool[np.ndarray, " roads"]]]
    groups: list[tuple[int, Bool[np.ndarray, " roads"]]]

    def muted(self, along: Profile, road: Int[np.ndarray, " columns"]) -> Profile:
        """
        The profile with newcomers saying nothing.

        Args:
            road: Which of the roads each column is of; -1 = none.
        """
        rows, bend = along.rows, along.bend
        logit = np.float32(np.log(NEWCOMER_HEARD) - np.log1p(-NEWCOMER_HEARD))
        for number, of_roads in self.known:
            rows[TERMS * number + 3, (road >= 0) & of_roads[road]] = logit
        if not self.groups:
            return along
        more = []
        for number, of_roads in self.groups:
            block = rows[TERMS * number : TERMS * (number + 1)].copy()
            block[3, (road >= 0) & of_roads[road]] = logit
            more.append(block)
        silent = np.zeros((len(more), along.columns), dtype=np.float32)
        rows = np.concatenate((rows[:-1], *more, rows[-1:]))
        return Profile(rows, np.concatenate((bend, silent)))


@dataclass(frozen=True, slots=True, eq=False)
class Newcomers:
    """
    Which cells of a map are newcomers to which of its roads.

    Attributes:
        number: Number of every cell of the map.
        to: Shape ``(cells, roads)``.
    """

    number: dict[str, int]
    to: Bool[np.ndarray, "cells roads"]

    @classmethod
    def of(cls, days: Days) -> Newcomers:
        """From the days of all roads."""
        to = np.zeros((len(days.number), len(days.listened)), dtype=bool)
        carriers = np.array([carrier_of(cell) for cell in days.number])
        for road, listened in enumerate(days.listened):
            for carrier, on in listened.items():
                alike = np.flatnonzero(carriers == carrier)
                to[alike, road] = on.any() & ~days.on_air[alike][:, on].any(axis=1)
        return cls(days.number, to)

    def cells_to(self, road: int) -> frozenset[str]:
        """Those that are newcomers to one road."""
        names = list(self.number)
        return frozenset(names[at] for at in np.flatnonzero(self.to[:, road]).tolist())

    def among(self, roads: Sequence[int], cells: Sequence[str], others: Sequence[str]) -> Laid:
        """
        What of the roads' common profile says nothing.

        Args:
            cells: Of the profile.
            others: Carriers of other roads.
        """
        plain = Columns.plain(cells, others)
        to = self.to[:, list(roads)]
        if not to.any():
            return Laid(plain, [], [])
        here = {self.number[cell] for cell in cells}
        known = [(plain.cell[cell], to[self.number[cell]]) for cell in cells]
        groups: dict[tuple[str, bytes], int] = {}
        newcomer = np.full(len(to), -1, dtype=np.int32)
        names = list(self.number)
        for number in np.flatnonzero(to.any(axis=1)).tolist():
            if number not in here:
                key = (carrier_of(names[number]), to[number].tobytes())
                newcomer[number] = plain.count + groups.setdefault(key, len(groups))
        columns = Columns(plain.cell, plain.count + len(groups), self.number, newcomer)
        return Laid(
            columns,
            [pair for pair in known if pair[1].any()],
            [(plain.cell[stand_in(f)], np.frombuffer(key, dtype=bool)) for f, key in groups],
        )
