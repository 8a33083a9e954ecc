"""
Tapes: the coarse scale of a map.

Neighbouring roads share a *tape*: their cells' profiles at coarse steps, laid end to end with gaps,
so that one pass over it scores every sub-segment of all of them. The salient cells say which tapes
a window has any business with; all cells then tell its roads apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from app.domain import RoadModel
from app.numerics.carriers import (
    NOTHING_KNOWN,
    carrier_of,
    columns_of,
    numbers,
    unmapped_chance,
)
from app.numerics.geodesy import Floats
from app.numerics.lines import z_order
from app.numerics.observation import HEARD_FLOOR, Profile, profile

COARSE_STEPS_M = (4.0, 8.0, 16.0)  # each serves windows up to GAP times as long
GAP = 26  # empty columns between roads on a tape: a window may reach that far off a road's end
TAPE_COLUMNS = 1600  # beyond, a tape's matrix product costs more than starting another
BOTH = (1, -1)  # directions of travel: towards growing chainage, and against


@dataclass(frozen=True, slots=True, eq=False)
class CoarseProfile:
    """
    A tape at one step.

    Attributes:
        along: Profile of the tape's cells over all its columns, gaps included.
        positions: The columns that are road. Shape ``(positions,)``.
        road, sign, chainage_m: What each score is of: all positions in one direction of travel,
            then all in the other. Shape ``(2 positions,)``.
    """

    step_m: float
    along: Profile
    positions: Int[np.ndarray, " positions"]
    road: Int[np.ndarray, " places"]
    sign: Int[np.ndarray, " places"]
    chainage_m: Float[np.ndarray, " places"]


@dataclass(frozen=True, slots=True, eq=False)
class Tape:
    """
    Neighbouring roads that are scored together.

    Attributes:
        roads: Numbers of the roads, in the order of their columns.
        column: Row of each cell that any of the roads has heard.
        salient: The cells that tell any of the roads, or of their sub-segments, from the others.
        levels: The same stretch at each of `COARSE_STEPS_M`.
    """

    roads: tuple[int, ...]
    column: dict[str, int]
    salient: frozenset[str]
    levels: tuple[CoarseProfile, ...]


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


def lay_tapes(models: Sequence[RoadModel], others: tuple[str, ...]) -> tuple[Tape, ...]:
    """
    All roads on tapes, neighbours together.

    Args:
        others: All carriers of the map.
    """
    return tuple(_lay_tape([models[i] for i in group], group, others) for group in _groups(models))


def _lay_tape(models: Sequence[RoadModel], group: tuple[int, ...], others: tuple[str, ...]) -> Tape:
    cells = sorted({cell for model in models for cell in model.cells})
    levels = tuple(_lay_level(models, group, (cells, others), step) for step in COARSE_STEPS_M)
    salient = frozenset(cell for model in models for cell in salient_cells(model))
    return Tape(group, columns_of(cells, others), salient, levels)


def _lay_level(
    models: Sequence[RoadModel],
    group: tuple[int, ...],
    names: tuple[Sequence[str], Sequence[str]],
    step_m: float,
) -> CoarseProfile:
    cells, others = names
    parts = [_coarse_road(model, cells, step_m) for model in models]
    gap = np.full((GAP, len(cells)), np.nan)
    mean, spread, heard = (
        np.concatenate([gap, *(block for part in parts for block in (part[i], gap))])
        for i in range(3)
    )
    sizes = [len(part[0]) for part in parts]
    starts = GAP + np.concatenate([[0], np.cumsum(np.array(sizes[:-1], dtype=int) + GAP)])
    positions = np.concatenate(
        [start + np.arange(n) for start, n in zip(starts, sizes, strict=True)]
    )
    outside = np.ones(len(mean), dtype=bool)
    outside[positions] = False
    return CoarseProfile(
        step_m=step_m,
        along=profile(cells, mean, spread, heard, outside, others),
        positions=positions.astype(np.intp),
        road=np.tile(np.repeat(np.array(group), sizes), 2),
        sign=np.repeat(np.array(BOTH), len(positions)),
        chainage_m=np.tile(np.concatenate([np.arange(n) * step_m for n in sizes]), 2),
    )


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
