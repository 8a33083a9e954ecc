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
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from app.numerics.observation import BACKGROUND_SPAN_DB, Evidence

# Chosen on windows of `harsh` and on survey passes held out by day: twice or half matters little.
MEAN_SD_DB = 10.0
FIELD_SD_DB = 8.0
FIELD_M = 20.0
NOISE_DB = 3.0
FEATURELESS = 0.05  # how often levels follow no such law: any level is as likely as any other
READING_LOG = math.log(BACKGROUND_SPAN_DB) - 0.5 * math.log(2.0 * math.pi * NOISE_DB**2)


class Field(NamedTuple):
    """
    A Gauss-Markov field along a road, of mean 0.

    Attributes:
        sd_db: Its standard deviation.
        length_m: Over which its correlation falls to 1/e.
    """

    sd_db: float
    length_m: float

    @property
    def law(self) -> tuple[float, float]:
        """Variance and length, as the kernels take it."""
        return self.sd_db**2, self.length_m


ANY_FIELD = Field(FIELD_SD_DB, FIELD_M)


class Sums(NamedTuple):
    """
    What a law makes of each cell's readings, see the module.

    Attributes:
        squares, residual, weight: ``Q``, ``R`` and ``W``.
        log: Of the product of ``S w / NOISE_DB^2``.
    """

    squares: Float[np.ndarray, " cells"]
    residual: Float[np.ndarray, " cells"]
    weight: Float[np.ndarray, " cells"]
    log: Float[np.ndarray, " cells"]


def filtered(
    behind_m: Float[np.ndarray, " samples"],
    rsrp_db: Float[np.ndarray, "samples cells"],
    precision: Float[np.ndarray, "samples cells"],
    field: Field,
) -> Sums:
    """
    Readings of a field and noise, newest first.

    Args:
        precision: One over the variance of each reading's noise, per dB^2; 0 = there is none.
    """
    cells, field_db2 = precision.shape[1], field.sd_db**2
    level_db, one_db, doubt_db2 = np.zeros(cells), np.zeros(cells), np.full(cells, field_db2)
    squares, residual, weight, log = (np.zeros(cells) for _ in range(4))
    kept = np.exp(-np.diff(behind_m, prepend=behind_m[0]) / field.length_m)
    for row, share in enumerate(kept.tolist()):
        level_db, one_db = share * level_db, share * one_db
        doubt_db2 = share**2 * doubt_db2 + (1.0 - share**2) * field_db2
        spread = doubt_db2 * precision[row] + 1.0
        innovation = precision[row] / spread
        missed_db, missed_one = rsrp_db[row] - level_db, 1.0 - one_db
        squares += innovation * missed_db**2
        residual += innovation * missed_db * missed_one
        weight += innovation * missed_one**2
        log += np.log(spread)
        gain = doubt_db2 * innovation
        level_db, one_db = level_db + gain * missed_db, one_db + gain * missed_one
        doubt_db2 = doubt_db2 * (1.0 - gain)
    return Sums(squares, residual, weight, log)


def log_evidence(seen: Evidence, temperature: float = 1.0) -> float:
    """
    Log evidence of the levels, against the background.

    Args:
        temperature: Of the window, where that is below 1: each reading then counts for its weight
            over it.
    """
    count = seen.heard * (seen.weight[:, None] / min(temperature, 1.0))
    return of_any_road(seen.behind_m, seen.rsrp_db, count)


def of_any_road(
    behind_m: Float[np.ndarray, " samples"],
    rsrp_db: Float[np.ndarray, "samples cells"],
    count: Float[np.ndarray, "samples cells"],
) -> float:
    """The same of readings that count for so much each."""
    sums = filtered(behind_m, rsrp_db, count / NOISE_DB**2, ANY_FIELD)
    told = 1.0 + MEAN_SD_DB**2 * sums.weight
    each = MEAN_SD_DB**2 * sums.residual**2 / told - sums.squares - np.log(told) - sums.log
    return float(0.5 * each.sum() + READING_LOG * count.sum())


def or_featureless(log_evidence_of_law: float) -> float:
    """
    The same where levels may follow no law at all, by which the log evidence is 0: what jumps as
    levels never do is no likelier to come from the map for it.
    """
    law, none = math.log1p(-FEATURELESS) + log_evidence_of_law, math.log(FEATURELESS)
    return max(law, none) + math.log1p(math.exp(-abs(law - none)))
