"""Asking for builds and watching them. `app.services.worker` does them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta

from sqlalchemy.engine import Connection, Engine

from app.errors import NotFound, NothingToBuild
from app.services.paging import after, bounded, sealed
from app.store import builds, drives, roads, versions
from app.store.columns import utc_now
from app.store.engine import read, write
from app.store.records import BuildState, BuildStatus, FailedRoad, Page

__all__ = [
    "BuildState",
    "BuildStatus",
    "FailedRoad",
    "dismiss_build",
    "get_build",
    "join_build",
    "list_builds",
    "request_build",
]

SETTLE_S = 0.5  # a build of posted surveys waits until no other one came for so long
LONGEST_SETTLE_S = 5.0  # but never longer than this: a steady stream must not starve the map


def request_build(
    engine: Engine, road_ids: Sequence[str] | None, *, activate: bool = True
) -> BuildState:
    """
    Enqueue a build of these roads; of all roads with surveys or in the active map when None.

    Raises:
        NotFound: One of the ids names no road.
        NothingToBuild: There is no road to build, and no drive waits for its roads to be found.
    """
    with write(engine) as connection:
        if road_ids is None:
            mapped = versions.model_ids(connection, versions.active_version(connection))
            road_ids = sorted({*roads.surveyed_roads(connection), *mapped})
        for missing in roads.missing_roads(connection, road_ids):
            raise NotFound("road", missing)
        if not road_ids and not drives.waiting_boxes(connection):
            raise NothingToBuild
        build_id = builds.insert_build(connection, activate=activate, due_at=utc_now())
        builds.add_roads(connection, build_id, list(dict.fromkeys(road_ids)))
        return _state(connection, build_id)


def join_build(connection: Connection, road_ids: Sequence[str]) -> str:
    """
    Add roads to the build that has not begun yet, or enqueue one; its id.

    Part of the caller's transaction: the survey and the build that takes it in are one write. A
    hundred surveys posted in a row make a handful of builds, not a hundred.
    """
    now = utc_now()
    settled_at = now + timedelta(seconds=SETTLE_S)
    waiting = builds.open_build(connection)
    if waiting is None:
        build_id = builds.insert_build(connection, activate=True, due_at=settled_at)
    else:
        build_id = waiting.build_id
        latest = waiting.created_at + timedelta(seconds=LONGEST_SETTLE_S)
        if waiting.due_at > now:
            builds.postpone(connection, build_id, min(settled_at, latest))
    builds.add_roads(connection, build_id, road_ids)
    return build_id


def get_build(engine: Engine, build_id: str) -> BuildState:
    """
    A build as it stands.

    Raises:
        NotFound: There is no such build.
    """
    with read(engine) as connection:
        return _state(connection, build_id)


def list_builds(engine: Engine, *, limit: int = 100, cursor: str | None = None) -> Page[BuildState]:
    """
    Builds, newest first.

    Raises:
        InvalidInput: ``limit`` or ``cursor`` is wrong.
    """
    with read(engine) as connection:
        page = builds.select_page(connection, limit=bounded(limit), before=after(cursor))
    return sealed(page)


def dismiss_build(engine: Engine, build_id: str) -> BuildState:
    """
    Call a build off; a finished one stays as it is.

    The worker stops at the next road, and nothing of the build enters a map. Surveys whose build is
    dismissed stay stored and are taken in by the next build of their road.

    Raises:
        NotFound: There is no such build.
    """
    with write(engine) as connection:
        builds.finish(connection, build_id, "dismissed")
        return _state(connection, build_id)


def _state(connection: Connection, build_id: str) -> BuildState:
    found = builds.select_build(connection, build_id)
    if found is None:
        raise NotFound("build", build_id)
    return found
