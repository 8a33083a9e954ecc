"""What a map expects of a window's samples behind a place, for explanations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.numerics.contributions import Place, cell_terms, laid_at
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.observation import CENTRE_DBM


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """
    What the map expects of samples behind a place, one row a sample.

    Attributes:
        rsrp_dbm, spread_db: Level and its spread; NaN where the cell is not mapped.
        hearing: Probability of hearing the cell, 0 where it is not mapped, NaN beyond the road.
    """

    rsrp_dbm: Float[np.ndarray, "samples cells"]
    spread_db: Float[np.ndarray, "samples cells"]
    hearing: Float[np.ndarray, "samples cells"]


def expected(
    index: MapIndex,
    place: Place,
    cells: tuple[str, ...],
    behind_m: Float[np.ndarray, " samples"],
) -> Expected:
    """What the map expects of each sample, straight between the grid positions about it."""
    laid = laid_at(index, place, float(behind_m.max(initial=0.0)), cells)
    road = laid.road
    at = (laid.chainage_m - laid.sign * behind_m) / road.step_m + 1.0
    at = np.clip(at, 0.0, road.along.columns - 1.0)
    low = np.minimum(at.astype(np.intp), road.along.columns - 2)
    near = _expected_at(road, cells, np.rint(at).astype(np.intp))
    left, right = (_expected_at(road, cells, low + step) for step in (0, 1))
    share = (at - low)[:, None]
    mixed = left + share * (right - left)
    return Expected(*np.where(np.isnan(mixed) | np.isnan(near), near, mixed))


def _expected_at(
    road: RoadIndex, cells: tuple[str, ...], columns: Int[np.ndarray, " samples"]
) -> Float[np.ndarray, "3 samples cells"]:
    precision, aimed, _, logit, _ = cell_terms(road, cells, columns)
    mapped = precision > 0.0
    safe = np.where(mapped, precision, 1.0)
    level = np.where(mapped, aimed / safe + CENTRE_DBM, np.nan)
    hearing = np.where(mapped, 1.0 / (1.0 + np.exp(-logit)), 0.0)
    outside = road.along.rows[-1, columns] > 0.0
    hearing[outside] = np.nan
    return np.stack([level, np.where(mapped, safe**-0.5, np.nan), hearing])
