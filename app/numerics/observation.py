"""
What a window says of a place: the likelihood that every matcher shares.

A sample of a vehicle at chainage ``s`` hears cell ``k`` with probability ``p_k(s)`` and reads it as
``N(mu_k(s) + b, sigma_k(s)^2)``, where ``b`` is the device's offset, common to the window. Readings
are compared with a featureless background (any level within 50 dB, any cell), so that scores of
places that know different cells compare. For one sample the logarithm is linear in four terms of
the map, which is why whole roads are scored by one matrix product:

    sum over heard k of [-1/2 (A y^2 - 2 B y + C) + h L]  +  h base

with ``A = 1/sigma^2``, ``B = A mu``, ``C = A mu^2 + log(2 pi sigma^2) - 2 log 50``, ``L`` the logit
of ``p_k`` and ``base`` the sum over all mapped cells of ``log(1 - p_k)``; ``y`` and ``mu`` are
counted from `CENTRE_DBM` so that float32 keeps every digit that matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32

CENTRE_DBM = -95.0
BACKGROUND_SPAN_DB = 50.0  # phones report some 50 dB of useful RSRP; any level in it is as likely
HEARD_FLOOR = 0.02  # a cell may appear, or fail to, wherever the survey says otherwise
HEARING_WEIGHT = 0.3  # hearing is far more alike from sample to sample than levels are
CORRELATION_M = 10.0  # closer samples share shadowing and count as one; the map's temperature, too
OUTSIDE_HEARD = 0.03  # chance of a reading off the road: windows rarely begin on another one
BROAD_OFFSET_SD_DB = 6.0  # devices differ by up to 8 dB
BROAD_OFFSET_SHARE = 0.1  # how often a device is unlike those of the surveys

TERMS = 4  # A, B, C, L: see the module's text
CHANNELS = 3  # score, weighted residual, weight: what marginalising the offset needs


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """
    Expected readings along a stretch, ready for scoring.

    Attributes:
        terms: A, B, C and L of every cell at every position. Shape ``(cells, 4, positions)``.
        base: Score of hearing nothing. Shape ``(positions,)``.
        bend: ``A (mu_next - mu)^2 / 2`` of every cell from each position to the next: by how much
            a place between the two fits better than its neighbours' mean, times ``f (1 - f)``.
            Shape ``(cells, positions)``.
    """

    terms: Float32[np.ndarray, "cells 4 positions"]
    base: Float32[np.ndarray, " positions"]
    bend: Float32[np.ndarray, "cells positions"]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """
    A window made ready: one row a stretch of road with readings, newest first.

    Attributes:
        behind_m: Travelled distance from each sample to the window's end. Shape ``(samples,)``.
        rsrp_db: Mean reading above `CENTRE_DBM`, 0 where not heard. Shape ``(samples, cells)``.
        heard: Share of the sample's readings that heard the cell, 0..1, same shape.
        weight: How much each sample counts, 0..1, for the shadowing it shares with its neighbours.
    """

    behind_m: Float[np.ndarray, " samples"]
    rsrp_db: Float[np.ndarray, "samples cells"]
    heard: Float[np.ndarray, "samples cells"]
    weight: Float[np.ndarray, " samples"]


def profile(
    mean_dbm: Float[np.ndarray, "positions cells"],
    spread_db: Float[np.ndarray, "positions cells"],
    heard: Float[np.ndarray, "positions cells"],
) -> Profile:
    """
    The map's side of the likelihood.

    Args:
        mean_dbm, spread_db: Expected level and its spread; NaN where the cell is not mapped.
        heard: Probability of hearing the cell.
    """
    mapped = ~np.isnan(mean_dbm)
    variance = np.where(mapped, spread_db, 1.0) ** 2
    level_db = np.where(mapped, mean_dbm, CENTRE_DBM) - CENTRE_DBM
    precision = np.where(mapped, 1.0 / variance, 0.0)
    normaliser = np.log(variance * (2.0 * np.pi)) - 2.0 * np.log(BACKGROUND_SPAN_DB)
    sure = np.clip(np.where(mapped, heard, 0.0), HEARD_FLOOR, 1.0 - HEARD_FLOOR)
    silent = np.log1p(-sure)
    terms = np.stack(
        [
            precision,
            precision * level_db,
            precision * level_db**2 + np.where(mapped, normaliser, 0.0),
            np.log(sure) - silent,
        ]
    )
    base = np.where(mapped, silent, 0.0).sum(axis=1)
    bend = np.zeros(level_db.shape)
    between = mapped[:-1] & mapped[1:]
    bend[:-1] = np.where(between, 0.5 * precision[:-1] * np.diff(level_db, axis=0) ** 2, 0.0)
    return Profile(
        np.ascontiguousarray(terms.transpose(2, 0, 1), dtype=np.float32),
        base.astype(np.float32),
        np.ascontiguousarray(bend.T, dtype=np.float32),
    )


def evidence(
    distance_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    step_m: float,
) -> Evidence:
    """
    Readings of a window averaged over stretches of ``step_m`` that end at its last sample.

    A standing car's hundred readings of one place become one; the order of the samples within a
    stretch, and of the cells, moves nothing.
    """
    level_db = rsrp_dbm[::-1] - CENTRE_DBM
    known = level_db == level_db  # noqa: PLR0124  # False for NaN alone, in one pass
    heard = known.astype(float)
    level_db = np.where(known, level_db, 0.0)
    behind_m = distance_m[-1] - distance_m[::-1]
    stretch = np.rint(behind_m / step_m)
    change = stretch[1:] != stretch[:-1]
    if not change.all():
        starts = np.concatenate(([0], np.flatnonzero(change) + 1))
        count = np.add.reduceat(heard, starts, axis=0)
        samples = np.diff(np.append(starts, len(stretch)))
        level_db = np.add.reduceat(level_db, starts, axis=0) / np.maximum(count, 1.0)
        heard = count / samples[:, None]
        behind_m = np.add.reduceat(behind_m, starts) / samples
    return Evidence(behind_m, level_db, heard, sample_weight(behind_m))


def sample_weight(behind_m: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " samples"]:
    """Each sample's share of `CORRELATION_M` of road, at most 1: half the way to either side."""
    if len(behind_m) == 1:
        return np.ones(1)
    share_m = np.empty(len(behind_m))
    gap_m = behind_m[1:] - behind_m[:-1]
    share_m[:-1] = gap_m
    share_m[-1] = gap_m[-1]
    share_m[1:-1] = 0.5 * (behind_m[2:] - behind_m[:-2])
    return np.minimum(share_m * (1.0 / CORRELATION_M), 1.0)


