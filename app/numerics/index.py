"""
A map version in memory: plain arrays, built once, read by every query.

Each road has its fine profile, one column a metre of curve. Neighbouring roads also share a *tape*:
their salient cells' profiles at coarse steps, laid end to end with gaps, so that one matrix product
scores every sub-segment of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from app.domain import Calibration, RadioMap, RoadModel
from app.numerics import native
from app.numerics.geodesy import Floats, LocalFrame
from app.numerics.graph import RoadGraph
from app.numerics.lines import headings_deg, point_at, z_order
from app.numerics.observation import OffsetPrior, Profile, profile

COARSE_STEPS_M = (4.0, 8.0, 16.0)  # each serves windows up to GAP times as long
GAP = 26  # empty columns between roads on a tape: a window may reach that far off a road's end
BOTH = (1, -1)  # directions of travel: towards growing chainage, and against
TAPE_COLUMNS = 1600  # beyond, a tape's matrix product costs more than starting another


@dataclass(frozen=True, slots=True, eq=False)
class RoadIndex:
    """One road, ready for alignment; column ``i + 1`` of its profile is grid position ``i``."""

    road_id: str
    number: int
    length_m: float
    step_m: float
    column: dict[str, int]
    along: Profile
    edges_m: Floats

    @property
    def grid_size(self) -> int:
        """Number of grid positions: all columns of the profile but one outside at either end."""
        return self.along.columns - 2


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """
    Geometry of all grid positions, road after road; ``start[road]`` is a road's first.

    Attributes:
        plane: Five rows: x and y in the map's local frame, metres; longitude and latitude; compass
            heading of growing chainage, degrees.
        segment: Index of the sub-segment on its road; a boundary belongs to the later one.
    """

    start: Int[np.ndarray, " roads"]
    size: Int[np.ndarray, " roads"]
    step_m: Floats
    plane: Float[np.ndarray, "5 grid"]
    segment: Int[np.ndarray, " grid"]

    def spot(self, road: np.ndarray, chainage_m: np.ndarray) -> Spot:
        """Grid positions below chainages, and the share of the way to the next."""
        at = chainage_m / self.step_m[road]
        low = np.minimum(at.astype(np.intp), self.size[road] - 2)
        return Spot(self.start[road] + low, at - low)


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """Places between grid positions of an `Atlas`."""

    low: np.ndarray
    share: np.ndarray

    def of(self, plane: Floats) -> Floats:
        """Rows of an atlas' plane at the places, straight between grid positions."""
        left = plane[..., self.low]
        return np.asarray(left + self.share * (plane[..., self.low + 1] - left))


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
        column: Row of each salient cell.
        known: Every cell that any of the roads has heard.
        levels: The same stretch at each of `COARSE_STEPS_M`.
    """

    roads: tuple[int, ...]
    column: dict[str, int]
    known: frozenset[str]
    levels: tuple[CoarseProfile, ...]


class MapIndex:
    """A whole map version, immutable after `build`."""

    def __init__(self, radio_map: RadioMap, roads: Sequence[RoadIndex], frame: LocalFrame) -> None:
        self.version = radio_map.version
        self.calibration = radio_map.calibration
        self.offset_prior = OffsetPrior.learnt(radio_map.calibration.offset_sd_db)
        self.likelihood = native.likelihood(self.offset_prior)
        self.roads = tuple(roads)
        self.road_ids = tuple(road.road_id for road in roads)
        self.cells = frozenset().union(*(road.column for road in roads)) if roads else frozenset()
        self.atlas = _draw_atlas(radio_map.models, frame)
        self.lines = tuple(model.line for model in radio_map.models)
        self.graph = RoadGraph.of(self.lines)
        self.tapes = tuple(
            _lay_tape([radio_map.models[i] for i in group], group)
            for group in _groups(radio_map.models)
        )

    def recalibrated(self, calibration: Calibration) -> MapIndex:
        """The same roads under another calibration; arrays are shared."""
        other = copy(self)
        other.calibration = calibration
        other.offset_prior = OffsetPrior.learnt(calibration.offset_sd_db)
        other.likelihood = native.likelihood(other.offset_prior)
        return other

    @classmethod
    def build(cls, radio_map: RadioMap) -> MapIndex:
        """Lay out a map version for matching; numpy only, some 10 ms a road."""
        lines = [model.line for model in radio_map.models]
        frame = LocalFrame(
            float(np.mean([line.lon[0] for line in lines])) if lines else 0.0,
            float(np.mean([line.lat[0] for line in lines])) if lines else 0.0,
        )
        roads = [_road(i, model) for i, model in enumerate(radio_map.models)]
        return cls(radio_map, roads, frame)


def _road(number: int, model: RoadModel) -> RoadIndex:
    return RoadIndex(
        road_id=model.road_id,
        number=number,
        length_m=model.length_m,
        step_m=model.step_m,
        column={cell: index for index, cell in enumerate(model.cells)},
        along=road_profile(model.mean_dbm, model.spread_db, model.heard),
        edges_m=np.array([s.start_m for s in model.segments] + [model.length_m]),
    )


def road_profile(
    mean_dbm: Float[np.ndarray, "grid cells"],
    spread_db: Float[np.ndarray, "grid cells"],
    heard: Float[np.ndarray, "grid cells"],
) -> Profile:
    """Profile of a road's grid with one column outside the road at either end."""
    ends = ((1, 1), (0, 0))
    mean, spread, hearing = (
        np.pad(values, ends, constant_values=np.nan) for values in (mean_dbm, spread_db, heard)
    )
    outside = np.zeros(len(mean), dtype=bool)
    outside[[0, -1]] = True
    return profile(mean, spread, hearing, outside)


