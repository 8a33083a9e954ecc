"""
The first step of a build: find the roads of drives that name none.

Drives wait in the store from the moment they are accepted. A build takes them a neighbourhood at a
time: read, find, write, where the write is one transaction that also puts the touched roads on the
build's list. Whoever is killed in between has written nothing, and whoever comes second finds no
drive that waits.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy.engine import Connection, Engine
from sqlalchemy.exc import SQLAlchemyError

from app.numerics.network.nouns import Driven, Findings, KnownRoad, RoadStretch
from app.store import builds, drives, roads
from app.store.bounds import touches, union, widened
from app.store.columns import new_id
from app.store.drives import LooseDrive
from app.store.engine import read, write
from app.store.records import Bounds
from app.store.surveys import PassRange

log = logging.getLogger(__name__)

FindRoads = Callable[[Sequence[Driven], Sequence[KnownRoad], Iterator[str]], Findings]

NEAR_DEG = 0.006  # some 650 m: farther from a new drive nothing it says moves a road
OPTIMISTIC_TRIES = 3  # at finding without the write lock while drives and roads come in


@dataclass(frozen=True, slots=True)
class Neighbourhood:
    """
    New drives and all that they may touch.

    Attributes:
        drives: The new ones, those near them, and those along the roads near them.
        known: Every road near one of the drives.
        seen: What the finding rests on; when it has changed the finding is stale.
    """

    drives: tuple[LooseDrive, ...]
    known: tuple[KnownRoad, ...]
    seen: tuple[object, ...]


def place_drives(engine: Engine, find: FindRoads, build_id: str) -> int:
    """
    Find the roads of every drive that waits; how many roads the build has then, 0 when it is over.

    A neighbourhood whose finding breaks is tried again drive by drive, so that one drive cannot
    keep the others out; the one that breaks it again is marked lost.
    """
    with read(engine) as connection:
        waiting = drives.waiting_boxes(connection)
    for group in groups_of(waiting):
        try:
            _place(engine, find, build_id, group)
        except SQLAlchemyError:
            raise  # the store's trouble is not the drives': the job tries again
        except Exception:
            log.exception("finding the roads of %d drives broke; one by one then", len(group))
            _place_singly(engine, find, build_id, group)
    with read(engine) as connection:
        if builds.select_status(connection, build_id) != "running":
            return 0
        return len(builds.select_roads(connection, build_id))


def end_without_roads(engine: Engine, build_id: str) -> None:
    """End a build that has no road to build."""
    problem = {
        "type": "urn:roadprint:problem:no-road-found",
        "title": "No road was found",
        "detail": "the drives run along no road: they stand, or move less than 60 m in a line",
        "code": "no-road-found",
    }
    with write(engine) as connection:
        if not builds.select_roads(connection, build_id):
            builds.finish(connection, build_id, "failed", problem=problem)


def groups_of(boxes: Mapping[str, Bounds]) -> list[frozenset[str]]:
    """Drives whose neighbourhoods touch belong together; the groups in the order of arrival."""
    groups: list[tuple[Bounds, set[str]]] = []
    for survey_id, box in boxes.items():
        area, members = widened(box, NEAR_DEG), {survey_id}
        apart = []
        for other, others in groups:
            if touches(area, other):
                area, members = union(area, other), members | others
            else:
                apart.append((other, others))
        groups = [*apart, (area, members)]
    return sorted((frozenset(members) for _, members in groups), key=min)


def _place_singly(engine: Engine, find: FindRoads, build_id: str, group: frozenset[str]) -> None:
    for survey_id in sorted(group):
        try:
            _place(engine, find, build_id, frozenset([survey_id]))
        except SQLAlchemyError:
            raise
        except Exception:
            log.exception("the roads of drive %s cannot be found", survey_id)
            with write(engine) as connection:
                drives.mark(connection, [survey_id], "lost")


def _place(engine: Engine, find: FindRoads, build_id: str, group: frozenset[str]) -> None:
    for attempt in range(OPTIMISTIC_TRIES + 1):
        with read(engine) as connection:
            around = _gather(connection, group)
        if around is None:
            return
        found = _find(find, around, group)
        with write(engine) as connection:
            if builds.select_status(connection, build_id) != "running":
                return
            now = _gather(connection, group)
            if now is None:
                return
            if now.seen != around.seen:
                if attempt < OPTIMISTIC_TRIES:
                    continue  # drives or roads came in meanwhile: find with those
                around, found = now, _find(find, now, group)
            builds.add_roads(connection, build_id, _apply(connection, around, found, group))
            return


def _gather(connection: Connection, group: frozenset[str]) -> Neighbourhood | None:
    boxes = [box for one, box in drives.waiting_boxes(connection).items() if one in group]
    if not boxes:
        return None
    area = _union(boxes)
    near = {road.road_id for road in roads.roads_near(connection, area) if road.found}
    ids = drives.loose_in(connection, area) | drives.loose_along(connection, near)
    members = [
        one
        for one in drives.select_drives(connection, ids)
        if one.placing == "found" or one.survey_id in group
    ]
    wide = _union([area, *drives.boxes_of(connection, ids)])
    along = {piece.road_id for one in members if one.placing == "found" for piece in one.along}
    known = roads.roads_near(connection, wide)
    seen = (
        tuple((one.survey_id, one.placing) for one in members),
        tuple((road.road_id, road.found, road.line.lon.tobytes()) for road in known),
    )
    return Neighbourhood(
        tuple(members),
        tuple(
            KnownRoad(
                road.road_id,
                road.line,
                given=not road.found,
                sure=road.road_id in along,
                raw=road.raw,
            )
            for road in known
        ),
        seen,
    )


def _find(find: FindRoads, around: Neighbourhood, group: frozenset[str]) -> Findings:
    driven = [
        Driven(one.survey_id, one.lon, one.lat, one.time_s, new=one.survey_id in group)
        for one in around.drives
    ]
    return find(driven, around.known, iter(_new_road_id, ""))


def _apply(
    connection: Connection, around: Neighbourhood, found: Findings, group: frozenset[str]
) -> list[str]:
    """Write what was found; the roads that have to be built, sorted."""
    touched = set(found.lines) | found.gone
    for road_id, line in found.lines.items():
        roads.set_found_line(connection, road_id, line)
    changed: dict[str, Sequence[PassRange]] = {}
    for one in around.drives:
        along = tuple(_range_of(each) for each in found.passes.get(one.survey_id, ()))
        if along != one.along:
            touched |= {piece.road_id for piece in (*set(along) ^ set(one.along),)}
            changed[one.survey_id] = along
        elif one.survey_id in group:
            touched |= {piece.road_id for piece in along}
    drives.place(connection, changed)
    drives.mark(connection, group, "found")
    for road_id in found.gone:
        roads.set_found_line(connection, road_id, None)
    return sorted(touched)


def _range_of(each: RoadStretch) -> PassRange:
    return PassRange(each.road_id, each.first_sample, each.end_sample)


def _union(boxes: Sequence[Bounds]) -> Bounds:
    area = widened(boxes[0], NEAR_DEG)
    for box in boxes[1:]:
        area = union(area, widened(box, NEAR_DEG))
    return area


def _new_road_id() -> str:
    return f"road-{new_id()}"
