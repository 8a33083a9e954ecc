"""
The score of one place, taken apart: what each sample and cell adds to it.

`app.numerics.alignment` adds everything up in one matrix product. Here the same sum is written out
term by term, plainly and slowly, for one place. With some device offset ``b``,

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

from app.numerics.carriers import carrier_of
from app.numerics.corners import TURN_SHARE
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.observation import (
    CENTRE_DBM,
    HEARING_WEIGHT,
    OUTSIDE_HEARD,
    TERMS,
    Evidence,
    offset_db,
    offset_gain_at,
)
from app.numerics.paths import Way, road_along
from app.numerics.query import Query


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
class _Laid:
    """Where a place lies on what its window was driven along: a road, or a way as a road."""

    road: RoadIndex
    sign: int
    chainage_m: float


def _laid(index: MapIndex, place: Place, length_m: float, cells: tuple[str, ...]) -> _Laid:
    """
    Args:
        length_m, cells: Of the window.
    """
    way = place.way
    if way is None:
        return _Laid(index.roads[place.road], place.sign, place.chainage_m)
    past_m = round(way.sign * (place.chainage_m - way.entered_m))
    before_m = max(math.ceil(length_m) + 1 - past_m, 1)
    road = road_along(index, way, (-before_m, past_m + 1), cells)
    return _Laid(road, 1, float(before_m + past_m))


@dataclass(frozen=True, slots=True, eq=False)
class Contributions:
    """
    A place's score in nats, before the temperature, taken apart.

    Attributes:
        level, hearing: Of each of the query's samples (newest first) and cells.
        silent: Of each cell that the road has and the window did not hear at all.
        offset: Of the device offset; the same for all cells.
        offset_db: The offset that was taken out of ``level``.
        residual, weight: For the offset, see `app.numerics.observation`.
        gain: What the offset added to the score of the matcher.
    """

    place: Place
    level: Float[np.ndarray, "samples cells"]
    hearing: Float[np.ndarray, "samples cells"]
    silent: dict[str, float]
    offset: float
    offset_db: float
    residual: float
    weight: float
    gain: float

    @property
    def score(self) -> float:
        """Log likelihood against the background: all of them together."""
        told = float(self.level.sum() + self.hearing.sum())
        return told + sum(self.silent.values()) + self.offset


def contributions(
    index: MapIndex, query: Query, place: Place, device_db: float | None = None
) -> Contributions:
    """
    Take the score of a window at a place apart.

    Between two grid positions the terms are straight but for the bend of the level, as
    `app.numerics.refinement` has it.

    Args:
        device_db: The device offset to take out of the levels; None = the one that fits the place.
    """
    laid = _laid(index, place, query.length_m, query.cells)
    road, at = laid.road, laid.chainage_m / laid.road.step_m
    low = min(int(at), road.grid_size - 2)
    share = min(at - low, 1.0)
    here, there = (_terms(road, query, low + step, laid.sign) for step in (0, 1))
    count = query.fine.heard * query.fine.weight[:, None]
    bend = here.bend * count * (share * (1.0 - share))
    level = here.level + share * (there.level - here.level) + bend
    residual = here.residual + share * (there.residual - here.residual)
    weight = here.weight + share * (there.weight - here.weight)
    gain = _gain(index, here, there, share)
    total_residual, total_weight = float(residual.sum()), float(weight.sum())
    if device_db is None:
        device_db = offset_db(total_residual, total_weight, index.offset_prior)
    return Contributions(
        place=place,
        level=level + device_db * residual - 0.5 * device_db**2 * weight,
        hearing=here.hearing + share * (there.hearing - here.hearing),
        silent={
            cell: one + share * (there.silent[cell] - one) for cell, one in here.silent.items()
        },
        offset=gain - device_db * total_residual + 0.5 * device_db**2 * total_weight,
        offset_db=device_db,
        residual=total_residual,
        weight=total_weight,
        gain=gain,
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
    seen = query.fine
    behind = np.rint(seen.behind_m / road.step_m).astype(np.intp)
    columns = np.clip(grid + 1 - sign * behind, 0, road.along.columns - 1)
    precision, aimed, square, logit, _ = cell_terms(road, query.cells, columns)
    count = seen.heard * seen.weight[:, None]
    return _Terms(
        level=-0.5 * count * (precision * seen.rsrp_db**2 - 2.0 * aimed * seen.rsrp_db + square),
        residual=count * (precision * seen.rsrp_db - aimed),
        weight=count * precision,
        hearing=_hearing(road, query, columns, precision > 0.0, logit),
        bend=_of_cells(road.along.bend, road, query.cells, columns, 1)[0],
        silent=_silent(road, query.cells, seen, columns),
    )


def _hearing(
    road: RoadIndex,
    query: Query,
    columns: Int[np.ndarray, " samples"],
    mapped: Bool[np.ndarray, "samples cells"],
    logit: Float[np.ndarray, "samples cells"],
) -> Float[np.ndarray, "samples cells"]:
    """Hearing the cells or not, cells that the road lacks and samples beyond its ends included."""
    seen = query.fine
    outside = road.along.rows[-1, columns].astype(float)[:, None]
    listened = seen.share @ _alike(query.cells, query.cells)
    each = seen.heard * (logit + np.log(OUTSIDE_HEARD) * outside)
    each += listened * np.where(mapped, -np.logaddexp(0.0, logit), 0.0)
    return np.asarray(HEARING_WEIGHT * each * seen.weight[:, None])


def _silent(
    road: RoadIndex, cells: tuple[str, ...], seen: Evidence, columns: Int[np.ndarray, " samples"]
) -> dict[str, float]:
    """Not hearing the road's other cells at all, of carriers that were heard."""
    names = tuple(sorted(set(road.cells) - set(cells)))
    precision, _, _, logit, _ = cell_terms(road, names, columns)
    each = np.where(precision > 0.0, -np.logaddexp(0.0, logit), 0.0)
    listened = seen.weight[:, None] * (seen.share @ _alike(cells, names))
    told = HEARING_WEIGHT * (listened * each).sum(axis=0)
    return dict(zip(names, told.tolist(), strict=True))