def _draw_atlas(models: Sequence[RoadModel], frame: LocalFrame) -> Atlas:
    sizes = np.array([len(model.mean_dbm) for model in models], dtype=np.intp)
    columns: list[list[Floats]] = []
    for model in models:
        grid_m = np.arange(len(model.mean_dbm)) * model.step_m
        where = point_at(model.line, grid_m)
        plane = frame.to_xy(where.lon, where.lat)
        inner_m = np.array([segment.start_m for segment in model.segments[1:]])
        segment = np.searchsorted(inner_m, grid_m, side="right").astype(float)
        heading = headings_deg(model.line, grid_m)
        columns.append([plane.x_m, plane.y_m, where.lon, where.lat, heading, segment])
    drawn = [np.concatenate([c[i] for c in columns]) if columns else np.zeros(0) for i in range(6)]
    return Atlas(
        start=(np.cumsum(sizes) - sizes),
        size=sizes,
        step_m=np.array([model.step_m for model in models]),
        plane=np.stack(drawn[:5]),
        segment=drawn[5].astype(np.intp),
    )


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


def _lay_tape(models: Sequence[RoadModel], numbers: tuple[int, ...]) -> Tape:
    cells = sorted({cell for model in models for cell in salient_cells(model)})
    column = {cell: row for row, cell in enumerate(cells)}
    levels = tuple(_lay_level(models, numbers, column, step) for step in COARSE_STEPS_M)
    known = frozenset().union(*(model.cells for model in models))
    return Tape(numbers, column, known, levels)


def _lay_level(
    models: Sequence[RoadModel], numbers: tuple[int, ...], column: dict[str, int], step_m: float
) -> CoarseProfile:
    parts = [_coarse_road(model, column, step_m) for model in models]
    gap = np.full((GAP, len(column)), np.nan)
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
        along=profile(mean, spread, heard, outside),
        positions=positions.astype(np.intp),
        road=np.tile(np.repeat(np.array(numbers), sizes), 2),
        sign=np.repeat(np.array(BOTH), len(positions)),
        chainage_m=np.tile(np.concatenate([np.arange(n) * step_m for n in sizes]), 2),
    )


def _coarse_road(
    model: RoadModel, column: dict[str, int], step_m: float
) -> tuple[Floats, Floats, Floats]:
    """Mean, spread and hearing of the tape's cells over stretches centred ``step_m`` apart."""
    factor = round(step_m / model.step_m)
    size = int(np.ceil((len(model.mean_dbm) + factor // 2) / factor))
    before, after = factor // 2, size * factor - factor // 2 - len(model.mean_dbm)
    own = [index for index, cell in enumerate(model.cells) if cell in column]
    rows = [column[model.cells[index]] for index in own]

    def blocks(values: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
        padded = np.pad(values[:, own], ((before, after), (0, 0)), constant_values=np.nan)
        return padded.reshape(size, factor, len(own))

    mean, spread = blocks(model.mean_dbm), blocks(model.spread_db)
    known = ~np.isnan(mean)
    count = np.maximum(known.sum(axis=1), 1)
    level = np.where(known, mean, 0.0).sum(axis=1) / count
    within = np.where(known, (mean - level[:, None]) ** 2 + spread**2, 0.0).sum(axis=1) / count
    level[~known.any(axis=1)] = np.nan
    hearing = np.nan_to_num(blocks(model.heard)).sum(axis=1)
    hearing /= np.maximum((~np.isnan(blocks(model.heard))).sum(axis=1), 1)
    out = [np.full((size, len(column)), fill) for fill in (np.nan, 1.0, 0.0)]
    for target, values in zip(out, (level, np.sqrt(within), hearing), strict=True):
        target[:, rows] = values
    return out[0], out[1], out[2]
