"""Roads and their segments, as JSON or GeoJSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Path, Query, Request
from pydantic import BaseModel, Field
from sqlalchemy import Engine
from starlette.responses import Response

from app.api.box import BBOX, bounds_of_query
from app.api.checks import check_within
from app.api.content import GEOJSON, require_json, wants_geojson
from app.api.documents import (
    feature_collection,
    road_document,
    road_feature,
    segment_document,
    segment_feature,
)
from app.api.faults import Faults
from app.api.openapi import problems, reference
from app.api.replies import reply, unless_same
from app.api.schemas.fields import RoadId
from app.api.schemas.roads import (
    Feature,
    FeatureCollection,
    LineStringRequest,
    RoadDocument,
    RoadPage,
    RoadRequest,
    SegmentDocument,
    SegmentList,
)
from app.api.state import EngineOf
from app.domain import Line, Road
from app.services.maps import active_version
from app.services.roads import (
    get_road,
    get_segment,
    list_roads,
    put_road,
    road_with_segments,
)

router = APIRouter(prefix="/v1/roads", tags=["roads"])

MAX_INDEX = 2**31 - 1  # what every database's integer holds

RoadIdOf = Annotated[RoadId, Path()]


def _as_geojson(model: type[Feature | FeatureCollection]) -> dict[int | str, dict[str, Any]]:
    content = {GEOJSON: {"schema": reference(model)}}
    return {200: {"description": "Successful Response", "content": content}}


class MapQuery(BaseModel):
    """Which map to read."""

    map_version: int | None = Field(
        default=None, ge=1, le=MAX_INDEX, description="Another version than the active one."
    )


class RoadsQuery(MapQuery):
    """Which roads to list."""

    bbox: str | None = BBOX
    limit: int = Field(default=100, ge=1, le=1000)
    cursor: str | None = None


@dataclass(frozen=True, slots=True)
class MapRead:
    """One read of a map: by whom, in which form, and from where."""

    request: Request
    engine: Engine
    geojson: bool

    def version(self, query: MapQuery) -> int | None:
        """The version asked for, else the active one; None when there is no map."""
        return query.map_version or active_version(self.engine)

    def answer(self, version: int | None, document: object) -> Response:
        """The document, or 304."""
        return unless_same(self.request, f"map-{version}", document, geojson=self.geojson)


async def _map_read(
    request: Request, engine: EngineOf, geojson: Annotated[bool, Depends(wants_geojson)]
) -> MapRead:
    return MapRead(request, engine, geojson)


MapReadOf = Annotated[MapRead, Depends(_map_read)]
MapQueryOf = Annotated[MapQuery, Query()]


@router.get(
    "",
    response_model=RoadPage,
    responses={**_as_geojson(FeatureCollection), **problems(404, 406, 422)},
)
def get_roads(read: MapReadOf, query: Annotated[RoadsQuery, Query()]) -> Response:
    """Roads by id, mapped or not; `bbox` keeps those that touch a box."""
    version = read.version(query)
    page = list_roads(
        read.engine,
        version=version,
        bbox=bounds_of_query(query.bbox) if query.bbox else None,
        limit=query.limit,
        cursor=query.cursor or None,
    )
    if read.geojson:
        features = [road_feature(road) for road in page.items]
        return read.answer(version, feature_collection(features, version, page.next_cursor))
    roads = [road_document(road) for road in page.items]
    document = {"map_version": version, "roads": roads, "next_cursor": page.next_cursor}
    return read.answer(version, document)


@router.get(
    "/{road_id}",
    response_model=RoadDocument,
    responses={**_as_geojson(Feature), **problems(404, 406)},
)
def get_one_road(road_id: RoadIdOf, read: MapReadOf, query: MapQueryOf) -> Response:
    """One road."""
    version = read.version(query)
    road = get_road(read.engine, road_id, version)
    return read.answer(version, (road_feature if read.geojson else road_document)(road))


@router.put(
    "/{road_id}",
    response_model=RoadDocument,
    responses=problems(415, 422),
    dependencies=[Depends(require_json)],
)
def put_one_road(road_id: RoadIdOf, body: RoadRequest, engine: EngineOf) -> Response:
    """
    Creates a road, or sets its name and line.

    A model that is there keeps the line it was built along until the road's next build.
    """
    line = _line(body.line) if body.line else None
    return reply(road_document(put_road(engine, Road(road_id, body.name, line))))


@router.get(
    "/{road_id}/segments",
    response_model=SegmentList,
    responses={**_as_geojson(FeatureCollection), **problems(404, 406)},
)
def get_segments(road_id: RoadIdOf, read: MapReadOf, query: MapQueryOf) -> Response:
    """All segments of a road, in order; none while the map does not have it."""
    version = read.version(query)
    found = road_with_segments(read.engine, road_id, version)
    if read.geojson:
        features = [segment_feature(found.road, segment) for segment in found.segments]
        return read.answer(version, feature_collection(features, version))
    segments = [segment_document(found.road, segment) for segment in found.segments]
    document = {"road_id": road_id, "map_version": version, "segments": segments}
    return read.answer(version, document)


@router.get(
    "/{road_id}/segments/{index}",
    response_model=SegmentDocument,
    responses={**_as_geojson(Feature), **problems(404, 406)},
)
def get_one_segment(
    road_id: RoadIdOf,
    index: Annotated[int, Path(ge=0, le=MAX_INDEX)],
    read: MapReadOf,
    query: MapQueryOf,
) -> Response:
    """One segment: its stretch, features, mask, information gain and fits."""
    version = read.version(query)
    found = get_segment(read.engine, road_id, index, version)
    make = segment_feature if read.geojson else segment_document
    return read.answer(version, make(found.road, found.segment))


def _line(given: LineStringRequest) -> Line:
    """
    The line of a road.

    Raises:
        InvalidInput: It leaves the earth or jumps.
    """
    coordinates = np.array([position[:2] for position in given.coordinates])
    lon, lat = np.ascontiguousarray(coordinates.T)
    faults = Faults()
    check_within("/line/coordinates", lon, (-180.0, 180.0), "degrees east", faults)
    check_within("/line/coordinates", lat, (-90.0, 90.0), "degrees north", faults)
    if not faults.count and not (np.ptp(lon) or np.ptp(lat)):
        faults.add("/line/coordinates", "all vertices are the same point")
    faults.raise_if_any()
    return Line(lon, lat)
