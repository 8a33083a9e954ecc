"""
A map version in memory: plain arrays, built once, read by every query.

Each road has its fine profile, one column a metre of curve; `app.numerics.tapes` has the coarse
scale of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from app.domain import Calibration, RadioMap, RoadModel
from app.numerics.acquaintance import Acquaintance
from app.numerics.carriers import carrier_of, carriers_of, groups
from app.numerics.days import Days
from app.numerics.geodesy import XY, Floats, LonLat
from app.numerics.graph import RoadGraph
from app.numerics.lines import headings_deg, point_at
from app.numerics.listing import usual_numbers
from app.numerics.neighbourhoods import Plane, planes
from app.numerics.newcomers import Columns, Newcomers
from app.numerics.observation import Profile, profile
from app.numerics.offsets import OffsetPrior
from app.numerics.salient import Salient
from app.numerics.surroundings import Surroundings
from app.numerics.tapes import lay_tapes, places_of
from app.numerics.turns import Grounds, find_turns


@dataclass(frozen=True, slots=True, eq=False)
class RoadIndex:
    """
    One road, ready for alignment; column ``i + 1`` of its profile is grid position ``i``.

    Attributes:
        column: Numbers of cells, and of what stands in for those that the road lacks.
    """

    road_id: str
    number: int
    length_m: float
    step_m: float
    cells: tuple[str, ...]
    column: Columns
    along: Profile
    edges_m: Floats
    salient: Salient

    @property
    def grid_size(self) -> int:
        """Number of grid positions: all columns of the profile but one outside at either end."""
        return self.along.columns - 2

    def segment_at(self, chainage_m: float) -> int:
        """Index of the sub-segment that holds a place; a boundary belongs to the later one."""
        return int(self.edges_m[1:-1].searchsorted(chainage_m, side="right"))


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """
    Geometry of all grid positions, road after road; ``start[road]`` is a road's first.

    Attributes:
        plane: Five rows: x and y in metres, true within a neighbourhood
            (`app.numerics.neighbourhoods`); longitude and latitude; compass heading of growing
            chainage, degrees. Longitudes of a road across the antimeridian run on beyond 180.
        wraps: Whether any of them does.
        segment: Index of the sub-segment on its road; a boundary belongs to the later one.
        edge_m: Chainages of all boundaries of sub-segments and of both ends, road after road;
            ``first_edge[road]`` is a road's first, and the last of all where they end.
    """

    start: Int[np.ndarray, " roads"]
    size: Int[np.ndarray, " roads"]
    step_m: Floats
    plane: Float[np.ndarray, "5 grid"]
    segment: Int[np.ndarray, " grid"]
    edge_m: Floats
    first_edge: Int[np.ndarray, " roads+1"]
    wraps: bool

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
class Told:
    """
    The models of a map once each has heard what the others know.

    Attributes:
        models: Of days on which cells were gone (`app.numerics.days`), then of what is heard about
            them (`app.numerics.surroundings`).
    """

    models: tuple[RoadModel, ...]
    newcomers: Newcomers
    around: Surroundings


def told_of_others(models: Sequence[RoadModel]) -> Told:
    """What a map makes of its roads' models before it lays them out."""
    days = Days.of(models)
    alone = [days.tempered(road, one) for road, one in enumerate(models)]
    newcomers = Newcomers.of(days)
    where_m = [np.stack((grid.plane.x_m, grid.plane.y_m)) for grid in _grids(alone)]
    around = Surroundings.of(alone, where_m, newcomers)
    told = tuple([around.told(road, one) for road, one in enumerate(alone)])
    return Told(told, newcomers, around)


class MapIndex:
    """A whole map version, immutable after `build`."""

    def __init__(
        self,
        radio_map: RadioMap,
        roads: Sequence[RoadIndex],
        carriers: tuple[str, ...],
        heard: Told,
    ) -> None:
        self.version = radio_map.version
        self.calibration = radio_map.calibration
        self.offset_prior = OffsetPrior.learnt(
            radio_map.calibration.offset_sd_db, carriers=len(carriers)
        )
        self.roads = tuple(roads)
        self.road_ids = tuple(road.road_id for road in roads)
        self.lengths_m = np.array([road.length_m for road in roads])
        self.cells = frozenset().union(*(model.cells for model in radio_map.models))
        self.carrier = {cell: carriers.index(carrier_of(cell)) for cell in self.cells}
        self.carriers = carriers
        self.usual_numbers = usual_numbers(radio_map.models)
        self.newcomers = heard.newcomers
        self.around = heard.around
        self.atlas = _draw_atlas(radio_map.models)
        self.lines = tuple(model.line for model in radio_map.models)
        self.graph = RoadGraph.of(self.lines)
        self.tapes = lay_tapes(radio_map.models, carriers, heard.newcomers)
        self.acquaintance = Acquaintance.of_all(self.tapes)
        self.coarse_places = places_of(self.tapes)
        self.turns = find_turns(self.graph, _grounds(self), self.tapes)

    def recalibrated(self, calibration: Calibration) -> MapIndex:
        """The same roads under another calibration; arrays are shared."""
        other = copy(self)
        other.calibration = calibration
        other.offset_prior = OffsetPrior.learnt(
            calibration.offset_sd_db, carriers=len(self.carriers)
        )
        return other

    @classmethod
    def build(cls, radio_map: RadioMap) -> MapIndex:
        """Lay out a map version for matching; numpy only, some tens of ms a road."""
        heard = told_of_others(radio_map.models)
        models = heard.models
        carriers = carriers_of(sorted({cell for model in models for cell in model.cells}))
        roads = [
            _road(number, model, carriers, heard.newcomers) for number, model in enumerate(models)
        ]
        return cls(replace(radio_map, models=models), roads, carriers, heard)

    def groups(self, cells: Sequence[str]) -> Int[np.ndarray, " cells"]:
        """Number of each cell's group, see `app.numerics.carriers.groups`."""
        return groups(cells, len(self.carriers))

    def usual(self, cells: Sequence[str]) -> Float[np.ndarray, " cells"]:
        """How many cells of its carrier a survey's sample lists where each of these is known."""
        return np.array([self.usual_numbers[cell] for cell in cells])

    def road_with(self, number: int, model: RoadModel) -> RoadIndex:
        """One of the roads laid out as if it had this model, the others being what they are."""
        return _road(number, model, self.carriers, self.newcomers)


