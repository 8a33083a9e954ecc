"""
Days on which cells were on the air, and what they say of roads that were not driven on them.

A survey hears the cells of its days. Cells that are gone count as silent on the roads that were
driven again; on the others, which nobody asked since, they count as silent on as many days.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from app.domain import RoadModel
from app.numerics.carriers import carrier_of, numbers
from app.numerics.observation import CORRELATION_M

EXPECTED_READINGS = 2.0  # independent ones that a day should have had before a cell is gone on it


@dataclass(frozen=True, slots=True, eq=False)
class Days:
    """
    The survey days of a map, all roads together; the last of them stands for no known date.

    What is of no known date may be of any day: such a cell was on the air on all of them, such a
    road listened on all of them. So is all that a model has which does not know its days.

    Attributes:
        number: Number of every cell of the map.
        on_air: Whether any road heard the cell. Shape ``(cells, days)``.
        missed: Whether a road that should have heard the cell listened to its carrier and did not,
            nor any other road. Same shape.
        listened: Of each road and each of its carriers, whether it heard any of the carrier's
            cells. Shape ``(days,)``.
    """

    number: dict[str, int]
    on_air: Bool[np.ndarray, "cells days"]
    missed: Bool[np.ndarray, "cells days"]
    listened: tuple[dict[str, Bool[np.ndarray, " days"]], ...]

    @classmethod
    def of(cls, models: Sequence[RoadModel]) -> Days:
        """From what each road heard on its days."""
        cells = sorted({cell for model in models for cell in model.cells})
        number = {cell: at for at, cell in enumerate(cells)}
        days = sorted({day for model in models for day in model.heard_on if day})
        on_air = np.zeros((len(cells), len(days) + 1), dtype=bool)
        missed, listened = np.zeros_like(on_air), []
        for model in models:
            own = np.array([number[cell] for cell in model.cells], dtype=np.intp)
            heard, carrier = _by_day(model, days), numbers(model.cells)
            heard[heard[:, -1]] = True
            on_air[own] |= heard
            to = np.stack([heard[carrier == each].any(axis=0) for each in range(carrier.max() + 1)])
            missed[own] |= (~heard & to[carrier]) & _expected(model)[:, None]
            names = dict.fromkeys(map(carrier_of, model.cells))
            listened.append(dict(zip(names, to, strict=True)))
        return cls(number, on_air, missed & ~on_air, tuple(listened))

    def tempered(self, road: int, model: RoadModel) -> RoadModel:
        """
        A road's model that has heard of the days on which its cells were gone elsewhere.

        Of a cell heard on ``n`` days of listening, gone on ``m`` others, ``n / (n + m)`` of the
        probability stays: as it would be, had the road been driven on those days, too.
        """
        own = [self.number[cell] for cell in model.cells]
        listened = np.stack([self.listened[road][carrier_of(cell)] for cell in model.cells])
        gone = (self.missed[own] & ~listened).sum(axis=1)
        if not gone.any():
            return model
        count = np.maximum(listened.sum(axis=1), 1)
        stays = (count / (count + gone)).astype(np.float32)
        mapped = ~np.isnan(model.mean_dbm)
        return replace(model, heard=np.where(mapped, model.heard * stays, model.heard))


def _by_day(model: RoadModel, days: Sequence[str]) -> Bool[np.ndarray, "cells days"]:
    """On which days the road heard each of its cells, those of no known date last."""
    undated = np.full(len(model.cells), not model.heard_on)
    nobody = np.zeros(len(model.cells), dtype=bool)
    dated = [model.heard_on.get(day, nobody) for day in days]
    return np.stack([*dated, model.heard_on.get("", undated)], axis=1)


def _expected(model: RoadModel) -> Bool[np.ndarray, " cells"]:
    """Whether a drive along the whole road hears the cell often enough to miss it."""
    usually = np.where(np.isnan(model.mean_dbm), 0.0, model.heard)
    return np.asarray(usually.sum(axis=0) * model.step_m >= EXPECTED_READINGS * CORRELATION_M)
