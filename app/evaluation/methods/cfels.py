"""
`cf-els`: a fitted RSRP-to-distance curve per cell and sub-area, then exhaustive location search.

Source: B. Wang, S. Zhou, W. Liu, Y. Mo, "Indoor localization based on curve fitting and location
search using received signal strength", IEEE Transactions on Industrial Electronics 62(1), 2015. A
polynomial turns the RSRP of each cell into a distance to it, one polynomial a sub-area. Among all
places in steps of 0.1 m the answer is the one whose true distances to the cells differ least from
those, in the sum of squares.

What the sources leave open: sub-areas are stretches of road of ``area_m`` (50, 100, 200, the whole
road), the polynomial's degree is 1 to 3, and readings are averaged over the last ``average_m`` (0,
10) of the window. A heard cell that a sub-area has no polynomial for (the source hears all cells
everywhere) is wrong by ``missing_m`` (100, 500). All are chosen on held-out survey windows. Places
are searched along the roads.
Where cells stand is given to the method when it is known (the simulation); else it is taken as the
mean place of the strongest twentieth of the cell's survey readings. Direction is not told.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Float32, Int

from app.domain import Window
from app.evaluation.methods.base import Estimate, Previous, Survey
from app.evaluation.methods.references import (
    CENTRE_DBM,
    References,
    lay_references,
    recent_mean_dbm,
)
from app.evaluation.methods.tuning import choose
from app.numerics.geodesy import XY, Floats

name = "cf-els"

STEP_M = 0.1
TUNING_STEP_M = 1.0  # a tenth of the places is enough to tell parameters apart
SCALE_DB = 20.0  # readings over this keep the polynomials well conditioned
STRONGEST = 0.05
FEWEST = 6  # points that a polynomial needs


@dataclass(frozen=True, slots=True)
class Parameters:
    """What is chosen on the survey."""

    area_m: float
    degree: int
    average_m: float
    missing_m: float = 100.0


CHOICES = tuple(
    Parameters(*each)
    for each in product((50.0, 100.0, 200.0, np.inf), (1, 2, 3), (0.0, 10.0), (100.0, 500.0))
)


def fit(survey: Survey, seed: int) -> CurveSearch:
    """Fit the curves, choose the parameters and lay out the places."""
    drawn: dict[tuple[int, float, int], Atlas] = {}

    def trial(train: Survey, each: Parameters) -> CurveSearch:
        key = (id(train), each.area_m, each.degree)
        if key not in drawn:
            drawn[key] = draw_atlas(train, each, TUNING_STEP_M)
        return CurveSearch(drawn[key], each)

    best = choose(CHOICES, trial, survey, seed)
    return CurveSearch(draw_atlas(survey, best, STEP_M), best)


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """
    A sub-area: its cells' polynomials, and its places.

    Attributes:
        cells: Columns of the cells that have a polynomial here.
        curves: Coefficients, constant first. Shape ``(cells, degree + 1)``.
        away_m: Distance of each place to each cell. Shape ``(cells, places)``.
    """

    road: int
    cells: Int[np.ndarray, " cells"]
    curves: Float[np.ndarray, "cells coefficients"]
    chainage_m: Float[np.ndarray, " places"]
    x_m: Float[np.ndarray, " places"]
    y_m: Float[np.ndarray, " places"]
    away_m: Float32[np.ndarray, "cells places"]


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """All sub-areas."""

    points: References
    areas: tuple[Area, ...]


class CurveSearch:
    """The search over all places of all sub-areas."""

    def __init__(self, atlas: Atlas, parameters: Parameters) -> None:
        self.parameters = parameters
        self._atlas = atlas

    def locate(self, window: Window, previous: Previous | None) -> Estimate:
        """The place of least squared distance error."""
        del previous
        points = self._atlas.points
        columns = points.columns(window)
        mean = recent_mean_dbm(columns, window.distance_m, self.parameters.average_m)[-1]
        level = (mean - CENTRE_DBM) / SCALE_DB
        heard = int((~np.isnan(level)).sum())
        best, place, least = self._atlas.areas[0], 0, np.inf
        for area in self._atlas.areas:
            error = _squared_error_m2(area, level, heard, self.parameters.missing_m)
            if error is not None:
                at = int(error.argmin())
                if error[at] < least:
                    best, place, least = area, at, float(error[at])
        where = points.frame.to_lonlat(best.x_m[place], best.y_m[place])
        road_id, chainage_m = points.road_ids[best.road], float(best.chainage_m[place])
        return Estimate(road_id, chainage_m, float(where.lon), float(where.lat))


def _squared_error_m2(
    area: Area, level: Floats, heard: int, missing_m: float
) -> Float32[np.ndarray, " places"] | None:
    """Sum over the heard cells of the squared distance error; None where none can be judged."""
    here = np.flatnonzero(~np.isnan(level[area.cells]))
    if not len(here):
        return None
    powers = level[area.cells[here]][:, None] ** np.arange(area.curves.shape[1])
    wanted = (area.curves[here] * powers).sum(axis=1).astype(np.float32)
    missing_m2 = (heard - len(here)) * missing_m**2
    error = np.full(area.away_m.shape[1], missing_m2, dtype=np.float32)
    for row, distance_m in zip(here.tolist(), wanted, strict=True):
        difference = area.away_m[row] - distance_m
        error += difference * difference
    return error


def draw_atlas(survey: Survey, parameters: Parameters, step_m: float) -> Atlas:
    """The offline part: sub-areas, polynomials, places every ``step_m``."""
    points = lay_references(survey)
    sites = _sites(points, survey)
    areas: list[Area] = []
    for road in range(len(points.road_ids)):
        first, end = int(points.start[road]), int(points.start[road + 1])
        way_m = float(points.chainage_m[end - 1]) + points.grid_m
        parts = max(1, round(way_m / min(parameters.area_m, way_m)))
        for part in range(parts):
            low_m, high_m = part / parts * way_m, (part + 1) / parts * way_m
            bounds = np.searchsorted(points.chainage_m[first:end], [low_m, high_m]) + first
            if bounds[1] > bounds[0]:
                rows = slice(int(bounds[0]), int(bounds[1]))
                high_m = min(high_m, way_m - points.grid_m + step_m)
                areas.append(_area(points, sites, road, rows, (low_m, high_m), parameters, step_m))
    return Atlas(points, tuple(areas))


def _area(
    points: References,
    sites: XY,
    road: int,
    rows: slice,
    span_m: tuple[float, float],
    parameters: Parameters,
    step_m: float,
) -> Area:
    level = (points.rsrp_dbm[rows] - CENTRE_DBM) / SCALE_DB
    count = (~np.isnan(level)).sum(axis=0)
    cells = np.flatnonzero(count >= max(FEWEST, parameters.degree + 2))
    curves = np.zeros((len(cells), parameters.degree + 1))
    for i, cell in enumerate(cells.tolist()):
        heard = ~np.isnan(level[:, cell])
        away_m = np.hypot(
            points.x_m[rows][heard] - sites.x_m[cell], points.y_m[rows][heard] - sites.y_m[cell]
        )
        design = level[heard, cell][:, None] ** np.arange(parameters.degree + 1)
        curves[i] = np.linalg.lstsq(design, away_m, rcond=1e-8)[0]
    whole = slice(points.start[road], points.start[road + 1])
    chainage_m = np.arange(*span_m, step_m)
    x_m = np.interp(chainage_m, points.chainage_m[whole], points.x_m[whole])
    y_m = np.interp(chainage_m, points.chainage_m[whole], points.y_m[whole])
    away = np.hypot(x_m - sites.x_m[cells][:, None], y_m - sites.y_m[cells][:, None])
    return Area(road, cells, curves, chainage_m, x_m, y_m, away.astype(np.float32))


def _sites(points: References, survey: Survey) -> XY:
    """Where each cell stands, in the order of the columns."""
    x_m, y_m = np.zeros(len(points.cells)), np.zeros(len(points.cells))
    for i, cell in enumerate(points.cells):
        if cell in survey.sites:
            site = survey.sites[cell]
            plane = points.frame.to_xy(site.lon, site.lat)
            x_m[i], y_m[i] = float(plane.x_m), float(plane.y_m)
            continue
        heard = np.flatnonzero(~np.isnan(points.rsrp_dbm[:, i]))
        if len(heard):
            order = np.argsort(-points.rsrp_dbm[heard, i], kind="stable")
            loud = heard[order[: max(1, int(STRONGEST * len(heard)))]]
            x_m[i], y_m[i] = points.x_m[loud].mean(), points.y_m[loud].mean()
    return XY(x_m, y_m)
