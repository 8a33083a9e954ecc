"""A window against a map: which of its cells the map knows, ready for every scale."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Float32, Int

from app.domain import Window
from app.numerics.index import COARSE_STEPS_M, GAP, MapIndex
from app.numerics.observation import (
    HEARD_FLOOR,
    HEARING_WEIGHT,
    Evidence,
    coefficients,
    evidence,
    joined,
)

FINE_STEP_M = 1.0
LONGEST_M = COARSE_STEPS_M[-1] * (GAP - 1)  # readings farther back than this are not used
UNMAPPED = HEARING_WEIGHT * float(np.log(HEARD_FLOOR / (1.0 - HEARD_FLOOR)))


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """
    A window aimed at one profile.

    Attributes:
        cells: Rows of the profile that the window heard.
        factors: The window's side of the likelihood, see `coefficients`.
        behind: Columns of the profile from each sample to the window's end.
        counted: Weight of each reading. Shape ``(samples, chosen)``.
        constant: Score of the cells that the profile lacks, the same at every position.
    """

    cells: Int[np.ndarray, " chosen"]
    factors: Float32[np.ndarray, "3 samples rows"]
    behind: Int[np.ndarray, " samples"]
    counted: Float[np.ndarray, "samples chosen"]
    constant: float


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """
    The usable part of a window.

    Attributes:
        cells: Heard cells that the map knows, sorted; the columns of ``fine``.
        unknown: Heard cells that it does not know, sorted.
        fine: The readings metre by metre.
        samples: How many samples of the window these are.
    """

    cells: tuple[str, ...]
    unknown: tuple[str, ...]
    fine: Evidence
    samples: int
    _aims: dict[int, Aim] = field(default_factory=dict)

    @property
    def length_m(self) -> float:
        """Travelled distance from the oldest usable sample to the last."""
        return float(self.fine.behind_m[-1])

    def at_step(self, step_m: float) -> Evidence:
        """The readings averaged over coarse steps."""
        fine = self.fine
        return joined(fine.behind_m, fine.rsrp_db, fine.heard, step_m)

    def aim(self, index: MapIndex, road: int) -> Aim:
        """The window aimed at one road's fine profile; worked out once a road."""
        found = self._aims.get(road)
        if found is None:
            target = index.roads[road]
            found = take_aim(self.fine, self.cells, target.column, target.step_m)
            self._aims[road] = found
        return found


def ask(index: MapIndex, window: Window) -> Query:
    """Prepare a window; the order of its cells moves nothing."""
    rsrp_dbm, distance_m = window.rsrp_dbm, window.distance_m
    if distance_m[-1] - distance_m[0] > LONGEST_M:
        recent = distance_m >= distance_m[-1] - LONGEST_M
        distance_m, rsrp_dbm = distance_m[recent], rsrp_dbm[recent]
    heard = (~np.isnan(rsrp_dbm)).any(axis=0).tolist()
    order = sorted((cell, i) for i, cell in enumerate(window.cells) if heard[i])
    known = [(cell, i) for cell, i in order if cell in index.cells]
    unknown = tuple(cell for cell, _ in order if cell not in index.cells)
    fine = evidence(distance_m, rsrp_dbm[:, [i for _, i in known]], FINE_STEP_M)
    return Query(tuple(cell for cell, _ in known), unknown, fine, len(distance_m))


def take_aim(seen: Evidence, cells: tuple[str, ...], column: dict[str, int], step_m: float) -> Aim:
    """Match a window's cells with a profile's rows of ``step_m``."""
    found = [(column[cell], i) for i, cell in enumerate(cells) if cell in column]
    here = np.array([i for _, i in found], dtype=np.intp)
    constant = 0.0
    if len(found) < len(cells):
        missing = [i for i, cell in enumerate(cells) if cell not in column]
        constant = UNMAPPED * float(seen.weight @ seen.heard[:, missing].sum(axis=1))
    return Aim(
        np.array([row for row, _ in found], dtype=np.intp),
        coefficients(seen, here),
        np.rint(seen.behind_m / step_m).astype(np.intp),
        seen.heard[:, here] * seen.weight[:, None],
        constant,
    )
