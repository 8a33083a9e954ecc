"""Reference points: mean RSRP at even places along every road, as fingerprinting methods see it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from app.domain import Window
from app.evaluation.methods.base import Survey
from app.numerics.geodesy import Floats, LocalFrame
from app.numerics.lines import length_m, point_at, project

CENTRE_DBM = -95.0  # RSRP is held relative to it, so that float32 products keep their digits
BRIDGED = 4  # a reference point without samples is drawn between neighbours this many steps apart
FEWEST_READINGS = 30  # in the whole survey; rarer cells cost time and say nothing
FLOOR_QUANTILE = 0.01  # a cell not heard counts as heard this faintly


@dataclass(frozen=True, slots=True, eq=False)
class References:
    """
    Reference points, road after road, chainage growing.

    Attributes:
        start: Number of each road's first point, and the count of all at the end.
        rsrp_dbm: NaN where the cell was not heard. Shape ``(points, cells)``.
        floor_dbm: What stands for "not heard" where a method needs a number.
    """

    road_ids: tuple[str, ...]
    cells: tuple[str, ...]
    grid_m: float
    start: Int[np.ndarray, " roads_and_end"]
    road: Int[np.ndarray, " points"]
    chainage_m: Float[np.ndarray, " points"]
    x_m: Float[np.ndarray, " points"]
    y_m: Float[np.ndarray, " points"]
    rsrp_dbm: Float[np.ndarray, "points cells"]
    floor_dbm: float
    frame: LocalFrame

    def filled_db(self) -> Float[np.ndarray, "points cells"]:
        """Levels about `CENTRE_DBM`, not heard as the floor."""
        return np.where(np.isnan(self.rsrp_dbm), self.floor_dbm, self.rsrp_dbm) - CENTRE_DBM

    def columns(self, window: Window) -> Float[np.ndarray, "samples cells"]:
        """The window's readings in the columns of the reference points; NaN = not heard."""
        column = {cell: i for i, cell in enumerate(self.cells)}
        known = [(column[cell], i) for i, cell in enumerate(window.cells) if cell in column]
        out = np.full((len(window.distance_m), len(self.cells)), np.nan)
        out[:, [to for to, _ in known]] = window.rsrp_dbm[:, [i for _, i in known]]
        return out


@lru_cache(maxsize=4)
def lay_references(survey: Survey) -> References:
    """
    Average the passes of each road about points ``grid_m`` apart.

    Remembers the last surveys: every rival asks for the same points, some for many parameters.
    """
    cells = _common_cells(survey)
    lines = [survey.line(road.road_id) for road in survey.roads]
    frame = LocalFrame(float(lines[0].lon[0]), float(lines[0].lat[0]))
    blocks, sizes, chainages, eastings, northings = [], [], [], [], []
    for road, line in zip(survey.roads, lines, strict=True):
        chainage_m = np.arange(int(length_m(line) / survey.grid_m + 1e-6) + 1) * survey.grid_m
        blocks.append(_levels(survey, road.road_id, cells, len(chainage_m)))
        place = point_at(line, chainage_m)
        plane = frame.to_xy(place.lon, place.lat)
        sizes.append(len(chainage_m))
        chainages.append(chainage_m)
        eastings.append(plane.x_m)
        northings.append(plane.y_m)
    heard = np.concatenate([trace.rsrp_dbm.ravel() for trace in survey.traces])
    return References(
        road_ids=tuple(road.road_id for road in survey.roads),
        cells=cells,
        grid_m=survey.grid_m,
        start=np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp),
        road=np.repeat(np.arange(len(sizes)), sizes),
        chainage_m=np.concatenate(chainages),
        x_m=np.concatenate(eastings),
        y_m=np.concatenate(northings),
        rsrp_dbm=np.concatenate(blocks),
        floor_dbm=float(np.quantile(heard[~np.isnan(heard)], FLOOR_QUANTILE)),
        frame=frame,
    )


def _common_cells(survey: Survey) -> tuple[str, ...]:
    """Cells with enough readings to be of use, sorted; all of them where none has as many."""
    readings: Counter[str] = Counter()
    for trace in survey.traces:
        readings.update(
            dict(zip(trace.cells, (~np.isnan(trace.rsrp_dbm)).sum(axis=0).tolist(), strict=True))
        )
    common = [cell for cell, count in readings.items() if count >= FEWEST_READINGS]
    return tuple(sorted(common or readings))


def _levels(
    survey: Survey, road_id: str, cells: tuple[str, ...], points: int
) -> Float[np.ndarray, "points cells"]:
    """Mean level of each point's samples; between points with samples straight lines."""
    column = {cell: i for i, cell in enumerate(cells)}
    total, heard = np.zeros((points, len(cells))), np.zeros((points, len(cells)))
    samples = np.zeros(points)
    line = survey.line(road_id)
    for trace in survey.traces:
        if trace.road_id != road_id:
            continue
        at = np.rint(project(line, trace.lon, trace.lat).chainage_m / survey.grid_m).astype(int)
        at = np.minimum(at, points - 1)
        known = ~np.isnan(trace.rsrp_dbm)
        own = [i for i, cell in enumerate(trace.cells) if cell in column]
        into = (at[:, None], np.array([column[trace.cells[i]] for i in own], dtype=int)[None, :])
        np.add.at(total, into, np.where(known, trace.rsrp_dbm, 0.0)[:, own])
        np.add.at(heard, into, known[:, own])
        np.add.at(samples, at, 1.0)
    with np.errstate(invalid="ignore"):
        mean = np.where(heard * 2 >= samples[:, None], total / heard, np.nan)
    return _bridged(mean, samples > 0)


def _bridged(mean: Floats, sampled: np.ndarray) -> Floats:
    """Fill the points that no sample fell on from those beside them."""
    have = np.flatnonzero(sampled)
    if len(have) in {0, len(sampled)}:
        return mean
    empty = np.flatnonzero(~sampled)
    after = np.searchsorted(have, empty)
    left, right = have[np.maximum(after - 1, 0)], have[np.minimum(after, len(have) - 1)]
    span = np.maximum(right - left, 1)
    share = np.clip((empty - left) / span, 0.0, 1.0)[:, None]
    value = (1.0 - share) * mean[left] + share * mean[right]
    near = np.minimum(np.abs(empty - left), np.abs(right - empty)) <= BRIDGED
    out = mean.copy()
    out[empty] = np.where(near[:, None], value, np.nan)
    return out


def recent_mean_dbm(
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    distance_m: Float[np.ndarray, " samples"],
    reach_m: float,
) -> Float[np.ndarray, "samples cells"]:
    """Mean of the readings of the last ``reach_m`` before each sample; NaN where none heard."""
    if reach_m <= 0:
        return rsrp_dbm
    first = np.searchsorted(distance_m, distance_m - reach_m - 1e-9)
    known = ~np.isnan(rsrp_dbm)
    zero = np.zeros((1, rsrp_dbm.shape[1]))
    total = np.concatenate([zero, np.cumsum(np.where(known, rsrp_dbm, 0.0), axis=0)])
    count = np.concatenate([zero, np.cumsum(known, axis=0)])
    many = count[1:] - count[first]
    with np.errstate(invalid="ignore"):
        return np.where(many > 0, (total[1:] - total[first]) / many, np.nan)