def _alike(cells: tuple[str, ...], others: tuple[str, ...]) -> Bool[np.ndarray, "cells others"]:
    """Whether they are of one carrier."""
    same = [[carrier_of(cell) == carrier_of(other) for other in others] for cell in cells]
    return np.array(same, dtype=bool).reshape(len(cells), len(others))


def _gain(index: MapIndex, here: _Terms, there: _Terms, share: float) -> float:
    """What integrating over the device offset adds, between grid positions as `between` has it."""
    prior = index.offset_prior
    ends = [(float(one.residual.sum()), float(one.weight.sum())) for one in (here, there)]
    first, last = (offset_gain_at(*one, prior) for one in ends)
    (from_residual, from_weight), (to_residual, _) = ends
    like_db2 = prior.like_db2
    taken = 0.5 * (to_residual - from_residual) ** 2 * like_db2 / (1.0 + from_weight * like_db2)
    return first + share * (last - first) - taken * share * (1.0 - share)


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


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """
    What the map expects of samples behind a place, one row a sample.

    Attributes:
        rsrp_dbm, spread_db: Level and its spread; NaN where the cell is not mapped.
        hearing: Probability of hearing the cell, 0 where it is not mapped, NaN beyond the road.
    """

    rsrp_dbm: Float[np.ndarray, "samples cells"]
    spread_db: Float[np.ndarray, "samples cells"]
    hearing: Float[np.ndarray, "samples cells"]


def expected(
    index: MapIndex,
    place: Place,
    cells: tuple[str, ...],
    behind_m: Float[np.ndarray, " samples"],
) -> Expected:
    """What the map expects of each sample, straight between the grid positions about it."""
    laid = _laid(index, place, float(behind_m.max(initial=0.0)), cells)
    road = laid.road
    at = (laid.chainage_m - laid.sign * behind_m) / road.step_m + 1.0
    at = np.clip(at, 0.0, road.along.columns - 1.0)
    low = np.minimum(at.astype(np.intp), road.along.columns - 2)
    near = _expected_at(road, cells, np.rint(at).astype(np.intp))
    left, right = (_expected_at(road, cells, low + step) for step in (0, 1))
    share = (at - low)[:, None]
    mixed = left + share * (right - left)
    return Expected(*np.where(np.isnan(mixed) | np.isnan(near), near, mixed))


def _expected_at(
    road: RoadIndex, cells: tuple[str, ...], columns: Int[np.ndarray, " samples"]
) -> Float[np.ndarray, "3 samples cells"]:
    precision, aimed, _, logit, _ = cell_terms(road, cells, columns)
    mapped = precision > 0.0
    safe = np.where(mapped, precision, 1.0)
    level = np.where(mapped, aimed / safe + CENTRE_DBM, np.nan)
    hearing = np.where(mapped, 1.0 / (1.0 + np.exp(-logit)), 0.0)
    outside = road.along.rows[-1, columns] > 0.0
    hearing[outside] = np.nan
    return np.stack([level, np.where(mapped, safe**-0.5, np.nan), hearing])
