"""
Whether a window comes from the map's roads at all.

A logistic curve of how well it fits there, learnt from windows that are on the map and windows that
the map cannot know, see `app.numerics.calibration`.
"""

from __future__ import annotations

import math

import numpy as np

from app.domain import Calibration
from app.numerics.observation import Evidence, OffsetPrior, offset_gain_at

LEAST, MOST = 0.3, 40.0  # independent samples; beyond these, nothing is learnt
OFF_MAP_PRIOR = 0.05  # the largest tried that refuses under 2 % of held-out survey windows


def off_map_terms(fit: float, information: float) -> tuple[float, float, float, float]:
    """What the log odds of being on the map are linear in."""
    size = math.log(min(max(information, LEAST), MOST))
    return 1.0, fit, size, fit * size


def fit_per_reading(
    score: float, residual: float, weight: float, prior: OffsetPrior, seen: Evidence
) -> float:
    """
    Score of the best place per independent reading: how well a window fits the map at all.

    The device may have any offset here, at no cost: an unusual device is no stranger to the road.

    Args:
        score, residual, weight: Of the best place.
    """
    readings = float((seen.weight @ seen.heard).sum())
    gain = offset_gain_at(residual, weight, prior)
    free = 0.5 * residual**2 / max(weight, 1e-6)
    return (score - gain + free) / max(readings, 1e-6)


def off_map_probability(calibration: Calibration, fit: float | None, information: float) -> float:
    """
    Probability that the window comes from a road that the map lacks.

    Args:
        fit: From `fit_per_reading`; None for a window that heard no cell of the map.
        information: How many independent samples the window is worth: the fit of many says more.
    """
    if fit is None:
        return 1.0 - 1e-6
    log_odds_on = float(np.dot(calibration.off_map, off_map_terms(fit, information)))
    return 1.0 / (1.0 + math.exp(min(max(log_odds_on, -30.0), 30.0)))
