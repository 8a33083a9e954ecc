"""Roads, their segments and the cells heard along them, as one map version has them."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy.engine import Connection, Engine

from app.domain import Road, Segment
from app.errors import NotFound
from app.services.paging import after, bounded, sealed
from app.store import catalog, drives, models, roads, versions
from app.store.bounds import bounds_of, widened
from app.store.engine import read, write
from app.store.records import Bounds, CellSummary, Page, RoadSummary

__all__ = [
    "Bounds",
    "CellSummary",
    "Page",
    "RoadSegment",
    "RoadSummary",
    "get_road",
    "get_segment",
    "list_cells",
    "list_roads",
    "list_segments",
    "put_road",
    "road_with_segments",
]


NEAR_DEG = 0.001  # some 110 m: a drive farther off cannot lie on the road


@dataclass(frozen=True, slots=True)
class RoadSegment:
    """One segment with the road it is part of; ``road.cells`` names the columns of its features."""

    road: RoadSummary
    segment: Segment


@dataclass(frozen=True, slots=True)
class RoadSegments:
    """All segments of a road with the road; ``road.cells`` names the columns of their features."""

    road: RoadSummary
    segments: tuple[Segment, ...]


def put_road(engine: Engine, road: Road) -> RoadSummary:
    """
    Create a road or set its name and line; what is None is left as it is.

    A model that is there keeps the line it was built along until the next build of the road. Drives
    that name no road and come near the line are laid on it by the next build.
    """
    with write(engine) as connection:
        roads.put_road(connection, road)
        if road.line is not None:
            near = widened(bounds_of(road.line.lon, road.line.lat), NEAR_DEG)
            drives.mark(connection, drives.loose_in(connection, near), "waiting")
        return _road(connection, road.road_id, versions.active_version(connection))


def list_roads(
    engine: Engine,
    *,
    version: int | None = None,
    bbox: Bounds | None = None,
    limit: int = 100,
    cursor: str | None = None,
) -> Page[RoadSummary]:
    """
    Roads by id, as a map version has them (the active one when None), mapped or not.

    Args:
        bbox: Only roads that touch this box; ``west > east`` holds the antimeridian.

    Raises:
        NotFound: There is no such version.
        InvalidInput: ``limit`` or ``cursor`` is wrong.
    """
    with read(engine) as connection:
        page = catalog.select_roads(
            connection,
            version=_known_version(connection, version),
            box=bbox,
            limit=bounded(limit),
            after=after(cursor),
        )
    return sealed(page)


def get_road(engine: Engine, road_id: str, version: int | None = None) -> RoadSummary:
    """
    One road as a map version has it (the active one when None).

    Raises:
        NotFound: There is no such road or version.
    """
    with read(engine) as connection:
        return _road(connection, road_id, _known_version(connection, version))


def road_with_segments(engine: Engine, road_id: str, version: int | None = None) -> RoadSegments:
    """
    A road and all its segments with their fits; no segments when the version does not map it.

    Raises:
        NotFound: There is no such road or version.
    """
    with read(engine) as connection:
        known = _known_version(connection, version)
        road = _road(connection, road_id, known)
        model_id = versions.model_of(connection, known, road_id)
        parts = [] if model_id is None else models.select_segments(connection, model_id)
    return RoadSegments(road, tuple(parts))


def list_segments(engine: Engine, road_id: str, version: int | None = None) -> list[Segment]:
    """
    The segments of a road with their fits, in order; none when the version does not map it.

    Raises:
        NotFound: There is no such road or version.
    """
    return list(road_with_segments(engine, road_id, version).segments)


def get_segment(
    engine: Engine, road_id: str, index: int, version: int | None = None
) -> RoadSegment:
    """
    One segment with its fits, and its road.

    Raises:
        NotFound: There is no such road, version or segment.
    """
    with read(engine) as connection:
        known = _known_version(connection, version)
        road = _road(connection, road_id, known)
        model_id = versions.model_of(connection, known, road_id)
        found = (
            [] if model_id is None else models.select_segments(connection, model_id, index=index)
        )
    if not found:
        raise NotFound("segment", f"{road_id}/{index}")
    return RoadSegment(road, found[0])


def list_cells(engine: Engine, version: int | None = None) -> list[CellSummary]:
    """
    Every cell mapped in a version (the active one when None), by id.

    Raises:
        NotFound: There is no such version.
    """
    with read(engine) as connection:
        return catalog.select_cells(connection, _known_version(connection, version))


def _known_version(connection: Connection, version: int | None) -> int | None:
    if version is None:
        return versions.active_version(connection)
    if versions.select_calibration(connection, version) is None:
        raise NotFound("map version", version)
    return version


def _road(connection: Connection, road_id: str, version: int | None) -> RoadSummary:
    found = catalog.select_road(connection, road_id, version)
    if found is None:
        raise NotFound("road", road_id)
    return found