def coefficients(seen: Evidence) -> Float32[np.ndarray, "channels samples rows"]:
    """
    The window's side of the likelihood: what multiplies each of a profile's rows.

    Three channels: the score, the weighted residual and the weight, per sample. Rows are the four
    terms of each cell of the window, then the base, then "outside the road".
    """
    samples, count = seen.heard.shape
    heard = seen.heard * seen.weight[:, None]
    heard_level = heard * seen.rsrp_db
    out = np.zeros((CHANNELS, samples, count * TERMS + 2), dtype=np.float32)
    by_cell = out[:, :, :-2].reshape(CHANNELS, samples, count, TERMS)
    by_cell[0, :, :, 0] = -0.5 * heard_level * seen.rsrp_db
    by_cell[0, :, :, 1] = heard_level
    by_cell[0, :, :, 2] = -0.5 * heard
    by_cell[0, :, :, 3] = HEARING_WEIGHT * heard
    by_cell[1, :, :, 0] = heard_level
    by_cell[1, :, :, 1] = -heard
    by_cell[2, :, :, 0] = heard
    out[0, :, -2] = HEARING_WEIGHT * seen.weight
    out[0, :, -1] = (HEARING_WEIGHT * np.log(OUTSIDE_HEARD)) * heard.sum(axis=1)
    return out


def marginal_score(
    channels: Float[np.ndarray, "3 positions"], offset_sd_db: float
) -> Float[np.ndarray, " positions"]:
    """
    Log likelihood with the device offset integrated out.

    The prior is a mixture: like the survey's devices, ``N(0, offset_sd_db^2)``, or any device,
    ``N(0, BROAD_OFFSET_SD_DB^2)``. With the score ``S``, residual ``R`` and weight ``W`` of
    `coefficients`, each part gives ``S + R^2 v / (2 (1 + W v)) - log(1 + W v) / 2``.
    """
    return np.asarray(channels[0] + offset_gain(channels[1], channels[2], offset_sd_db))


def offset_gain(
    residual: Float[np.ndarray, " positions"],
    weight: Float[np.ndarray, " positions"],
    offset_sd_db: float,
) -> Float[np.ndarray, " positions"]:
    """What integrating the device offset out adds to the score; see `marginal_score`."""
    (like_sd_db, like), (any_sd_db, unlike) = _offset_prior(offset_sd_db)
    like_variance, any_variance = like_sd_db**2, any_sd_db**2
    like_inflation, any_inflation = 1.0 + weight * like_variance, 1.0 + weight * any_variance
    squared = 0.5 * residual * residual
    first = squared * (like_variance / like_inflation) - 0.5 * np.log(like_inflation)
    second = squared * (any_variance / any_inflation) - 0.5 * np.log(any_inflation)
    return np.asarray(np.logaddexp(first + np.log(like), second + np.log(unlike)))


def offset_db(residual: float, weight: float, offset_sd_db: float) -> float:
    """Mean of the device offset given the residual and weight at one place, in dB."""
    values, logs = [], []
    for sd_db, share in _offset_prior(offset_sd_db):
        inflation = 1.0 + weight * sd_db**2
        values.append(residual * sd_db**2 / inflation)
        logs.append(
            np.log(share) + 0.5 * residual**2 * sd_db**2 / inflation - 0.5 * np.log(inflation)
        )
    odds = np.exp(np.array(logs) - max(logs))
    return float(np.dot(values, odds) / odds.sum())


def _offset_prior(offset_sd_db: float) -> tuple[tuple[float, float], tuple[float, float]]:
    return (
        (max(offset_sd_db, 1e-3), 1.0 - BROAD_OFFSET_SHARE),
        (max(BROAD_OFFSET_SD_DB, offset_sd_db), BROAD_OFFSET_SHARE),
    )
