"""Loose drives: surveys that name no road. Their passes are found, and found anew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sqlalchemy as sa
from jaxtyping import Float
from sqlalchemy.engine import Connection

from app.store.bounds import overlap
from app.store.columns import F8, unpack
from app.store.records import Bounds, Placing
from app.store.roads import set_found_line
from app.store.surveys import PassRange, insert_passes
from app.store.tables import passes, roads, surveys

LOOSE = surveys.c.placing.in_(["waiting", "found"])
AT_ONCE = 500  # ids in one query


@dataclass(frozen=True, slots=True, eq=False)
class LooseDrive:
    """Positions of a loose drive, and the passes that are known of it."""

    survey_id: str
    placing: Placing
    time_s: Float[np.ndarray, " samples"]
    lon: Float[np.ndarray, " samples"]
    lat: Float[np.ndarray, " samples"]
    along: tuple[PassRange, ...]


def waiting_boxes(connection: Connection) -> dict[str, Bounds]:
    """The boxes of all drives whose roads are to be found, by survey id."""
    rows = connection.execute(
        sa.select(
            surveys.c.survey_id, surveys.c.west, surveys.c.south, surveys.c.east, surveys.c.north
        )
        .where(surveys.c.placing == "waiting")
        .order_by(surveys.c.survey_id)
    )
    return {row.survey_id: Bounds(row.west, row.south, row.east, row.north) for row in rows}


def boxes_of(connection: Connection, survey_ids: Iterable[str]) -> list[Bounds]:
    """The boxes of these drives."""
    columns = (surveys.c.west, surveys.c.south, surveys.c.east, surveys.c.north)
    return [
        Bounds(row.west, row.south, row.east, row.north)
        for some in _batches(sorted(set(survey_ids)))
        for row in connection.execute(
            sa.select(*columns).where(LOOSE, surveys.c.survey_id.in_(some))
        )
    ]


def loose_in(connection: Connection, box: Bounds) -> set[str]:
    """Ids of loose drives whose box touches ``box``."""
    edges = (surveys.c.west, surveys.c.south, surveys.c.east, surveys.c.north)
    return set(
        connection.scalars(sa.select(surveys.c.survey_id).where(LOOSE, overlap(box, *edges)))
    )


def loose_along(connection: Connection, road_ids: Iterable[str]) -> set[str]:
    """Ids of loose drives with a pass along one of these roads."""
    query = sa.select(surveys.c.survey_id).join(passes, passes.c.survey_id == surveys.c.survey_id)
    found: set[str] = set()
    for some in _batches(sorted(set(road_ids))):
        found |= set(connection.scalars(query.where(LOOSE, passes.c.road_id.in_(some))))
    return found


def select_drives(connection: Connection, survey_ids: Iterable[str]) -> list[LooseDrive]:
    """These drives in the order of their arrival."""
    wanted = sorted(set(survey_ids))
    along: dict[str, list[PassRange]] = {survey_id: [] for survey_id in wanted}
    drives: list[sa.Row[Any]] = []
    for some in _batches(wanted):
        for row in connection.execute(
            sa.select(passes).where(passes.c.survey_id.in_(some)).order_by(passes.c.position)
        ):
            piece = PassRange(row.road_id, row.first_sample, row.end_sample)
            along[row.survey_id].append(piece)
        columns = ("survey_id", "placing", "time_s", "lon", "lat")
        drives += connection.execute(
            sa.select(*(surveys.c[name] for name in columns))
            .where(surveys.c.survey_id.in_(some))
            .order_by(surveys.c.survey_id)
        ).all()
    return [
        LooseDrive(
            row.survey_id,
            row.placing,
            unpack(row.time_s, F8),
            unpack(row.lon, F8),
            unpack(row.lat, F8),
            tuple(along[row.survey_id]),
        )
        for row in drives
    ]


def place(connection: Connection, along: Mapping[str, Sequence[PassRange]]) -> None:
    """Give drives the passes that were found, in place of those known before."""
    for survey_id, pieces in along.items():
        connection.execute(passes.delete().where(passes.c.survey_id == survey_id))
        insert_passes(connection, survey_id, pieces)


def mark(connection: Connection, survey_ids: Iterable[str], placing: Placing) -> None:
    """Say how far the finding of these loose drives' roads is."""
    for some in _batches(sorted(set(survey_ids))):
        connection.execute(
            surveys.update().where(LOOSE, surveys.c.survey_id.in_(some)).values(placing=placing)
        )


def find_again(connection: Connection, road_ids: Sequence[str]) -> None:
    """Let the drives along found roads wait, and forget the line of one that has none left."""
    made = found_among(connection, road_ids)
    for road_id in made:
        left = loose_along(connection, [road_id])
        mark(connection, left, "waiting")
        if not left:
            set_found_line(connection, road_id, None)


def found_among(connection: Connection, road_ids: Iterable[str]) -> set[str]:
    """Which of these roads the drives made."""
    some = sorted(set(road_ids))
    query = sa.select(roads.c.road_id).where(roads.c.found, roads.c.road_id.in_(some))
    return set(connection.scalars(query))


def _batches(ids: Sequence[str]) -> list[Sequence[str]]:
    return [ids[first : first + AT_ONCE] for first in range(0, len(ids), AT_ONCE)]
