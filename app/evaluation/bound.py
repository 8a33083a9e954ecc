"""
How well any unbiased method could do: the Cramer-Rao bound of the position along the road.

A window's readings are ``z[j,k] = mu_k(s + sign d_j) + n``: the true RSRP ``mu_k`` and travelled
distances ``d_j`` are known, the noise is Gaussian of variance ``sigma^2``. Rounding to steps q adds
``q^2 / 12`` (Widrow and Kollar, *Quantization Noise*, 2008, chapter 4). The information about s is

    I(s) = sum over j, k of (d mu_k / d s)^2 / (sigma^2 + q^2 / 12),    Var(s) >= 1 / I(s)

(S. M. Kay, *Fundamentals of Statistical Signal Processing: Estimation Theory*, 1993, Eq. 3.14; for
location fingerprints Hossain and Soh, INFOCOM 2010, reference 11 of the paper). A device offset of
known spread, common to all readings, is a nuisance parameter with a prior: its information is
projected out. The bound is local: it knows nothing of taking one road for another, and of a map
that was itself surveyed with noise.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from app.evaluation.scenario import RoadTruth, Scenario

MEAN_ABSOLUTE = float(np.sqrt(2.0 / np.pi))  # of a Gaussian, in standard deviations


def information_per_m2(
    slope_db_per_m: Float[np.ndarray, "samples cells"],
    noise_db: float,
    quantisation_db: float = 0.0,
    offset_sd_db: float | None = None,
) -> float:
    """
    Fisher information about the chainage.

    Args:
        slope_db_per_m: True slope of each reading's mean; NaN where the cell is not heard.
        offset_sd_db: Spread of the device's offset; None when there is none.
    """
    variance_db2 = noise_db**2 + quantisation_db**2 / 12.0
    if variance_db2 <= 0:
        return float("inf")
    heard = ~np.isnan(slope_db_per_m)
    slope = np.where(heard, slope_db_per_m, 0.0)
    about_place = float((slope**2).sum()) / variance_db2
    if offset_sd_db is None or offset_sd_db <= 0:
        return about_place
    mixed = float(slope.sum()) / variance_db2
    about_offset = float(heard.sum()) / variance_db2 + 1.0 / offset_sd_db**2
    return about_place - mixed**2 / about_offset


def least_sd_m(
    truth: RoadTruth, chainage_m: Float[np.ndarray, " samples"], scenario: Scenario
) -> float:
    """
    Bound of the standard deviation for a window whose samples were taken at these chainages.

    The true mean is straight between the places of its grid; its slope is that of the piece.
    """
    field = truth.drive_dbm
    step_m = truth.length_m / (len(field) - 1)
    piece = np.clip((chainage_m / step_m).astype(int), 0, len(field) - 2)
    slope = (field[piece + 1] - field[piece]) / step_m
    mean_dbm = truth.mean_dbm(chainage_m, drifted=True)
    slope = np.where(mean_dbm >= scenario.sensitivity_dbm, slope, np.nan)
    information = information_per_m2(
        slope, scenario.noise_db, scenario.quantisation_db, scenario.device_offset_sd_db
    )
    return float(1.0 / np.sqrt(information)) if information > 0 else float("inf")
