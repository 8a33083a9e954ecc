"""What is known about a place: whether any road or survey is near it."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from app.store.bounds import overlap
from app.store.records import Bounds
from app.store.tables import roads, surveys


def anything_in(connection: Connection, box: Bounds) -> str | None:
    """A road or survey, in words, whose box touches ``box``; None when there is none."""
    for noun, table, name in (("road", roads, roads.c.road_id),
                              ("survey", surveys, surveys.c.survey_id)):  # fmt: skip
        edges = (table.c.west, table.c.south, table.c.east, table.c.north)
        found = connection.scalar(sa.select(name).where(overlap(box, *edges)).limit(1))
        if found is not None:
            return f"{noun} {found}"
    return None
