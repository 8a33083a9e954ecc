"""Map versions: the model of each road, their calibration, and which version is active."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from app.domain import Calibration, Reliability
from app.store.columns import utc_now
from app.store.records import MapVersion
from app.store.tables import activations, map_roads, map_versions

_LATEST = sa.select(sa.func.max(activations.c.activation_id)).scalar_subquery()


def active_version(connection: Connection) -> int | None:
    """Number of the active map version."""
    return connection.scalar(
        sa.select(activations.c.version).where(activations.c.activation_id == _LATEST)
    )


def activate(connection: Connection, version: int) -> None:
    """Make a version the active one: one inserted row, so that no one ever sees a half change."""
    connection.execute(activations.insert().values(version=version, activated_at=utc_now()))


def select_versions(connection: Connection, version: int | None = None) -> list[MapVersion]:
    """All versions, newest first; or the one asked for, if it exists."""
    last = (
        sa.select(activations.c.version, sa.func.max(activations.c.activated_at).label("last_at"))
        .group_by(activations.c.version)
        .subquery()
    )
    query = (
        sa.select(map_versions, last.c.last_at)
        .outerjoin(last, last.c.version == map_versions.c.version)
        .order_by(map_versions.c.version.desc())
    )
    if version is not None:
        query = query.where(map_versions.c.version == version)
    active = active_version(connection)
    return [_version(row, active) for row in connection.execute(query)]


def select_calibration(connection: Connection, version: int) -> Calibration | None:
    """The calibration stored with a version."""
    found = connection.scalar(
        sa.select(map_versions.c.calibration).where(map_versions.c.version == version)
    )
    return None if found is None else _calibration(found)


def model_ids(connection: Connection, version: int | None) -> dict[str, int]:
    """Model number of each road of a version; empty for None."""
    rows = connection.execute(
        sa.select(map_roads.c.road_id, map_roads.c.model_id).where(map_roads.c.version == version)
    )
    return {row.road_id: row.model_id for row in rows}


def model_of(connection: Connection, version: int | None, road_id: str) -> int | None:
    """Model number of one road of a version."""
    return connection.scalar(
        sa.select(map_roads.c.model_id).where(
            map_roads.c.version == version, map_roads.c.road_id == road_id
        )
    )


def insert_version(
    connection: Connection, build_id: str, models: Mapping[str, int], calibration: Calibration
) -> int:
    """Store a version that names these models; its number, one above the highest so far."""
    highest = connection.scalar(sa.select(sa.func.max(map_versions.c.version)))
    version = (highest or 0) + 1
    connection.execute(
        map_versions.insert().values(
            version=version,
            build_id=build_id,
            created_at=utc_now(),
            road_count=len(models),
            calibration=dataclasses.asdict(calibration),
        )
    )
    rows = [
        {"version": version, "road_id": road_id, "model_id": model_id}
        for road_id, model_id in sorted(models.items())
    ]
    if rows:
        connection.execute(map_roads.insert(), rows)
    return version


def _version(row: Row[Any], active: int | None) -> MapVersion:
    return MapVersion(
        version=row.version,
        created_at=row.created_at,
        activated_at=row.last_at,
        active=row.version == active,
        road_count=row.road_count,
        build_id=row.build_id,
        calibration=_calibration(row.calibration),
    )


TERMS_OF_A_DAY = 6  # of the log odds of being on the map, as maps of one day's code have them
USUALLY_VARIED = 0.7  # of windows of real streets: log(1 + variance along it / 9 dB^2)


def _of_usual_levels(off_map: tuple[float, ...]) -> tuple[float, ...]:
    """
    Log odds without how much levels vary along the window, which once was their sixth term and
    which nothing asks for any more: every window is taken to vary as most do.
    """
    if len(off_map) != TERMS_OF_A_DAY:
        return off_map
    constant, *others, varied = off_map
    return constant + USUALLY_VARIED * varied, *others


def _calibration(stored: Mapping[str, Any]) -> Calibration:
    values = dict(stored)
    if "temperature" in values:  # of a version made before windows had temperatures of their own
        values["information_each"] = 1.0 / values.pop("temperature")
        line = values.pop("off_map_intercept"), values.pop("off_map_slope")
        values["off_map"] = (*line, 0.0, 0.0)
    values["off_map"] = _of_usual_levels(tuple(values["off_map"]))
    if "segment_sd_m" not in values:  # of a version made before sub-segments had one of their own
        values["segment_sd_m"] = values["position_sd_m"]
    reliability: dict[str, Any] = {
        name: tuple(tuple(pair) for pair in value) if isinstance(value, list) else value
        for name, value in values.pop("reliability", {}).items()
    }
    return Calibration(**values, reliability=Reliability(**reliability))
