"""Whether a window comes from the map's roads at all."""

from __future__ import annotations

import math

from app.domain import Calibration
from app.numerics.observation import Evidence

OFF_MAP_PRIOR = 0.05  # before a map has learnt anything, one window in twenty is from elsewhere


def fit_per_reading(best_score: float, seen: Evidence) -> float:
    """Best score over the number of independent readings: how well a window fits the map at all."""
    readings = float((seen.weight @ seen.heard).sum())
    return best_score / max(readings, 1e-6)


def off_map_probability(calibration: Calibration, best_score: float, seen: Evidence) -> float:
    """
    Probability that the window comes from a road that the map lacks.

    A logistic curve of the fit per reading; a window with no cell that the map knows is off it.
    """
    if seen.heard.shape[1] == 0:
        return 1.0 - 1e-6
    fit = fit_per_reading(best_score, seen)
    log_odds_on = calibration.off_map_intercept + calibration.off_map_slope * fit
    return 1.0 / (1.0 + math.exp(min(max(log_odds_on, -30.0), 30.0)))
