"""
What a survey leaves open of a cell's level along a road: Gaussian-process regression.

The law of the simulator: at the nodes of a grid of step h the level is ``m_i + s_i x_i``, m the
median path loss, s the shadowing's standard deviation, x of unit variance, so that its covariance
is ``k_ij = s_i s_j exp(-h |i - j| / l)``; between nodes it is linear. With W the weights of the
nodes at the chainages of the survey's readings y, whose noise is independent and of variance r,

    mean = m + k W' (W k W' + r I)^-1 (y - W m),    covariance = k - k W' (W k W' + r I)^-1 W k

(C. E. Rasmussen and C. K. I. Williams, *Gaussian Processes for Machine Learning*, 2006, equations
2.25 and 2.26). When vehicles drive, the drift's own covariance is added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, slots=True, eq=False)
class Between:
    """Chainages as the node before each and the share of the way to the next, in any shape."""

    low: Int[np.ndarray, "..."]
    share: Float[np.ndarray, "..."]

    @classmethod
    def of(cls, chainage_m: Float[np.ndarray, "..."], step_m: float, nodes: int) -> Between:
        """Where chainages lie among nodes; beyond an end, at it."""
        at = np.clip(chainage_m / step_m, 0.0, nodes - 1)
        low = np.minimum(at.astype(np.int64), nodes - 2)
        return cls(low, at - low)

    def weights(self, nodes: int) -> Float[np.ndarray, "places nodes"]:
        """``W``, for chainages in a row."""
        out = np.zeros((len(self.low), nodes))
        row = np.arange(len(self.low))
        out[row, self.low], out[row, self.low + 1] = 1.0 - self.share, self.share
        return out


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """
    A Gaussian law of a cell's level along a road: at nodes, linear between them.

    Attributes:
        step_m: Between nodes.
        mean_dbm, covariance_db2: At the nodes.
    """

    step_m: float
    mean_dbm: Float[np.ndarray, " nodes"]
    covariance_db2: Float[np.ndarray, "nodes nodes"]

    def mean_at_dbm(self, chainage_m: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        """Expected level at chainages."""
        at = self.between(chainage_m)
        return (1.0 - at.share) * self.mean_dbm[at.low] + at.share * self.mean_dbm[at.low + 1]

    def covariance_at_db2(
        self, chainage_m: Float[np.ndarray, "places samples"]
    ) -> Float[np.ndarray, "places samples samples"]:
        """Covariance of the level at the samples of each place."""
        at = self.between(chainage_m)
        total = np.zeros((*chainage_m.shape, chainage_m.shape[1]))
        for one in (0, 1):
            row = (at.share if one else 1.0 - at.share)[:, :, None]
            for other in (0, 1):
                column = (at.share if other else 1.0 - at.share)[:, None, :]
                found = self.covariance_db2[at.low[:, :, None] + one, at.low[:, None, :] + other]
                total += row * column * found
        return total

    def between(self, chainage_m: Float[np.ndarray, "..."]) -> Between:
        """Chainages among the nodes."""
        return Between.of(chainage_m, self.step_m, len(self.mean_dbm))

    def given(
        self,
        chainage_m: Float[np.ndarray, " readings"],
        rsrp_dbm: Float[np.ndarray, " readings"],
        reading_db2: float,
    ) -> Curve:
        """
        The level given readings at their true chainages.

        Args:
            rsrp_dbm: NaN = not heard, which is taken to say nothing.
            reading_db2: Variance of a reading about the level.
        """
        heard = np.isfinite(rsrp_dbm)
        weights = self.between(chainage_m[heard]).weights(len(self.mean_dbm))
        across = weights @ self.covariance_db2
        within = across @ weights.T + reading_db2 * np.eye(len(weights))
        factor = np.linalg.cholesky(within)
        known = np.linalg.solve(factor, across)
        surprise = np.linalg.solve(factor, rsrp_dbm[heard] - weights @ self.mean_dbm)
        return Curve(
            self.step_m, self.mean_dbm + known.T @ surprise, self.covariance_db2 - known.T @ known
        )

    def drifted(self, covariance_db2: Float[np.ndarray, "nodes nodes"]) -> Curve:
        """The level after an independent change of mean 0 and this covariance."""
        return Curve(self.step_m, self.mean_dbm, self.covariance_db2 + covariance_db2)


def field_covariance_db2(
    spread_db: Float[np.ndarray, " nodes"], step_m: float, correlation_m: float
) -> Float[np.ndarray, "nodes nodes"]:
    """Covariance ``k`` of a field of that standard deviation, falling as exp(-d / l)."""
    at_m = np.arange(len(spread_db)) * step_m
    falling = np.exp(-np.abs(at_m[:, None] - at_m) / correlation_m)
    return spread_db[:, None] * spread_db * falling
