"""
What held-out windows say of a map's probabilities.

Every road model carries its evidence: windows of its own passes, aligned with curves fitted without
them. From all roads together come the temperature that makes the posterior come true, the spread of
device offsets, and how well a window fits that is on the map at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from app.domain import Calibration, RoadModel
from app.numerics.observation import Evidence

TEMPERATURES = tuple(float(t) for t in np.round(np.geomspace(0.1, 12.8, 22), 3))
FIXED_COLUMNS = ("fit", "offset_db", "offset_variance_db2", "measured")
EVIDENCE_COLUMNS = FIXED_COLUMNS + tuple(f"log_mass_at_{t}" for t in TEMPERATURES)
DEFAULT_OFFSET_SD_DB = 1.0  # until two passes of one road tell how devices differ
SMALLEST_OFFSET_SD_DB = 0.5
OFF_MAP_PRIOR = 0.02  # share of windows that come from roads the map lacks
MIN_WINDOWS = 20  # fewer held-out windows say nothing reliable


def fit_per_reading(best_score: float, seen: Evidence) -> float:
    """Best score over the number of independent readings: how well a window fits the map at all."""
    readings = float(seen.weight @ seen.heard.sum(axis=1))
    return best_score / max(readings, 1e-6)


def off_map_probability(calibration: Calibration, best_score: float, seen: Evidence) -> float:
    """Probability that the window comes from a road that the map lacks."""
    fit = fit_per_reading(best_score, seen)
    argument = calibration.off_map_intercept + calibration.off_map_slope * fit
    return float(1.0 / (1.0 + np.exp(np.clip(argument, -50.0, 50.0))))


def calibrate(models: Sequence[RoadModel]) -> Calibration:
    """
    Pool the roads' evidence.

    Args:
        models: All roads of the map; those without evidence have no say.
    """
    rows = np.concatenate(
        [np.zeros((0, len(EVIDENCE_COLUMNS))), *(model.evidence for model in models)]
    )
    if len(rows) < MIN_WINDOWS:
        return Calibration(off_map_intercept=6.0, off_map_slope=2.0)
    log_mass = rows[:, len(FIXED_COLUMNS) :]
    temperature = TEMPERATURES[int(np.argmax(log_mass.mean(axis=0)))]
    fit = rows[:, 0]
    middle, spread = float(np.median(fit)), float(np.std(fit)) + 1e-3
    slope = 2.0 / spread
    return Calibration(
        temperature=temperature,
        offset_sd_db=_offset_sd_db(rows[rows[:, 3] > 0.5]),
        off_map_intercept=-slope * (middle - 4.0 * spread),
        off_map_slope=slope,
        window_count=len(rows),
    )


def _offset_sd_db(measured: Float[np.ndarray, "windows columns"]) -> float:
    """Spread of device offsets beyond what the windows' own noise explains."""
    if len(measured) < MIN_WINDOWS:
        return DEFAULT_OFFSET_SD_DB
    beyond = float(np.mean(measured[:, 1] ** 2 - measured[:, 2]))
    return float(np.sqrt(max(beyond, SMALLEST_OFFSET_SD_DB**2)))
