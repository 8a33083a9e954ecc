"""
The score of one place, taken apart: what each sample and cell adds to it.

`app.numerics.alignment` adds everything up in one matrix product. Here the same sum is written out
term by term, plainly and slowly, for one place. With some offset ``b`` of each cell's carrier,

    score = sum over samples and cells of (level + hearing)  +  sum over silent cells  +  offset

where ``level`` is the log likelihood of the reading with ``b`` taken out, ``hearing`` that of
hearing the cell or not, and ``offset`` what is left of integrating over ``b``: what other offsets
than this one add, less the price of any. Nothing else is in the score; a test adds it up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from app.numerics import carriers
from app.numerics.carriers import carrier_of
from app.numerics.corners import TURN_SHARE
from app.numerics.geodesy import Floats
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.observation import HEARING_WEIGHT, OUTSIDE_HEARD, TERMS
from app.numerics.offsets import (
    OffsetPrior,
    Taken,
    group_offsets_db,
    offset_db,
    offset_gain_at,
    take_offsets,
)
from app.numerics.paths import Way, road_along
from app.numerics.query import Query, columns_behind


@dataclass(frozen=True, slots=True)
class Place:
    """
    Number of a road, +1 or -1 for the direction, and chainage of the window's last sample.

    Attributes:
        way: What the window was driven along, when that is not this road alone.
    """

    road: int
    sign: int
    chainage_m: float
    way: Way | None = None

    @property
    def log_prior(self) -> float:
        """What is known beforehand, against a place that a window comes to straight."""
        return 0.0 if self.way is None else math.log(TURN_SHARE)


@dataclass(frozen=True, slots=True, eq=False)
class LaidAt:
    """Where a place lies on what its window was driven along: a road, or a way as a road."""

    road: RoadIndex
    sign: int
    chainage_m: float


def laid_at(index: MapIndex, place: Place, length_m: float, cells: tuple[str, ...]) -> LaidAt:
    """
    Where a place lies on what a window was driven along.

    Args:
        length_m, cells: Of the window.
    """
    way = place.way
    if way is None:
        return LaidAt(index.roads[place.road], place.sign, place.chainage_m)
    past_m = round(way.sign * (place.chainage_m - way.entered_m))
    before_m = max(math.ceil(length_m) + 1 - past_m, 1)
    road = road_along(index, way, (-before_m, past_m + 1), cells)
    return LaidAt(road, 1, float(before_m + past_m))


@dataclass(frozen=True, slots=True, eq=False)
class Contributions:
    """
    A place's score in nats, before the temperature, taken apart.

    Attributes:
        level, hearing: Of each of the query's samples (newest first) and cells.
        silent: Of each cell that the road has and the window did not hear at all.
        offset: Of the offsets of the device and of groups of cells.
        offset_db: The offsets of device and group that were taken out of ``level``. Shape
            ``(cells,)``; ``device_db`` is the device's that fits the place.
        residual, weight: For the device's offset, see `app.numerics.offsets`.
        gain: What the device's offset added to the score of the matcher.
    """

    place: Place
    level: Float[np.ndarray, "samples cells"]
    hearing: Float[np.ndarray, "samples cells"]
    silent: dict[str, float]
    offset: float
    offset_db: Floats
    device_db: float
    residual: float
    weight: float
    gain: float

    @property
    def score(self) -> float:
        """Log likelihood against the background: all of them together."""
        told = float(self.level.sum() + self.hearing.sum())
        return told + sum(self.silent.values()) + self.offset


def contributions(
    index: MapIndex, query: Query, place: Place, offsets_db: Floats | None = None
) -> Contributions:
    """
    Take the score of a window at a place apart.

    Between two grid positions the terms are straight but for the bend of the level, as
    `app.numerics.refinement` has it.

    Args:
        offsets_db: Of all cells, to take out of the levels; None = those that fit the place.
    """
    laid = laid_at(index, place, query.length_m, query.cells)
    road, at = laid.road, laid.chainage_m / laid.road.step_m
    low = min(int(at), road.grid_size - 2)
    share = min(at - low, 1.0)
    here, there = (_terms(road, query, low + step, laid.sign) for step in (0, 1))
    count = query.fine.heard * query.fine.weight[:, None]
    bend = here.bend * count * (share * (1.0 - share))
    level = here.level + share * (there.level - here.level) + bend
    residual = here.residual + share * (there.residual - here.residual)
    weight = here.weight + share * (there.weight - here.weight)
    prior = query.prior(index)
    taken = _between(_taken(query, here, prior), _taken(query, there, prior), share, prior)
    total_residual, total_weight = float(taken.residual[0]), float(taken.weight[0])
    device_db = offset_db(total_residual, total_weight, prior)
    if offsets_db is None:
        sums = _sums(query, residual, weight)[:, 0]
        offsets_db = group_offsets_db(sums, device_db, float(taken.apart[0]), prior)[query.group]
    moved = offsets_db * residual - 0.5 * offsets_db**2 * weight
    return Contributions(
        place=place,
        level=level + moved,
        hearing=here.hearing + share * (there.hearing - here.hearing),
        silent={
            cell: one + share * (there.silent[cell] - one) for cell, one in here.silent.items()
        },
        offset=float(taken.gain[0] - moved.sum()),
        offset_db=offsets_db,
        device_db=device_db,
        residual=total_residual,
        weight=total_weight,
        gain=offset_gain_at(total_residual, total_weight, prior),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Terms:
    """The terms of one grid position; every array has shape ``(samples, cells)``."""

    level: Float[np.ndarray, "samples cells"]
    residual: Float[np.ndarray, "samples cells"]
    weight: Float[np.ndarray, "samples cells"]
    hearing: Float[np.ndarray, "samples cells"]
    bend: Float[np.ndarray, "samples cells"]
    silent: dict[str, float]


def _terms(road: RoadIndex, query: Query, grid: int, sign: int) -> _Terms:
    """Of samples between two columns, a share of either one's; levels bend as at the nearest."""
    behind, share = columns_behind(query.fine.behind_m, road.step_m)
    nearest, _ = columns_behind(query.fine.behind_m, road.step_m, nearest=True)
    last, weight = road.along.columns - 1, query.fine.weight
    at, before, bent = (
        np.clip(grid + 1 - sign * one, 0, last) for one in (behind, behind + 1, nearest)
    )
    near = _terms_at(road, query, at, weight * (1.0 - share))
    far = _terms_at(road, query, before, weight * share)
    return _Terms(
        level=near.level + far.level,
        residual=near.residual + far.residual,
        weight=near.weight + far.weight,
        hearing=near.hearing + far.hearing,
        bend=_of_cells(road.along.bend, road, query.cells, bent, 1)[0],
        silent={cell: one + far.silent[cell] for cell, one in near.silent.items()},
    )


