"""
Survey passes against maps that have not seen their day: what docs/algorithms/observation-model.md
measures. The test passes of a data set are never read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from app.domain import Road, RoadModel, Trace
from app.evaluation.dataset import read_index, read_roads, stream_passes
from app.formats.account import Account
from app.numerics.hearing import heard_probability
from app.numerics.passes import RoadPass, all_cells, lay_on_road
from app.numerics.roadfit import fit_road

FOLDS = 4
NEAR_M = 10  # a pass heard a cell at a place if it did within so many metres of it


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """A survey pass; those of one ``session`` were driven in a row, ``fold`` is its day's."""

    trace: Trace
    road_id: str
    session: str
    day: str
    fold: int


@dataclass(frozen=True, slots=True, eq=False)
class Laid:
    """
    A pass on its road, one row a metre at most, beside what a map without its day says there.

    Attributes:
        cells: Names of the columns: all cells that the other days have a curve of.
        chainage_m: Shape ``(rows,)``.
        residual_db: Reading less expected level, shape ``(rows, cells)``; NaN where the cell is
            not heard or has no curve at the place.
        level_dbm, spread_db: As the map has them, same shape.
        heard: Whether the row heard the cell.
        share: Of the other days' samples about the place that heard the cell, as the kernel
            estimates it; ``served`` is what the map makes of it for a new pass.
        alike, opposite: How many of the map's passes heard the cell within `NEAR_M`, driven in this
            pass's direction and against it.
        by: How many of the map's passes drove by, shape ``(rows,)``.
    """

    driven: Driven
    sign: int
    cells: tuple[str, ...]
    chainage_m: Float[np.ndarray, " rows"]
    residual_db: Float[np.ndarray, "rows cells"]
    level_dbm: Float[np.ndarray, "rows cells"]
    spread_db: Float[np.ndarray, "rows cells"]
    heard: Float[np.ndarray, "rows cells"]
    share: Float[np.ndarray, "rows cells"]
    served: Float[np.ndarray, "rows cells"]
    alike: Int[np.ndarray, "rows cells"]
    opposite: Int[np.ndarray, "rows cells"]
    by: Int[np.ndarray, " rows"]

    @property
    def z(self) -> Float[np.ndarray, "rows cells"]:
        """Residuals in units of the spread that the map said."""
        return self.residual_db / self.spread_db

    @property
    def passes(self) -> Int[np.ndarray, "rows cells"]:
        """How many of the map's passes heard the cell there."""
        return self.alike + self.opposite


def load(folder: Path) -> tuple[dict[str, Road], list[Driven]]:
    """The roads, and the survey's passes in folds of whole days."""
    index = read_index(folder)
    survey = [
        (each, index[each.pass_id])
        for each in stream_passes(folder, Account())
        if each.pass_id in index and index[each.pass_id].role == "survey"
    ]
    days = sorted({str(each.trace.recorded_at)[:10] for each, _ in survey})
    driven = []
    for each, entry in survey:
        day = str(each.trace.recorded_at)[:10]
        trace = replace(each.trace, road_id=entry.road_id)
        driven.append(Driven(trace, entry.road_id, entry.session, day, days.index(day) % FOLDS))
    return {road.road_id: road for road in read_roads(folder)}, driven


def others(driven: Sequence[Driven], road_id: str, fold: int) -> list[Trace]:
    """Passes of the road on the days of all other folds."""
    return [one.trace for one in driven if one.road_id == road_id and one.fold != fold]


def fit_folds(roads: dict[str, Road], driven: Sequence[Driven]) -> list[dict[str, RoadModel]]:
    """Of each fold, the map of all other days."""
    return [
        {
            road_id: fit_road(road, passes)
            for road_id, road in roads.items()
            if (passes := others(driven, road_id, fold))
        }
        for fold in range(FOLDS)
    ]


def lay_held_out(driven: Sequence[Driven], maps: Sequence[dict[str, RoadModel]]) -> list[Laid]:
    """Every pass beside the map that has not seen its day."""
    return [
        laid
        for fold, models in enumerate(maps)
        for road_id, model in models.items()
        for laid in _on_road(
            model,
            others(driven, road_id, fold),
            [one for one in driven if one.road_id == road_id and one.fold == fold],
        )
    ]


def heard_near(
    model: RoadModel, passes: Sequence[RoadPass]
) -> tuple[Int[np.ndarray, "3 grid cells"], Int[np.ndarray, " grid"]]:
    """Passes that heard each cell within `NEAR_M`, forward in row 1, backward in -1; all by."""
    size, count = model.mean_dbm.shape
    heard, by = np.zeros((3, size, count), dtype=int), np.zeros(size, dtype=int)
    for one in passes:
        row = _rows(one, size)
        by[row.min() : row.max() + 1] += 1
        there, column = np.nonzero(one.heard > 0.0)
        near = np.zeros((size, count), dtype=int)
        for away in range(-NEAR_M, NEAR_M + 1):
            near[np.clip(row[there] + away, 0, size - 1), column] = 1
        heard[one.sign] += near
    return heard, by


def lay_all(model: RoadModel, traces: Sequence[Trace]) -> list[RoadPass]:
    """Traces as passes with the model's cells as columns."""
    return [one for trace in traces if (one := _lay(model, trace)) is not None]


def _on_road(model: RoadModel, mapped: Sequence[Trace], held: Sequence[Driven]) -> Iterator[Laid]:
    size = len(model.mean_dbm)
    passes = lay_all(model, mapped)
    alike, by = heard_near(model, passes)
    share = heard_probability(
        np.concatenate([one.chainage_m for one in passes]),
        np.concatenate([one.heard for one in passes]),
        size,
        model.step_m,
        np.zeros(len(model.cells), dtype=np.intp),  # of all samples, whatever they listened to
    )
    for each in held:
        one = _lay(model, each.trace)
        if one is not None:
            at = _rows(one, size)
            yield Laid(
                driven=each,
                sign=one.sign,
                cells=model.cells,
                chainage_m=one.chainage_m,
                residual_db=one.rsrp_dbm - model.mean_dbm[at],
                level_dbm=model.mean_dbm[at].astype(float),
                spread_db=model.spread_db[at].astype(float),
                heard=one.heard,
                share=share[at],
                served=model.heard[at].astype(float),
                alike=alike[one.sign][at],
                opposite=alike[-one.sign][at],
                by=by[at],
            )


def _rows(one: RoadPass, size: int) -> Int[np.ndarray, " rows"]:
    return np.clip(np.rint(one.chainage_m).astype(int), 0, size - 1)


def _lay(model: RoadModel, trace: Trace) -> RoadPass | None:
    """The pass with the model's cells as columns; the grid's step is a metre."""
    known = [i for i, cell in enumerate(trace.cells) if cell in set(model.cells)]
    cells = tuple(trace.cells[i] for i in known)
    kept = replace(trace, cells=cells, rsrp_dbm=trace.rsrp_dbm[:, known])
    return lay_on_road(model.line, kept, model.cells, "one")


def lay_each(
    roads: dict[str, Road], driven: Sequence[Driven]
) -> dict[str, list[tuple[Driven, RoadPass]]]:
    """All passes of every road with the same columns, without any map."""
    laid = {}
    for road_id, road in roads.items():
        mine = [one for one in driven if one.road_id == road_id]
        cells = all_cells([one.trace for one in mine])
        pairs = [
            (one, lay_on_road(road.line, one.trace, cells, "one")) for one in mine if road.line
        ]
        laid[road_id] = [(one, there) for one, there in pairs if there is not None]
    return laid
