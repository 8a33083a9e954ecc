"""Which cells a model's survey days heard: written with the model, read with it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sqlalchemy as sa
from sqlalchemy.engine import Connection

from app.domain import RoadModel
from app.store.columns import B1, pack, unpack
from app.store.tables import model_days

HeardOn = Mapping[str, np.ndarray]


def day_rows(model_id: int, model: RoadModel) -> list[dict[str, object]]:
    """A row a day."""
    return [
        {"model_id": model_id, "day": day, "heard": pack(heard, B1)}
        for day, heard in model.heard_on.items()
    ]


def select_days(
    connection: Connection, models: sa.Select[tuple[int]]
) -> dict[int, dict[str, np.ndarray]]:
    """
    What `app.domain.RoadModel.heard_on` is of each model; those without days are left out.

    Args:
        models: Selects numbers of models.
    """
    rows = connection.execute(
        sa.select(model_days)
        .where(model_days.c.model_id.in_(models))
        .order_by(model_days.c.model_id, model_days.c.day)
    )
    found: dict[int, dict[str, np.ndarray]] = {}
    for row in rows:
        found.setdefault(row.model_id, {})[row.day] = unpack(row.heard, B1, -1)
    return found
