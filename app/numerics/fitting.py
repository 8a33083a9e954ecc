"""How a road's passes become curves and hearing: to all of them, and again to some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from app.numerics.curves import FittedCurves, fit_curves
from app.numerics.geodesy import Floats
from app.numerics.hearing import (
    LISTENING_M,
    MAPPED_FROM,
    for_another_pass,
    heard_probability,
    listened,
    stranger_chance,
)
from app.numerics.heldout import Surface
from app.numerics.passes import RoadPass
from app.numerics.registration import Registration, register

# Of variance beyond what one pass knows of itself; of n passes an n^3-th of it
ANOTHER_DAY_DB2 = 4.0
# Times the likeliest strength of the penalty, where readings do not err apart: of one pass, of many
STRENGTH_ALONE, STRENGTH_TOGETHER = 3.0, 0.25
REGISTERED_ON_M = 6.0  # knots, at least, of the curves that passes are held against for their lags


@dataclass(frozen=True, slots=True, eq=False)
class Fitting:
    """How this road's curves are fitted, to all passes and again to some."""

    end_m: float
    step_m: float
    carrier: Int[np.ndarray, " cells"]

    @property
    def grid_m(self) -> Floats:
        """Chainages of the grid; the last may lie a little beyond the end."""
        steps = int(np.ceil(self.end_m / self.step_m - 1e-9))
        return np.arange(steps + 1, dtype=np.float64) * self.step_m

    def curves(self, passes: Sequence[RoadPass], strength: float | None = None) -> FittedCurves:
        """Splines of every cell that these passes heard; the others' are flat and unmapped."""
        chainage_m = np.concatenate([one.chainage_m for one in passes])
        rsrp = np.concatenate([one.rsrp_dbm for one in passes])
        return fit_curves(chainage_m, rsrp, self.grid_m, self.step_m, strength)

    def strength(self, passes: Sequence[RoadPass], likeliest: float, *, apart: bool) -> float:
        """
        Of the penalty on `curves`, from the strength of the largest restricted likelihood.

        That takes readings to err independently. Where they do not, what a pass errs by changes
        slowly along the road: one pass follows it unless held back more, while many average it out
        and are surer of what changes within metres than their spread tells.

        Args:
            apart: Whether readings err independently (`app.numerics.independence`).
        """
        if apart:
            return likeliest
        by = self.passes_by(passes)
        typical = float(np.median(by[by > 0.0])) if by.any() else 1.0
        alone = (STRENGTH_ALONE - STRENGTH_TOGETHER) / typical**2
        return (STRENGTH_TOGETHER + alone) * likeliest

    def surface(self, passes: Sequence[RoadPass], curves: FittedCurves, *, apart: bool) -> Surface:
        """
        Curves and hearing on the grid, NaN where no sample near heard the cell.

        Args:
            apart: Whether readings err independently (`app.numerics.independence`). Where they do
                not, a pass errs as a whole, and few passes know too little of by how much.
        """
        chainage_m = np.concatenate([one.chainage_m for one in passes])
        share = np.concatenate([one.heard for one in passes])
        size, carrier = len(self.grid_m), self.carrier
        heard = heard_probability(chainage_m, share, size, self.step_m, carrier)
        mapped, by = heard >= MAPPED_FROM, self.passes_by(passes)
        unseen_db2 = 0.0 if apart else ANOTHER_DAY_DB2 / np.maximum(by, 1.0) ** 3
        spread_db = np.sqrt(curves.spread_db**2 + unseen_db2)
        return Surface(
            np.where(mapped, curves.mean_dbm, np.nan).astype(np.float32),
            np.where(mapped, spread_db, np.nan).astype(np.float32),
            np.where(mapped, for_another_pass(heard, by), stranger_chance(by)).astype(np.float32),
        )

    def registration(self, passes: Sequence[RoadPass], strength: float) -> Registration:
        """
        Lag and level of the passes, as far as they tell these of each other.

        Args:
            strength: Of the penalty on `curves`: between knots farther apart as rough a field
                changes more, and is held back less.
        """
        spacing_m = max(self.step_m, REGISTERED_ON_M)
        return register(passes, self.end_m, spacing_m, strength * self.step_m / spacing_m)

    def passes_by(self, passes: Sequence[RoadPass]) -> Floats:
        """How many passes listened to each cell's carrier by each grid point."""
        by = [
            listened(one.chainage_m, one.heard, self.grid_m, LISTENING_M, self.carrier)
            for one in passes
        ]
        return np.sum(by, axis=0).astype(float)