def _grounds(index: MapIndex) -> Grounds:
    atlas = index.atlas
    return Grounds(index.lengths_m, atlas.step_m, atlas.start, atlas.size, atlas.plane[4])


def _road(
    number: int, model: RoadModel, others: tuple[str, ...], newcomers: Newcomers
) -> RoadIndex:
    along = road_profile(model.cells, model.mean_dbm, model.spread_db, model.heard, others)
    laid = newcomers.among((number,), model.cells, others)
    return RoadIndex(
        road_id=model.road_id,
        number=number,
        length_m=model.length_m,
        step_m=model.step_m,
        cells=model.cells,
        column=laid.columns,
        along=laid.muted(along, np.where(along.rows[-1] > 0.0, -1, 0)),
        edges_m=_edges_m(model),
        salient=Salient.of(model),
    )


def _edges_m(model: RoadModel) -> Floats:
    return np.array([segment.start_m for segment in model.segments] + [model.length_m])


def road_profile(
    cells: Sequence[str],
    mean_dbm: Float[np.ndarray, "grid cells"],
    spread_db: Float[np.ndarray, "grid cells"],
    heard: Float[np.ndarray, "grid cells"],
    others: tuple[str, ...] = (),
) -> Profile:
    """
    Profile of a road's grid with one column outside the road at either end.

    Args:
        others: Carriers of other roads.
    """
    ends = ((1, 1), (0, 0))
    mean, spread, hearing = (
        np.pad(values, ends, constant_values=np.nan) for values in (mean_dbm, spread_db, heard)
    )
    outside = np.zeros(len(mean), dtype=bool)
    outside[[0, -1]] = True
    return profile(cells, mean, spread, hearing, outside, others)


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Where a road's grid lies: chainages, degrees, and metres in the plane of `Atlas`."""

    at_m: Floats
    where: LonLat
    plane: XY


def _grid(model: RoadModel, plane: Plane) -> _Grid:
    at_m = np.arange(len(model.mean_dbm), dtype=np.float64) * model.step_m
    where = _running_on(point_at(model.line, at_m))
    return _Grid(at_m, where, plane.to_xy(where))


def _grids(models: Sequence[RoadModel]) -> list[_Grid]:
    found = planes([model.line for model in models])
    return [_grid(model, plane) for model, plane in zip(models, found, strict=True)]


def _draw_atlas(models: Sequence[RoadModel]) -> Atlas:
    sizes = np.array([len(model.mean_dbm) for model in models], dtype=np.intp)
    edges = [_edges_m(model) for model in models]
    columns: list[list[Floats]] = []
    for model, grid in zip(models, _grids(models), strict=True):
        inner_m = np.array([segment.start_m for segment in model.segments[1:]])
        segment = np.searchsorted(inner_m, grid.at_m, side="right").astype(float)
        heading = headings_deg(model.line, grid.at_m)
        where, plane = grid.where, grid.plane
        columns.append([plane.x_m, plane.y_m, where.lon, where.lat, heading, segment])
    drawn = [np.concatenate([c[i] for c in columns]) if columns else np.zeros(0) for i in range(6)]
    return Atlas(
        start=(np.cumsum(sizes) - sizes),
        size=sizes,
        step_m=np.array([model.step_m for model in models]),
        plane=np.stack(drawn[:5]),
        segment=drawn[5].astype(np.intp),
        edge_m=np.concatenate([*edges, np.zeros(0)]),
        first_edge=np.cumsum([0, *map(len, edges)]),
        wraps=bool(np.any(drawn[2] >= 180.0)),
    )


def _running_on(where: LonLat) -> LonLat:
    """Longitudes without the step of the antimeridian, so that one may go straight between them."""
    if np.ptp(where.lon) <= 180.0:
        return where
    return LonLat(np.where(where.lon < 0.0, where.lon + 360.0, where.lon), where.lat)
