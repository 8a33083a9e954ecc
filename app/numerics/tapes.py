"""
Tapes: the coarse scale of a map.

Neighbouring roads share a *tape*: their cells' profiles at coarse steps, laid end to end with gaps,
so that one pass over it scores every sub-segment of all of them. All cells tell its roads apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int
from numpy.typing import NDArray

from app.domain import RoadModel
from app.numerics.blocks import BLOCK, in_blocks
from app.numerics.carriers import (
    NOTHING_KNOWN,
    carrier_of,
    numbers,
    unmapped_chance,
)
from app.numerics.geodesy import Floats
from app.numerics.lines import z_order
from app.numerics.newcomers import Columns, Laid, Newcomers
from app.numerics.observation import HEARD_FLOOR, profile

COARSE_STEPS_M = (4.0, 8.0, 16.0)  # each serves windows up to GAP times as long
GAP = 26  # empty columns between roads on a tape: a window may reach that far off a road's end
TAPE_COLUMNS = 1600  # beyond, a tape's matrix product costs more than starting another
NUMBERS = 1 << 32  # more than the columns of any tape
BOTH = (1, -1)  # directions of travel: towards growing chainage, and against


@dataclass(frozen=True, slots=True, eq=False)
class CoarsePlaces:
    """
    What the scores of tapes at one step are of: of each tape all its positions in one direction of
    travel, then all in the other.

    Attributes:
        number: Increasing; neighbours on a road, and no others, are numbered one by one, and those
            of tape ``i`` from ``i NUMBERS`` on.
    """

    road: Int[np.ndarray, " places"]
    sign: Int[np.ndarray, " places"]
    chainage_m: Float[np.ndarray, " places"]
    number: Int[np.ndarray, " places"]

    def __len__(self) -> int:
        return len(self.road)

    def take(self, rows: np.ndarray) -> CoarsePlaces:
        """Those at these indices."""
        columns = (self.road, self.sign, self.chainage_m, self.number)
        return CoarsePlaces(*[one.take(rows) for one in columns])

    @classmethod
    def join(cls, parts: Sequence[CoarsePlaces]) -> CoarsePlaces:
        """All of several tapes, in order."""
        columns = zip(
            *[(one.road, one.sign, one.chainage_m, one.number) for one in parts], strict=True
        )
        return cls(*[np.concatenate(column) for column in columns])


@dataclass(frozen=True, slots=True, eq=False)
class CoarseProfile:
    """
    A tape at one step.

    Attributes:
        blocks: ``A``, ``B``, ``D`` and ``S`` of the tape's cells over all its columns, gaps
            included, `BLOCK` columns at a time: what one window needs of a cell lies together.
            ``D = HEARING_WEIGHT L - C / 2`` for all that counts once for each hearing, the others
            as in `app.numerics.observation`. Shape ``(cells, blocks, 4, BLOCK)``.
        outside: 1 where there is no road. Shape ``(columns,)``.
        positions: The columns that are road. Shape ``(positions,)``.
        places: What each score is of: all positions both ways. Shape ``(2 positions,)``.
        runs: Which of these is the first of each sub-segment and direction. Shape ``(runs,)``.
    """

    step_m: float
    blocks: Float32[np.ndarray, "cells blocks 4 16"]
    outside: Float32[np.ndarray, " columns"]
    positions: Int[np.ndarray, " positions"]
    places: CoarsePlaces
    runs: Int[np.ndarray, " runs"]

    @property
    def columns(self) -> int:
        """Number of columns, gaps included."""
        return len(self.outside)

    def rows(self, cells: Int[np.ndarray, " chosen"]) -> Float32[np.ndarray, "rows columns"]:
        """Of some cells the four rows each, then "outside"."""
        chosen = self.blocks[cells].swapaxes(1, 2).reshape(-1, self.columns)
        return np.concatenate((chosen, self.outside[None]))


@dataclass(frozen=True, slots=True, eq=False)
class Tape:
    """
    Neighbouring roads that are scored together.

    Attributes:
        roads: Numbers of the roads, in the order of their columns.
        column: Rows of the cells that any road has ``heard``, and of what stands in for others.
        salient: Those that tell any of the roads, or of their sub-segments, from the others.
    """

    roads: tuple[int, ...]
    column: Columns
    heard: frozenset[str]
    salient: frozenset[str]
    levels: tuple[CoarseProfile, ...]  # the same stretch at each of `COARSE_STEPS_M`


def _groups(models: Sequence[RoadModel]) -> list[tuple[int, ...]]:
    """Neighbours together, each group short enough for one product; along a Z-order curve."""
    order = sorted(range(len(models)), key=lambda i: z_order(models[i].line))
    groups: list[tuple[int, ...]] = []
    current: list[int] = []
    columns = 0.0
    for i in order:
        wanted = models[i].length_m / COARSE_STEPS_M[0] + GAP
        if current and columns + wanted > TAPE_COLUMNS:
            groups.append(tuple(current))
            current, columns = [], 0.0
        current.append(i)
        columns += wanted
    return [*groups, tuple(current)] if current else groups


def salient_cells(model: RoadModel) -> list[str]:
    """Cells of which the road, or any of its sub-segments, has a salient feature."""
    chosen = np.asarray(model.salience.mask.any(axis=0))
    for segment in model.segments:
        chosen = chosen | segment.salience.mask.any(axis=0)
    return [cell for cell, salient in zip(model.cells, chosen.tolist(), strict=True) if salient]


def lay_tapes(
    models: Sequence[RoadModel], others: tuple[str, ...], newcomers: Newcomers
) -> tuple[Tape, ...]:
    """
    All roads on tapes, neighbours together.

    Args:
        others: All carriers of the map.
    """
    return tuple(
        _lay_tape([models[i] for i in group], group, others, newcomers, number * NUMBERS)
        for number, group in enumerate(_groups(models))
    )


def places_of(tapes: Sequence[Tape]) -> tuple[CoarsePlaces, ...]:
    """What the scores of all tapes are of, at each of `COARSE_STEPS_M`."""
    return tuple(
        CoarsePlaces.join([tape.levels[size].places for tape in tapes])
        for size in range(len(COARSE_STEPS_M) if tapes else 0)
    )


def joined_runs(levels: Sequence[CoarseProfile]) -> Int[np.ndarray, " runs"]:
    """Where the runs of several tapes begin when their scores lie one after the other."""
    starts = accumulate((len(level.places) for level in levels), initial=0)
    return np.concatenate([one.runs + start for one, start in zip(levels, starts, strict=False)])


def _lay_tape(
    models: Sequence[RoadModel],
    group: tuple[int, ...],
    others: tuple[str, ...],
    newcomers: Newcomers,
    first: int,
) -> Tape:
    cells = sorted({cell for model in models for cell in model.cells})
    laid = newcomers.among(group, cells, others)
    levels = tuple(
        _lay_level(models, group, (cells, others), laid, step, first) for step in COARSE_STEPS_M
    )
    salient = frozenset(cell for model in models for cell in salient_cells(model))
    return Tape(group, laid.columns, frozenset(cells), salient, levels)


def _lay_level(
    models: Sequence[RoadModel],
    group: tuple[int, ...],
    names: tuple[Sequence[str], Sequence[str]],
    laid: Laid,
    step_m: float,
    number: int,
) -> CoarseProfile:
    cells, others = names
    parts = [_coarse_road(model, cells, step_m) for model in models]
    sizes = [len(part[0]) for part in parts]
    gap = np.full((GAP, len(cells)), np.nan)
    rest = np.full((-(GAP + sum(sizes) + GAP * len(sizes)) % BLOCK, len(cells)), np.nan)
    mean, spread, heard = (
        np.concatenate([gap, *(block for part in parts for block in (part[i], gap)), rest])
        for i in range(3)
    )
    starts = GAP + np.concatenate([[0], np.cumsum(np.array(sizes[:-1], dtype=int) + GAP)])
    positions = np.concatenate(
        [start + np.arange(n) for start, n in zip(starts, sizes, strict=True)]
    )
    road = np.full(len(mean), -1)
    road[positions] = np.repeat(np.arange(len(sizes)), sizes)
    positions = positions.astype(np.intp)
    along = laid.muted(profile(cells, mean, spread, heard, road < 0, others), road)
    blocks, at = in_blocks(along)
    chainages_m: list[Floats] = [step_m * np.arange(n, dtype=np.float64) for n in sizes]
    first = _first_of_runs(models, chainages_m)
    return CoarseProfile(
        step_m=step_m,
        blocks=blocks,
        outside=at,
        positions=positions,
        places=CoarsePlaces(
            road=np.tile(np.repeat(np.array(group), sizes), 2),
            sign=np.repeat(np.array(BOTH), len(positions)),
            chainage_m=np.tile(np.concatenate(chainages_m), 2),
            number=np.concatenate((positions, positions + len(mean))) + number,
        ),
        runs=np.concatenate((first, first + len(positions))),
    )


def _first_of_runs(models: Sequence[RoadModel], chainages_m: Sequence[Floats]) -> np.ndarray:
    """Which positions of the roads, one after the other, are the first of their sub-segment."""
    firsts, before = [], 0
    for model, chainage_m in zip(models, chainages_m, strict=True):
        starts_m = np.array([segment.start_m for segment in model.segments[1:]])
        segment = starts_m.searchsorted(chainage_m, side="right")
        firsts.append(before + np.concatenate(([0], np.flatnonzero(np.diff(segment)) + 1)))
        before += len(chainage_m)
    return np.concatenate(firsts)


def _coarse_road(
    model: RoadModel, cells: Sequence[str], step_m: float
) -> tuple[Floats, Floats, Floats]:
    """Mean, spread and hearing of the tape's cells over stretches centred ``step_m`` apart."""
    factor = round(step_m / model.step_m)
    size = int(np.ceil((len(model.mean_dbm) + factor // 2) / factor))
    before, after = factor // 2, size * factor - factor // 2 - len(model.mean_dbm)

    def blocks(values: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
        padded = np.pad(values, ((before, after), (0, 0)), constant_values=np.nan)
        return padded.reshape(size, factor, values.shape[1])

    mean, spread, heard = blocks(model.mean_dbm), blocks(model.spread_db), blocks(model.heard)
    known, inside = ~np.isnan(mean), ~np.isnan(heard)
    count = np.maximum(known.sum(axis=1), 1)
    level = np.where(known, mean, 0.0).sum(axis=1) / count
    within = np.where(known, (mean - level[:, None]) ** 2 + spread**2, 0.0).sum(axis=1) / count
    mapped = known.any(axis=1)
    level[~mapped] = np.nan
    carrier = numbers(model.cells)
    strange = blocks(unmapped_chance(model.heard, model.mean_dbm, carrier, HEARD_FLOOR))
    strange = np.nan_to_num(strange).sum(axis=1) / inside.any(axis=2).sum(axis=1)[:, None]
    hearing = np.where(known, heard, 0.0).sum(axis=1) / np.maximum(inside.sum(axis=1), 1)
    hearing = np.where(mapped, hearing, strange[:, carrier])
    return _on_tape(cells, model.cells, strange, (level, np.sqrt(within), hearing))


def _on_tape(
    cells: Sequence[str], own: Sequence[str], strange: Floats, found: tuple[Floats, Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """A road's columns among all of its tape's, the others as cells that are not mapped on it."""
    carrier = {carrier_of(cell): at for cell, at in zip(own, numbers(own).tolist(), strict=True)}
    wanted = [carrier.get(carrier_of(cell), -1) for cell in cells]
    unknown = np.append(strange, np.full((len(strange), 1), NOTHING_KNOWN), axis=1)
    out = (
        np.full((len(strange), len(cells)), np.nan),
        np.ones((len(strange), len(cells))),
        unknown[:, wanted],
    )
    place = {cell: at for at, cell in enumerate(cells)}
    for target, values in zip(out, found, strict=True):
        target[:, [place[cell] for cell in own]] = values
    return out