def _terms_at(
    road: RoadIndex, query: Query, columns: Int[np.ndarray, " samples"], weight: Floats
) -> _Terms:
    """The terms of samples that lie at columns and weigh so much; without their bend."""
    seen = query.fine
    precision, aimed, square, logit, _ = cell_terms(road, query.cells, columns)
    count = seen.heard * weight[:, None]
    return _Terms(
        level=-0.5 * count * (precision * seen.rsrp_db**2 - 2.0 * aimed * seen.rsrp_db + square),
        residual=count * (precision * seen.rsrp_db - aimed),
        weight=count * precision,
        hearing=_hearing(road, query, columns, precision > 0.0, logit) * weight[:, None],
        bend=np.zeros_like(count),
        silent=_silent(road, query, columns, weight),
    )


def _hearing(
    road: RoadIndex,
    query: Query,
    columns: Int[np.ndarray, " samples"],
    mapped: Bool[np.ndarray, "samples cells"],
    logit: Float[np.ndarray, "samples cells"],
) -> Float[np.ndarray, "samples cells"]:
    """
    Hearing the cells or not, cells that the road lacks and samples beyond its ends included; of
    samples that weigh 1.
    """
    seen = query.fine
    outside = road.along.rows[-1, columns].astype(float)[:, None]
    listened = seen.share @ _alike(query.cells, query.cells)
    each = seen.heard * (logit + np.log(OUTSIDE_HEARD) * outside)
    each += listened * np.where(mapped, -np.logaddexp(0.0, logit), 0.0)
    return np.asarray(HEARING_WEIGHT * each)


def _silent(
    road: RoadIndex, query: Query, columns: Int[np.ndarray, " samples"], weight: Floats
) -> dict[str, float]:
    """Not hearing the road's other cells at all, of carriers that were heard."""
    names = tuple(sorted(set(road.cells) - set(query.cells)))
    precision, _, _, logit, _ = cell_terms(road, names, columns)
    each = np.where(precision > 0.0, -np.logaddexp(0.0, logit), 0.0)
    listened = weight[:, None] * (query.fine.share @ _alike(query.cells, names))
    told = HEARING_WEIGHT * (listened * each).sum(axis=0)
    return dict(zip(names, told.tolist(), strict=True))


def _alike(cells: tuple[str, ...], others: tuple[str, ...]) -> Bool[np.ndarray, "cells others"]:
    """Whether they are of one carrier."""
    same = [[carrier_of(cell) == carrier_of(other) for other in others] for cell in cells]
    return np.array(same, dtype=bool).reshape(len(cells), len(others))


def _sums(query: Query, residual: Floats, weight: Floats) -> Float[np.ndarray, "sums 1"]:
    """Residual and weight of the first group, of the second, and so on."""
    sums = np.zeros((2 * carriers.count(query.group), 1))
    np.add.at(sums[::2, 0], query.group, residual.sum(axis=0))
    np.add.at(sums[1::2, 0], query.group, weight.sum(axis=0))
    return sums


def _taken(query: Query, terms: _Terms, prior: OffsetPrior) -> Taken:
    return take_offsets(_sums(query, terms.residual, terms.weight), prior)


def _between(here: Taken, there: Taken, share: float, prior: OffsetPrior) -> Taken:
    """What offsets take between grid positions, as `app.numerics.refinement.between` has it."""
    like_db2 = prior.like_db2 / prior.temperature
    gain, residual, weight, apart = (
        one + share * (other - one) for one, other in zip(here, there, strict=True)
    )
    bend = 0.5 * (there.residual - here.residual) ** 2 * like_db2 / (1.0 + here.weight * like_db2)
    return Taken(gain - bend * share * (1.0 - share), residual, weight, apart)


def cell_terms(
    road: RoadIndex, cells: tuple[str, ...], columns: Int[np.ndarray, " samples"]
) -> Float[np.ndarray, "5 samples cells"]:
    """A, B, C, L and S at columns of a road's profile; of a stand-in where it lacks the cell."""
    return _of_cells(road.along.rows, road, cells, columns, TERMS)


def _of_cells(
    rows: Float[np.ndarray, "rows columns"],
    road: RoadIndex,
    cells: tuple[str, ...],
    columns: Int[np.ndarray, " samples"],
    terms: int,
) -> Float[np.ndarray, "terms samples cells"]:
    out = np.zeros((terms, len(columns), len(cells)))
    for at, row in enumerate(road.column.numbers(cells)):
        if row >= 0:
            out[:, :, at] = rows[row * terms : (row + 1) * terms, columns]
    return out
