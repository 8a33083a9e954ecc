"""The five kinds of feature of the paper's section II-B, per cell, for a stretch of any length."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def mean_gradient_db_per_m(
    rsrp_dbm: Float[np.ndarray, "samples cells"], distance_m: Float[np.ndarray, " samples"]
) -> Float[np.ndarray, " cells"]:
    """
    Least-squares slope of RSRP along the road, per cell.

    The paper's Eq. (1) averaged over a stretch telescopes to its two end samples; the slope of
    least squares equals it on a straight line and rests on every sample.

    Args:
        rsrp_dbm: Received power; NaN = not heard.
        distance_m: Distance of each sample along the drive.

    Returns:
        Slope in dB/m; NaN where a cell was heard at fewer than two distances.
    """
    heard = ~np.isnan(rsrp_dbm)
    count = heard.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        centre_m = np.where(heard, distance_m[:, None], 0.0).sum(axis=0) / count
        lever_m = np.where(heard, distance_m[:, None] - centre_m, 0.0)
        moment = (lever_m * np.where(heard, rsrp_dbm, 0.0)).sum(axis=0)
        spread = (lever_m**2).sum(axis=0)
        return np.where(spread > 1e-9, moment / np.where(spread > 1e-9, spread, 1.0), np.nan)


def mean_dbm(rsrp_dbm: Float[np.ndarray, "samples cells"]) -> Float[np.ndarray, " cells"]:
    """Mean RSRP of the samples that heard the cell, dBm; NaN where none did."""
    heard = ~np.isnan(rsrp_dbm)
    with np.errstate(invalid="ignore"):
        return np.where(heard, rsrp_dbm, 0.0).sum(axis=0) / heard.sum(axis=0)


def variance_db2(rsrp_dbm: Float[np.ndarray, "samples cells"]) -> Float[np.ndarray, " cells"]:
    """Population variance of RSRP, dB^2; NaN where a cell was not heard."""
    heard = ~np.isnan(rsrp_dbm)
    deviation_db = np.where(heard, rsrp_dbm - mean_dbm(rsrp_dbm), 0.0)
    with np.errstate(invalid="ignore"):
        return (deviation_db**2).sum(axis=0) / heard.sum(axis=0)


def mean_difference_db(
    rsrp_dbm: Float[np.ndarray, "samples cells"], reference: int
) -> Float[np.ndarray, " cells"]:
    """
    Mean of each cell's RSRP minus the reference cell's, Eq. (2), in dB.

    Only samples that heard both count; NaN where none did. The reference's own is 0.
    """
    return mean_dbm(rsrp_dbm - rsrp_dbm[:, [reference]])


def range_db(rsrp_dbm: Float[np.ndarray, "samples cells"]) -> Float[np.ndarray, " cells"]:
    """Largest minus smallest RSRP, dB; NaN where a cell was not heard."""
    heard = ~np.isnan(rsrp_dbm)
    highest = np.where(heard, rsrp_dbm, -np.inf).max(axis=0)
    lowest = np.where(heard, rsrp_dbm, np.inf).min(axis=0)
    return np.where(heard.any(axis=0), highest - lowest, np.nan)


def feature_matrix(
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    distance_m: Float[np.ndarray, " samples"],
    reference: int,
) -> Float[np.ndarray, "5 cells"]:
    """
    All five features of a stretch, Eq. (3), one kind a row in the order of `FEATURE_KINDS`.

    Args:
        rsrp_dbm: Received power; NaN = not heard.
        distance_m: Distance of each sample along the drive.
        reference: Column of the reference cell (the paper's macro cell).
    """
    return np.stack(
        [
            mean_gradient_db_per_m(rsrp_dbm, distance_m),
            mean_dbm(rsrp_dbm),
            variance_db2(rsrp_dbm),
            mean_difference_db(rsrp_dbm, reference),
            range_db(rsrp_dbm),
        ]
    )
