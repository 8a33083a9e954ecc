"""
Whether a window comes from the map's roads at all.

A logistic curve of how well it fits there, how loud the device would have to be for it and how much
there was to fit, learnt from windows that are on the map and windows that the map cannot know, see
`app.numerics.calibration`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from app.domain import Calibration
from app.numerics.observation import Evidence
from app.numerics.offsets import APART_SHARE, OffsetPrior, offset_gain_at

LEAST, MOST = 0.3, 40.0  # independent samples; beyond these, nothing is learnt
TYPICAL_DB = 1.0  # devices of one kind differ by about so much
NOISE_DB2 = 9.0  # levels that vary by less along a window show next to nothing of a place
STRANGE = 4  # which of `off_map_terms` is the device's
OFF_MAP_PRIOR = 0.02  # share of windows from roads that the map lacks: decision 17


class Fit(NamedTuple):
    """
    How well a window fits the map where it fits best.

    Attributes:
        per_reading: Log likelihood against the background per independent reading, the device's
            offset being what suits best, at no cost.
        offset_db: That offset. Devices differ, but windows of unknown roads need any offset.
        apart: Probability that cells have offsets of their own, where that is not known beforehand:
            windows of unknown roads fit best with any; else 0.
        varied_db2: By how much the cells' levels vary along the window, each about its own mean.
    """

    per_reading: float
    offset_db: float
    apart: float = 0.0
    varied_db2: float = 0.0


def off_map_terms(fit: Fit, information: float) -> tuple[float, ...]:
    """
    What the log odds of being on the map are linear in.

    An offset counts by the logarithm of a Cauchy density of scale `TYPICAL_DB`, large ones hardly
    more than middling ones, and however long the window is: it has one device. Levels that hardly
    vary fit well in many a place: that they fit says the more the more there was to fit.
    """
    size = math.log(min(max(information, LEAST), MOST))
    strange = math.log1p((fit.offset_db / TYPICAL_DB) ** 2)
    varied = math.log1p(fit.varied_db2 / NOISE_DB2)
    return 1.0, fit.per_reading, size, fit.per_reading * size, strange, varied


def known_beforehand(fit: Fit) -> float:
    """
    Log odds of being on the map that are not learnt: on the map cells have changed in `APART_SHARE`
    of all cases, off it a window fits best if they may have.
    """
    return math.log(APART_SHARE / (1.0 - APART_SHARE)) * fit.apart


def best_fit(sums: tuple[float, float, float, float], prior: OffsetPrior, seen: Evidence) -> Fit:
    """
    How well a window fits the map at all.

    Args:
        sums: Score, residual and weight of the best place, and how probably groups are apart there.
    """
    score, residual, weight, apart = sums
    count, level_db = seen.weight @ seen.heard, seen.heard * seen.rsrp_db
    readings = max(float(count.sum()), 1e-6)
    sum_db = seen.weight @ level_db
    square_db2 = float(np.vdot(seen.weight[:, None] * level_db, seen.rsrp_db))
    varied_db2 = max(square_db2 - float(sum_db @ (sum_db / (count + 1e-9))), 0.0) / readings
    gain = offset_gain_at(residual, weight, prior)
    free = 0.5 * residual**2 / max(weight, 1e-6)
    return Fit(
        per_reading=(score - gain + free) / readings,
        offset_db=residual / max(weight, 1e-6),
        apart=0.0 if prior.apart == 1.0 else apart,
        varied_db2=varied_db2,
    )


def off_map_probability(calibration: Calibration, fit: Fit | None, information: float) -> float:
    """
    Probability that the window comes from a road that the map lacks.

    Args:
        calibration: Older ones have coefficients of the first four or five terms alone.
        fit: From `best_fit`; None for a window that heard no cell of the map.
        information: How many independent samples the window is worth: the fit of many says more.
    """
    if fit is None:
        return 1.0 - 1e-6
    known = calibration.off_map
    log_odds_on = float(np.dot(known, off_map_terms(fit, information)[: len(known)]))
    log_odds_on += known_beforehand(fit)
    return 1.0 / (1.0 + math.exp(min(max(log_odds_on, -30.0), 30.0)))
