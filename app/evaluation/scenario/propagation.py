"""
Path loss of Recommendation ITU-R P.1411-11 (2021), Annex 1, site-general models.

Equation (1): ``10 alpha log10(d) + beta + 10 gamma log10(f)`` dB, d the distance in space in
metres, f in GHz. Section 4.1.1 with table 4 holds between stations below the rooftops (small
cells), section 4.2.1 with table 8 where one of them is above (macro cells). The Recommendation's
Gaussian term is drawn as a correlated field in `app.evaluation.scenario.shadowing`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

SPEED_OF_LIGHT_M_PER_S = 299_792_458.0


@dataclass(frozen=True, slots=True)
class Coefficients:
    """One line of the tables: it holds from ``least_m``; ``sigma_db`` is published beside it."""

    alpha: float
    beta_db: float
    gamma: float
    sigma_db: float
    least_m: float


@dataclass(frozen=True, slots=True)
class Environment:
    """The lines of one table for paths with line of sight and without."""

    los: Coefficients
    nlos: Coefficients


BELOW_ROOFTOP = Environment(  # P.1411-11 table 4
    los=Coefficients(2.12, 29.2, 2.11, 5.06, 5.0),  # urban high-rise, 0.8-73 GHz, 5-660 m
    nlos=Coefficients(4.00, 10.2, 2.36, 7.60, 30.0),  # urban high-rise, 0.8-38 GHz, 30-715 m
)
ABOVE_ROOFTOP = Environment(  # P.1411-11 table 8
    los=Coefficients(2.29, 28.6, 1.96, 3.48, 55.0),  # urban high-rise, 2.2-73 GHz, 55-1200 m
    nlos=Coefficients(4.39, -6.27, 2.30, 6.89, 260.0),  # urban high-rise, 2.2-66.5 GHz, 260-1200 m
)


def free_space_loss_db(
    distance_m: Float[np.ndarray, "..."], frequency_ghz: float
) -> Float[np.ndarray, "..."]:
    """``20 log10(4 pi d f / c)``: Recommendation ITU-R P.525-4, equation (4)."""
    turns = 4.0 * np.pi * distance_m * frequency_ghz * 1e9 / SPEED_OF_LIGHT_M_PER_S
    return 20.0 * np.log10(turns)


def median_loss_db(
    distance_m: Float[np.ndarray, "..."], frequency_ghz: float, line: Coefficients
) -> Float[np.ndarray, "..."]:
    """
    Median basic transmission loss of one line of the tables.

    Short of its distance range a regression may fall below free space, which nothing does there.
    """
    regression_db = (
        10.0 * line.alpha * np.log10(distance_m)
        + line.beta_db
        + 10.0 * line.gamma * np.log10(frequency_ghz)
    )
    floor_db = free_space_loss_db(distance_m, frequency_ghz)
    return np.where(distance_m < line.least_m, np.maximum(regression_db, floor_db), regression_db)


def blended_loss_db(
    distance_m: Float[np.ndarray, "..."],
    los_share: Float[np.ndarray, "..."],
    frequency_ghz: float,
    environment: Environment,
) -> Float[np.ndarray, "..."]:
    """Median loss where ``los_share`` (0 to 1) of the surroundings see the station."""
    seen_db = median_loss_db(distance_m, frequency_ghz, environment.los)
    hidden_db = median_loss_db(distance_m, frequency_ghz, environment.nlos)
    return los_share * seen_db + (1.0 - los_share) * hidden_db
