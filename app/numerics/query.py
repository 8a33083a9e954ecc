"""A window against a map: which of its cells the map knows, ready for every scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.domain import Window
from app.numerics.index import COARSE_STEPS_M, GAP, MapIndex
from app.numerics.observation import HEARD_FLOOR, HEARING_WEIGHT, Evidence, evidence

FINE_STEP_M = 1.0
LONGEST_M = COARSE_STEPS_M[-1] * (GAP - 1)  # readings farther back than this are not used
UNMAPPED = HEARING_WEIGHT * float(np.log(HEARD_FLOOR / (1.0 - HEARD_FLOOR)))


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """
    The usable part of a window.

    Attributes:
        cells: Heard cells that the map knows, sorted; the columns of ``rsrp_dbm``.
        unknown: Heard cells that it does not know, sorted.
        fine: The readings metre by metre.
    """

    cells: tuple[str, ...]
    unknown: tuple[str, ...]
    distance_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    fine: Evidence

    @property
    def length_m(self) -> float:
        """Travelled distance from the oldest usable sample to the last."""
        return float(self.distance_m[-1] - self.distance_m[0])

    def at_step(self, step_m: float) -> Evidence:
        """The readings averaged over coarse steps."""
        return evidence(self.distance_m, self.rsrp_dbm, step_m)


def ask(index: MapIndex, window: Window) -> Query:
    """Prepare a window; the order of its cells moves nothing."""
    heard = np.flatnonzero(~np.isnan(window.rsrp_dbm).all(axis=0))
    order = sorted(heard.tolist(), key=window.cells.__getitem__)
    known = [column for column in order if window.cells[column] in index.cells]
    unknown = tuple(window.cells[c] for c in order if window.cells[c] not in index.cells)
    recent = window.distance_m >= window.distance_m[-1] - LONGEST_M
    distance_m, rsrp_dbm = window.distance_m[recent], window.rsrp_dbm[recent][:, known]
    return Query(
        tuple(window.cells[column] for column in known),
        unknown,
        distance_m,
        rsrp_dbm,
        evidence(distance_m, rsrp_dbm, FINE_STEP_M),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """Cells of a window that a profile knows: their columns there and in the window."""

    there: Int[np.ndarray, " chosen"]
    here: Int[np.ndarray, " chosen"]
    missing: Int[np.ndarray, " missing"]


def choose(query: Query, column: dict[str, int]) -> Chosen:
    """Match the window's cells with a profile's rows; ``missing`` are those it lacks."""
    found = [(column[cell], i) for i, cell in enumerate(query.cells) if cell in column]
    missing = [i for i, cell in enumerate(query.cells) if cell not in column]
    pairs = np.array(found, dtype=np.intp).reshape(-1, 2)
    return Chosen(pairs[:, 0], pairs[:, 1], np.array(missing, dtype=np.intp))


def unmapped_score(seen: Evidence, missing: Int[np.ndarray, " missing"]) -> float:
    """Score of hearing cells that a road has never heard; the same all along it."""
    if len(missing) == 0:
        return 0.0
    return UNMAPPED * float(seen.weight @ seen.heard[:, missing].sum(axis=1))
