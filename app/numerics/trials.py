"""
Held-out windows asked for in a whole map: on their own road as its curves without them have it, on
all others as the map has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.domain import Calibration, RoadModel, Window
from app.numerics import native
from app.numerics.answer import fit_of_place
from app.numerics.evidence_table import HeldOut
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.matching import fine_places, shortlist
from app.numerics.observation import evidence
from app.numerics.offmap import Fit
from app.numerics.offsets import OffsetPrior, take_offsets
from app.numerics.posterior import APART, RESIDUAL, SCORE, VALUES, WEIGHT, Places
from app.numerics.query import FINE_STEP_M, Query, ask
from app.numerics.unseen import HOPELESS, Asked


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """
    One window's answer, not divided by its temperature yet.

    Attributes:
        road: Number of its true road.
        places: Of the whole map, its own road's first, under the map's calibration.
        weight: What its samples weigh together; ``samples`` is how many they are.
        fit: How well it fits where it fits best, None where the map knows none of its cells.
        stranger_fit: The same in the map without its road.
        prior: What the device's offset may be, for this window.
    """

    road: int
    truth: HeldOut
    places: Places
    weight: float
    samples: int
    fit: Fit | None
    stranger_fit: Fit | None
    prior: OffsetPrior

    def information(self, calibration: Calibration) -> float:
        """How many independent samples the window is worth."""
        return calibration.information(self.weight, self.samples)


def ask_all(index: MapIndex, models: Sequence[RoadModel], asked: Sequence[Asked]) -> list[Trial]:
    """Every window in the map; a map of one road has no other roads to offer."""
    return [_ask(index, models[one.road], one) for one in asked]


def with_offset(places: Places, prior: OffsetPrior) -> Places:
    """Places whose scores hold what the offsets may explain, for a window of the prior's."""
    taken = take_offsets(places.values[RESIDUAL:], prior)
    values = np.empty((VALUES, len(places)))
    values[:RESIDUAL] = places.values[:RESIDUAL]
    values[SCORE] += taken.gain
    values[RESIDUAL], values[WEIGHT], values[APART] = taken.residual, taken.weight, taken.apart
    return Places(places.where, values)


def size_of(truth: HeldOut) -> tuple[float, int]:
    """What a window's samples weigh together, and how many they are."""
    silent, nobody = np.zeros((len(truth.distance_m), 0)), np.zeros(0, dtype=np.intp)
    weight = evidence(truth.distance_m, silent, FINE_STEP_M, nobody).weight
    return float(weight.sum()), len(weight)


def _ask(index: MapIndex, model: RoadModel, one: Asked) -> Trial:
    number, truth = one.road, one.truth
    names = tuple(model.cells[column] for column in truth.cells.tolist())
    query = ask(index, Window(names, truth.distance_m, truth.rsrp_dbm), in_c=native.BUILT)
    places = own = with_offset(one.at(query.temperature(index.calibration)), query.prior(index))
    if len(index.roads) > 1:
        others = fine_places(index, query, shortlist(index, query, without=number))
        places = Places.join((own, others))
        stranger_fit = _best_fit(index, query, others)
    else:
        stranger_fit = _exchanged_fit(index, names, truth)
    kept = places.score >= places.score.max() - HOPELESS
    return Trial(
        number,
        truth,
        places.take(kept),
        query.weight,
        len(query.fine.weight),
        _best_fit(index, query, places, one.own),
        stranger_fit,
        query.prior(index),
    )


def _exchanged_fit(index: MapIndex, names: tuple[str, ...], truth: HeldOut) -> Fit | None:
    """Of the window with its cells exchanged, as in a town where the names stand for others."""
    turned = Window((*names[1:], names[0]), truth.distance_m, truth.rsrp_dbm)
    query = ask(index, turned, in_c=native.BUILT)
    return _best_fit(index, query, fine_places(index, query, shortlist(index, query)))


def _best_fit(
    index: MapIndex, query: Query, places: Places, own: RoadIndex | None = None
) -> Fit | None:
    return fit_of_place(index, query, places, int(places.score.argmax()), own=own)
