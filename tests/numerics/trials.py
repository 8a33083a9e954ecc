"""Made-up trials of calibration, whose truth is known."""

from __future__ import annotations

import numpy as np

from app.numerics.evidence_table import HeldOut
from app.numerics.offmap import Fit
from app.numerics.offsets import OffsetPrior
from app.numerics.posterior import Places
from app.numerics.trials import Trial

PRIOR = OffsetPrior.learnt(1.0)


def trial(rng, samples, information, position_sd_m=0.0):
    """A window on a long road whose score falls from its peak as if each sample told one unit."""
    at_m = np.arange(0.0, 400.0)
    peak_m = rng.uniform(150.0, 250.0)
    score = -0.5 * samples * (at_m - peak_m) ** 2 / 60.0**2
    true_m = peak_m + rng.normal(0.0, np.hypot(60.0 / np.sqrt(information), position_sd_m))
    where = np.stack([np.zeros(400, dtype=np.int64), np.ones(400, dtype=np.int64)])
    zero = np.zeros(400)
    places = Places(where, np.stack([at_m, zero + 1.0, score, zero, zero + 1.0]))
    truth = HeldOut(np.zeros(1), np.zeros((1, 1)), np.zeros(1, int), true_m, 1, 0)
    fits = Fit(1.0, 0.0), Fit(0.0, 0.0)
    return Trial(0, truth, places, float(samples), samples, *fits, PRIOR)
