"""Builds and how far each of their roads is. The rows are the outbox that a worker reads."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from app.store.columns import new_id, utc_now
from app.store.records import UNFINISHED, BuildState, BuildStatus, FailedRoad, Page, RoadOutcome
from app.store.tables import build_roads, builds

DONE_STATES = ("built", "gone", "failed")


def insert_build(connection: Connection, *, activate: bool, due_at: datetime) -> str:
    """A new accepted build without roads; its id."""
    build_id = new_id()
    connection.execute(
        builds.insert().values(
            build_id=build_id,
            status="accepted",
            activate=activate,
            created_at=utc_now(),
            due_at=due_at,
        )
    )
    return build_id


def add_roads(connection: Connection, build_id: str, road_ids: Sequence[str]) -> None:
    """Put roads at the end of a build's list, without those that it has."""
    known = set(
        connection.scalars(
            sa.select(build_roads.c.road_id).where(build_roads.c.build_id == build_id)
        )
    )
    rows = [
        {
            "build_id": build_id,
            "road_id": road_id,
            "position": position,
            "state": "waiting",
            "attempts": 0,
        }
        for position, road_id in enumerate((r for r in road_ids if r not in known), len(known))
    ]
    if rows:
        connection.execute(build_roads.insert(), rows)


def open_build(connection: Connection) -> Row[Any] | None:
    """The newest build that has not begun and will activate its map, if any."""
    return connection.execute(
        sa.select(builds)
        .where(builds.c.status == "accepted", builds.c.activate)
        .order_by(builds.c.build_id.desc())
        .limit(1)
    ).one_or_none()


def postpone(connection: Connection, build_id: str, due_at: datetime) -> None:
    """Let a build begin no earlier than ``due_at``."""
    connection.execute(builds.update().where(_is(build_id)).values(due_at=due_at))


def due_builds(connection: Connection) -> list[tuple[str, BuildStatus]]:
    """Builds that a worker has to see to, oldest first: the due ones and the running ones."""
    rows = connection.execute(
        sa.select(builds.c.build_id, builds.c.status)
        .where(builds.c.status.in_(UNFINISHED), builds.c.due_at <= utc_now())
        .order_by(builds.c.build_id)
    )
    return [(row.build_id, row.status) for row in rows]


def begin(connection: Connection, build_id: str) -> BuildStatus | None:
    """
    Close the list of roads and mark the build running; its status then (None: no such build).

    Doing it again changes nothing. Builds are numbered in the order in which they begin: where two
    build the same road, the later one's surveys include the earlier one's.
    """
    status = select_status(connection, build_id)
    if status != "accepted":
        return status
    highest = connection.scalar(sa.select(sa.func.max(builds.c.start_number)))
    connection.execute(
        builds.update()
        .where(_is(build_id))
        .values(status="running", started_at=utc_now(), start_number=(highest or 0) + 1)
    )
    return "running"


def finish(
    connection: Connection,
    build_id: str,
    status: BuildStatus,
    *,
    map_version: int | None = None,
    problem: dict[str, Any] | None = None,
) -> bool:
    """Give an unfinished build its last status; False when it was finished already."""
    changed = connection.execute(
        builds.update()
        .where(_is(build_id), builds.c.status.in_(UNFINISHED))
        .values(status=status, finished_at=utc_now(), map_version=map_version, problem=problem)
    )
    return changed.rowcount == 1


def select_status(connection: Connection, build_id: str) -> BuildStatus | None:
    """Status of a build, None when there is no such build."""
    return connection.scalar(sa.select(builds.c.status).where(_is(build_id)))


def select_roads(connection: Connection, build_id: str) -> list[Row[Any]]:
    """Rows of a build's roads in the order of its list."""
    query = sa.select(build_roads).where(build_roads.c.build_id == build_id)
    return list(connection.execute(query.order_by(build_roads.c.position)))


def begin_road(connection: Connection, build_id: str, road_id: str) -> int:
    """Count one more attempt at a road; how many there were with this one, 0 when it is done."""
    row = (build_roads.c.build_id == build_id) & (build_roads.c.road_id == road_id)
    attempts = connection.execute(
        build_roads.update()
        .where(row, build_roads.c.state == "waiting")
        .values(attempts=build_roads.c.attempts + 1)
        .returning(build_roads.c.attempts)
    ).scalar()
    return attempts or 0


def finish_road(connection: Connection, build_id: str, road_id: str, outcome: RoadOutcome) -> bool:
    """Close one road of a running build; False when it is closed or the build is over."""
    if select_status(connection, build_id) != "running":
        return False
    changed = connection.execute(
        build_roads.update()
        .where(
            build_roads.c.build_id == build_id,
            build_roads.c.road_id == road_id,
            build_roads.c.state == "waiting",
        )
        .values(state=outcome.state, code=outcome.code, detail=outcome.detail)
    )
    return changed.rowcount == 1


def select_build(connection: Connection, build_id: str) -> BuildState | None:
    """A build as it stands."""
    row = connection.execute(sa.select(builds).where(_is(build_id))).one_or_none()
    return _states(connection, [row])[0] if row else None


def select_page(connection: Connection, *, limit: int, before: str | None) -> Page[BuildState]:
    """Builds, newest first, older than ``before``."""
    query = sa.select(builds).order_by(builds.c.build_id.desc()).limit(limit + 1)
    if before is not None:
        query = query.where(builds.c.build_id < before)
    rows = connection.execute(query).all()
    items = tuple(_states(connection, rows[:limit]))
    return Page(items, items[-1].id if len(rows) > limit else None)


def _is(build_id: str) -> sa.ColumnElement[bool]:
    return builds.c.build_id == build_id


def _states(connection: Connection, rows: Sequence[Row[Any]]) -> list[BuildState]:
    ids = [row.build_id for row in rows]
    done = sa.func.sum(sa.case((build_roads.c.state.in_(DONE_STATES), 1), else_=0))
    counts = {
        row.build_id: (row.total, row.done)
        for row in connection.execute(
            sa.select(build_roads.c.build_id, sa.func.count().label("total"), done.label("done"))
            .where(build_roads.c.build_id.in_(ids))
            .group_by(build_roads.c.build_id)
        )
    }
    failed: dict[str, list[FailedRoad]] = {build_id: [] for build_id in ids}
    for row in connection.execute(
        sa.select(build_roads)
        .where(build_roads.c.build_id.in_(ids), build_roads.c.state == "failed")
        .order_by(build_roads.c.build_id, build_roads.c.position)
    ):
        failed[row.build_id].append(FailedRoad(row.road_id, row.code, row.detail))
    return [_state(row, *counts.get(row.build_id, (0, 0)), failed[row.build_id]) for row in rows]


def _state(row: Row[Any], total: int, done: int, failed: list[FailedRoad]) -> BuildState:
    return BuildState(
        id=row.build_id,
        status=row.status,
        progress=1.0 if row.status == "successful" or not total else done / total,
        roads_done=done,
        roads_total=total,
        map_version=row.map_version,
        problem=row.problem,
        failed_roads=tuple(failed),
        activate=row.activate,
        created_at=row.created_at,
        started_at=row.started_at,
        finished_at=row.finished_at,
    )
