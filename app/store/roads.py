"""Roads and cells as they are known before any model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Connection

from app.domain import Line, Road
from app.store.bounds import bounds_of, overlap, union
from app.store.columns import F8, pack, unpack, utc_now
from app.store.records import Bounds
from app.store.tables import activations, cells, map_roads, passes, road_models, roads, surveys


@dataclass(frozen=True, slots=True, eq=False)
class NearRoad:
    """
    A road with the best line known.

    ``found``: drives made it. ``raw``: the line is but the positions of its first pass.
    """

    road_id: str
    found: bool
    raw: bool
    line: Line


def upsert(connection: Connection, table: sa.Table) -> sqlite.Insert | postgresql.Insert:
    """An insert that understands ON CONFLICT, in the spelling of the connection's database."""
    if connection.dialect.name == "postgresql":
        return postgresql.insert(table)
    return sqlite.insert(table)


def put_road(connection: Connection, road: Road) -> None:
    """Create a road or set its name and line; what is None leaves what is stored."""
    values: dict[str, object] = {"name": road.name} if road.name is not None else {}
    if road.line is not None:
        box = bounds_of(road.line.lon, road.line.lat)
        values |= {
            "line_lon": pack(road.line.lon, F8),
            "line_lat": pack(road.line.lat, F8),
            **_box_values(box),
            "found": False,
        }
    known = connection.execute(
        roads.update().where(roads.c.road_id == road.road_id).values(road_id=road.road_id, **values)
    )
    if known.rowcount == 0:
        connection.execute(
            roads.insert().values(road_id=road.road_id, created_at=utc_now(), **values)
        )


def set_found_line(connection: Connection, road_id: str, line: Line | None) -> None:
    """Create a road that drives made, or move its line; None when no drive runs along it."""
    values: dict[str, object] = dict.fromkeys(("west", "south", "east", "north"))
    values |= {"line_lon": None, "line_lat": None}
    if line is not None:
        values = {
            "line_lon": pack(line.lon, F8),
            "line_lat": pack(line.lat, F8),
            **_box_values(bounds_of(line.lon, line.lat)),
        }
    known = connection.execute(
        roads.update().where(roads.c.road_id == road_id, roads.c.found).values(**values)
    )
    if known.rowcount == 0 and line is not None:
        connection.execute(
            roads.insert().values(road_id=road_id, created_at=utc_now(), found=True, **values)
        )


def widen(connection: Connection, road_id: str, box: Bounds, *, found: bool = False) -> None:
    """
    Make sure that the road exists and, when nobody set its line, that its box holds ``box``.

    Args:
        found: Of a road that is new: a drive makes it.
    """
    row = connection.execute(sa.select(roads).where(roads.c.road_id == road_id)).one_or_none()
    if row is None:
        connection.execute(
            roads.insert().values(
                road_id=road_id, created_at=utc_now(), found=found, **_box_values(box)
            )
        )
    elif row.line_lon is None:
        if row.west is not None:
            box = union(Bounds(row.west, row.south, row.east, row.north), box)
        connection.execute(
            roads.update().where(roads.c.road_id == road_id).values(**_box_values(box))
        )


def select_road(connection: Connection, road_id: str) -> Road | None:
    """A road with the line that was set."""
    row = connection.execute(sa.select(roads).where(roads.c.road_id == road_id)).one_or_none()
    if row is None:
        return None
    line = None
    if row.line_lon is not None:
        line = Line(unpack(row.line_lon, F8), unpack(row.line_lat, F8))
    return Road(road_id, row.name, line)


def missing_roads(connection: Connection, road_ids: Iterable[str]) -> list[str]:
    """Which of these ids name no road."""
    wanted = set(road_ids)
    found = connection.scalars(sa.select(roads.c.road_id).where(roads.c.road_id.in_(wanted)))
    return sorted(wanted - set(found))


def surveyed_roads(connection: Connection) -> list[str]:
    """Ids of all roads with at least one pass, sorted."""
    return sorted(connection.scalars(sa.select(passes.c.road_id).distinct()))


def lines_near(connection: Connection, box: Bounds) -> list[tuple[str, Line]]:
    """
    Roads whose box touches ``box`` with the best line known of each, sorted by id.

    The line that was set, else the active model's, else the positions of the first survey.
    """
    return [(road.road_id, road.line) for road in roads_near(connection, box)]


def roads_near(connection: Connection, box: Bounds) -> list[NearRoad]:
    """The same with who made each road."""
    found = connection.execute(
        sa.select(roads.c.road_id, roads.c.found, roads.c.line_lon, roads.c.line_lat)
        .where(overlap(box, roads.c.west, roads.c.south, roads.c.east, roads.c.north))
        .order_by(roads.c.road_id)
    ).all()
    near = []
    for row in found:
        line: tuple[bytes, bytes] | None = (row.line_lon, row.line_lat)
        if row.line_lon is None:
            line = _modelled_line(connection, row.road_id)
        raw = line is None
        if line is None:
            line = _driven_line(connection, row.road_id)
        if line is not None:
            drawn = Line(unpack(line[0], F8), unpack(line[1], F8))
            near.append(NearRoad(row.road_id, row.found, raw, drawn))
    return near


def driven_line(connection: Connection, road_id: str) -> Line | None:
    """The positions of a road's first pass; None when it has none."""
    driven = _driven_line(connection, road_id)
    return None if driven is None else Line(unpack(driven[0], F8), unpack(driven[1], F8))


def note_cells(connection: Connection, names: Iterable[str]) -> None:
    """Make sure that these cells are known."""
    rows = [{"cell": cell, "first_seen_at": utc_now()} for cell in sorted(set(names))]
    if rows:
        connection.execute(upsert(connection, cells).on_conflict_do_nothing(), rows)


def _modelled_line(connection: Connection, road_id: str) -> tuple[bytes, bytes] | None:
    newest = sa.select(sa.func.max(activations.c.activation_id)).scalar_subquery()
    modelled = connection.execute(
        sa.select(road_models.c.line_lon, road_models.c.line_lat)
        .join(map_roads, map_roads.c.model_id == road_models.c.model_id)
        .join(activations, activations.c.version == map_roads.c.version)
        .where(activations.c.activation_id == newest, map_roads.c.road_id == road_id)
    ).one_or_none()
    return None if modelled is None else (modelled.line_lon, modelled.line_lat)


def _driven_line(connection: Connection, road_id: str) -> tuple[bytes, bytes] | None:
    driven = connection.execute(
        sa.select(surveys.c.lon, surveys.c.lat, passes.c.first_sample, passes.c.end_sample)
        .join(passes, passes.c.survey_id == surveys.c.survey_id)
        .where(passes.c.road_id == road_id)
        .order_by(passes.c.survey_id, passes.c.position)
        .limit(1)
    ).one_or_none()
    if driven is None:
        return None
    part = slice(8 * driven.first_sample, 8 * driven.end_sample)  # float64 is 8 bytes
    return driven.lon[part], driven.lat[part]


def _box_values(box: Bounds) -> dict[str, float]:
    return {"west": box.west, "south": box.south, "east": box.east, "north": box.north}
