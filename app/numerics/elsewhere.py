"""
How probable a window's levels are on a road of which nothing is known.

There a cell's level is a mean of its own, ``N(0, MEAN_SD_DB^2)`` about `CENTRE_DBM`, and a field
about it that forgets with distance, of covariance ``FIELD_SD_DB^2 exp(-d / FIELD_M)`` (Gudmundson);
a reading adds noise. That a window fits a road says little where it would fit any: of levels that
stay as they are, or change no faster than levels do, the half fit somewhere.

Counted as scores of places are (`app.numerics.observation`): against the featureless background,
and a reading of weight ``w`` to the power of ``w``, which is one of noise ``NOISE_DB^2 / w`` but
for a factor. The field is a Markov chain, so that it is filtered sample by sample; with innovations
``e`` of the readings and ``o`` of a level of 1 dB, of variance ``S``, a cell's mean adds what a
device's offset adds to a place: ``Q = sum e^2 / S``, ``R = sum e o / S``, ``W = sum o^2 / S`` and

    log evidence = -Q / 2 + v R^2 / (2 (1 + v W)) - log(1 + v W) / 2 - sum log(S w / NOISE_DB^2) / 2
                   + sum w log(50 / sqrt(2 pi NOISE_DB^2)),    v = MEAN_SD_DB^2
"""

from __future__ import annotations

import math

import numpy as np

from app.numerics.observation import BACKGROUND_SPAN_DB, Evidence

# Chosen on windows of `harsh` and on survey passes held out by day: twice or half matters little.
MEAN_SD_DB = 8.0
FIELD_SD_DB = 6.0
FIELD_M = 40.0
NOISE_DB = 3.0
FEATURELESS = 0.05  # how often levels follow no such law: any level is as likely as any other
READING_LOG = math.log(BACKGROUND_SPAN_DB) - 0.5 * math.log(2.0 * math.pi * NOISE_DB**2)


def log_evidence(seen: Evidence, temperature: float = 1.0) -> float:
    """
    Log evidence of the levels, against the background.

    Args:
        temperature: Of the window, where that is below 1: each reading then counts for its weight
            over it.
    """
    count = seen.heard * (seen.weight[:, None] / min(temperature, 1.0))
    cells, field_db2, noise_db2 = count.shape[1], FIELD_SD_DB**2, NOISE_DB**2
    level_db, one_db, doubt_db2 = np.zeros(cells), np.zeros(cells), np.full(cells, field_db2)
    squares, residual, weight, log = (np.zeros(cells) for _ in range(4))
    kept = np.exp(-np.diff(seen.behind_m, prepend=seen.behind_m[0]) / FIELD_M)
    for row, share in enumerate(kept.tolist()):
        level_db, one_db = share * level_db, share * one_db
        doubt_db2 = share**2 * doubt_db2 + (1.0 - share**2) * field_db2
        heard = count[row] > 0.0
        spread = np.where(heard, doubt_db2 * count[row] / noise_db2 + 1.0, 1.0)
        precision = count[row] / (noise_db2 * spread)
        missed_db, missed_one = seen.rsrp_db[row] - level_db, 1.0 - one_db
        squares += precision * missed_db**2
        residual += precision * missed_db * missed_one
        weight += precision * missed_one**2
        log += np.log(spread)
        gain = doubt_db2 * precision
        level_db, one_db = level_db + gain * missed_db, one_db + gain * missed_one
        doubt_db2 = doubt_db2 * (1.0 - gain)
    told = 1.0 + MEAN_SD_DB**2 * weight
    each = MEAN_SD_DB**2 * residual**2 / told - squares - np.log(told) - log
    return float(0.5 * each.sum() + READING_LOG * count.sum())


def or_featureless(log_evidence_of_law: float) -> float:
    """
    The same where levels may follow no law at all, by which the log evidence is 0: what jumps as
    levels never do is no likelier to come from the map for it.
    """
    law, none = math.log1p(-FEATURELESS) + log_evidence_of_law, math.log(FEATURELESS)
    return max(law, none) + math.log1p(math.exp(-abs(law - none)))
