"""What is kept of the surveys along each sub-segment: written with its model, read by version."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from app.domain import Line
from app.store.bounds import overlap
from app.store.columns import F8, unpack
from app.store.models import MOST_BOUND
from app.store.records import Bounds
from app.store.roads import driven_line
from app.store.tables import map_roads, passes, road_models, roads, segment_coverage, segments


@dataclass(frozen=True, slots=True)
class CoveredSegment:
    """
    A sub-segment of a map version and what is known of its surveys.

    ``counts`` is None of a model that was made before this was kept; its members are those of
    `app.numerics.coverage.SegmentCoverage`.
    """

    road_id: str
    name: str | None
    model_id: int
    segment_index: int
    start_m: float
    end_m: float
    counts: SegmentCounts | None


@dataclass(frozen=True, slots=True)
class SegmentCounts:
    """The columns of the table; `app.numerics.coverage.SegmentCoverage` says what they mean."""

    passes: int
    forward: int
    backward: int
    days: int
    devices: int
    cells: int
    cells_heard: float
    spread_db: float | None
    last_surveyed_at: datetime | None
    place_information: float
    mixed_information: float
    offset_information: float


@dataclass(frozen=True, slots=True, eq=False)
class UnmappedRoad:
    """A road that a map version has no model of; ``line`` is None while nobody drew or drove it."""

    road_id: str
    name: str | None
    line: Line | None


def insert_coverage(
    connection: Connection, model_id: int, rows: Sequence[Mapping[str, object]]
) -> None:
    """Keep the coverage of a model's segments: each ``segment_index`` with its counts."""
    if rows:
        connection.execute(segment_coverage.insert(), [{"model_id": model_id, **r} for r in rows])


def select_covered(connection: Connection, version: int | None) -> list[CoveredSegment]:
    """Every segment of a version with its coverage, by road id and index; none for None."""
    counts = [column for column in segment_coverage.c if not column.primary_key]
    on_segment = (segment_coverage.c.model_id == segments.c.model_id) & (
        segment_coverage.c.segment_index == segments.c.segment_index
    )
    rows = connection.execute(
        sa.select(
            map_roads.c.road_id, roads.c.name, segments.c.model_id, segments.c.segment_index,
            segments.c.start_m, segments.c.end_m, *counts,
        )
        .join(roads, roads.c.road_id == map_roads.c.road_id)
        .join(segments, segments.c.model_id == map_roads.c.model_id)
        .outerjoin(segment_coverage, on_segment)
        .where(map_roads.c.version == version)
    ).all()  # fmt: skip
    return sorted((_covered(row) for row in rows), key=lambda one: (one.road_id, one.segment_index))


def roads_in(connection: Connection, version: int | None, box: Bounds) -> set[str]:
    """Roads of a version whose models touch a box."""
    edges = [road_models.c[name] for name in ("west", "south", "east", "north")]
    return set(
        connection.scalars(
            sa.select(map_roads.c.road_id)
            .join(road_models, road_models.c.model_id == map_roads.c.model_id)
            .where(map_roads.c.version == version, overlap(box, *edges))
        )
    )


def model_lines(connection: Connection, model_ids: Sequence[int]) -> dict[int, Line]:
    """The lines that models were built along."""
    found = {}
    for first in range(0, len(model_ids), MOST_BOUND):
        some = road_models.c.model_id.in_(model_ids[first : first + MOST_BOUND])
        columns = road_models.c.model_id, road_models.c.line_lon, road_models.c.line_lat
        for row in connection.execute(sa.select(*columns).where(some)):
            found[row.model_id] = Line(unpack(row.line_lon, F8), unpack(row.line_lat, F8))
    return found


def unmapped_roads(
    connection: Connection, version: int | None, box: Bounds | None
) -> list[UnmappedRoad]:
    """Roads without a model in a version, by id; found ones only while a drive runs along them."""
    mapped = sa.select(map_roads.c.road_id).where(map_roads.c.version == version)
    query = (
        sa.select(roads.c.road_id, roads.c.name, roads.c.line_lon, roads.c.line_lat)
        .where(roads.c.road_id.not_in(mapped))
        .where(~roads.c.found | sa.exists().where(passes.c.road_id == roads.c.road_id))
    )
    if box is not None:
        query = query.where(overlap(box, roads.c.west, roads.c.south, roads.c.east, roads.c.north))
    found = []
    for row in connection.execute(query).all():
        if row.line_lon is None:
            line = driven_line(connection, row.road_id)
        else:
            line = Line(unpack(row.line_lon, F8), unpack(row.line_lat, F8))
        found.append(UnmappedRoad(row.road_id, row.name, line))
    return sorted(found, key=lambda one: one.road_id)


def _covered(row: Row[Any]) -> CoveredSegment:
    names = SegmentCounts.__slots__
    counts = None
    if row.passes is not None:
        counts = SegmentCounts(**{name: getattr(row, name) for name in names})
    return CoveredSegment(
        row.road_id, row.name, row.model_id, row.segment_index, row.start_m, row.end_m, counts
    )
