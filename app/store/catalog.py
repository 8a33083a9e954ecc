"""What people ask of a map: its roads and cells, in pages and by place."""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from app.domain import Line
from app.store.bounds import overlap
from app.store.columns import F8, unpack
from app.store.records import Bounds, CellSummary, Page, RoadSummary
from app.store.tables import builds, map_roads, model_cells, passes, road_models, roads


def select_roads(
    connection: Connection,
    *,
    version: int | None,
    box: Bounds | None,
    limit: int,
    after: str | None,
) -> Page[RoadSummary]:
    """Roads by id, those without a model in the version included; only those that touch ``box``."""
    query = _road_query(version).order_by(roads.c.road_id).limit(limit + 1)
    if after is not None:
        query = query.where(roads.c.road_id > after)
    if box is not None:
        edges = [
            sa.func.coalesce(road_models.c[name], roads.c[name])
            for name in ("west", "south", "east", "north")
        ]
        query = query.where(overlap(box, *edges))
    rows = connection.execute(query).all()
    items = tuple(_road(row) for row in rows[:limit])
    return Page(items, items[-1].road_id if len(rows) > limit else None)


def select_road(connection: Connection, road_id: str, version: int | None) -> RoadSummary | None:
    """One road as the version has it."""
    query = _road_query(version).where(roads.c.road_id == road_id)
    row = connection.execute(query).one_or_none()
    return _road(row) if row else None


def select_cells(connection: Connection, version: int | None) -> list[CellSummary]:
    """Every cell mapped in a version, by id; means are weighted by the mapped metres."""
    weighted = sa.func.sum(model_cells.c.mean_dbm * model_cells.c.grid_count)
    rows = connection.execute(
        sa.select(
            model_cells.c.cell,
            sa.func.count().label("road_count"),
            sa.func.sum(model_cells.c.segment_count).label("segment_count"),
            sa.func.min(model_cells.c.min_dbm).label("min_dbm"),
            sa.func.max(model_cells.c.max_dbm).label("max_dbm"),
            (weighted / sa.func.nullif(sa.func.sum(model_cells.c.grid_count), 0)).label("mean_dbm"),
        )
        .join(map_roads, map_roads.c.model_id == model_cells.c.model_id)
        .where(map_roads.c.version == version)
        .group_by(model_cells.c.cell)
        .order_by(model_cells.c.cell)
    )
    return [
        CellSummary(
            row.cell, row.road_count, int(row.segment_count), row.min_dbm, row.max_dbm, row.mean_dbm
        )
        for row in rows
    ]


def _road_query(version: int | None) -> sa.Select[Any]:
    surveys_of = sa.func.count(sa.distinct(passes.c.survey_id))
    survey_count = (
        sa.select(surveys_of).where(passes.c.road_id == roads.c.road_id).scalar_subquery()
    )
    in_version = (map_roads.c.road_id == roads.c.road_id) & (map_roads.c.version == version)
    return (
        sa.select(
            roads,
            survey_count.label("survey_count"),
            road_models.c.length_m,
            road_models.c.pass_count,
            road_models.c.segment_count,
            road_models.c.cells,
            road_models.c.line_lon.label("model_lon"),
            road_models.c.line_lat.label("model_lat"),
            builds.c.map_version,
        )
        .outerjoin(map_roads, in_version)
        .outerjoin(road_models, road_models.c.model_id == map_roads.c.model_id)
        .outerjoin(builds, builds.c.build_id == road_models.c.build_id)
        # A road that drives made is none when no drive runs along it and the map has it not.
        .where(
            ~roads.c.found
            | map_roads.c.model_id.is_not(None)
            | sa.exists().where(passes.c.road_id == roads.c.road_id)
        )
    )


def _road(row: Row[Any]) -> RoadSummary:
    lon, lat = row.line_lon, row.line_lat
    if lon is None:
        lon, lat = row.model_lon, row.model_lat
    return RoadSummary(
        road_id=row.road_id,
        name=row.name,
        line=None if lon is None else Line(unpack(lon, F8), unpack(lat, F8)),
        length_m=row.length_m,
        pass_count=row.pass_count or 0,
        survey_count=row.survey_count,
        segment_count=row.segment_count or 0,
        model_version=row.map_version,
        cells=tuple(row.cells or ()),
    )
