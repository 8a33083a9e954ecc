"""
What a window says of a place: the likelihood that every matcher shares.

A sample of a vehicle at chainage ``s`` hears cell ``k`` with probability ``p_k(s)`` and reads it as
``N(mu_k(s) + b, sigma_k(s)^2)``, where ``b`` is the offset of device and carrier
(`app.numerics.offsets`). Readings are compared with a featureless background (any level within
50 dB, any cell), so that scores of places that know different cells compare. For one sample the
logarithm is linear in five terms of the map, which is why whole roads are scored by one product:

    sum over heard k of [-1/2 (A y^2 - 2 B y + C) + h (L + S / n)]

with ``A = 1/sigma^2``, ``B = A mu``, ``C = A mu^2 + log(2 pi sigma^2) - 2 log 50``, ``L`` the logit
of ``p_k``, ``S`` the sum over all mapped cells of k's carrier of ``log(1 - p)``, and ``n`` how many
of that carrier's cells the sample heard: silence counts once for each carrier that was heard at all
(`app.numerics.carriers`). ``y`` and ``mu`` are counted from `CENTRE_DBM` so that float32 keeps
every digit that matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from app.numerics import carriers

CENTRE_DBM = -95.0
BACKGROUND_SPAN_DB = 50.0  # phones report some 50 dB of useful RSRP; any level in it is as likely
HEARD_FLOOR = 0.02  # a cell may appear, or fail to, wherever the survey says otherwise
HEARING_WEIGHT = 0.45  # hearing is far more alike from sample to sample than levels are
CORRELATION_M = 10.0  # closer samples share shadowing and count as one; the map's temperature, too
OUTSIDE_HEARD = 0.03  # chance of a reading off the road: windows rarely begin on another one

TERMS = 5  # A, B, C, L, S: see the module's text


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """
    Expected readings along a stretch, ready for scoring.

    Attributes:
        rows: A, B, C, L and S of every cell, cell after cell, those of each carrier's stand-in last
            (`app.numerics.carriers.columns_of`), then "outside": 1 where there is no road. Shape
            ``(5 cells + 1, columns)``.
        bend: ``A (mu_next - mu)^2 / 2`` of every cell from each column to the next: by how much a
            place between the two fits better than its neighbours' mean, times ``f (1 - f)``.
            Shape ``(cells, columns)``.
    """

    rows: Float32[np.ndarray, "rows columns"]
    bend: Float32[np.ndarray, "cells columns"]

    @property
    def columns(self) -> int:
        """Number of columns, those outside the road included."""
        return int(self.rows.shape[1])


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """
    A window made ready: one row a stretch of road with readings, newest first.

    Attributes:
        behind_m: Travelled distance from each sample to the window's end. Shape ``(samples,)``.
        rsrp_db: Mean reading above `CENTRE_DBM`, 0 where not heard. Shape ``(samples, cells)``.
        heard: Share of the sample's readings that heard the cell, 0..1, same shape.
        share: The cell's part of all that the sample heard of its carrier, times what silence of
            the others counts for: 1, or less where a device lists few (`app.numerics.listing`).
            Those of a carrier sum to that, or to 0 where it was not heard.
        weight: How much each sample counts, 0..1, for the shadowing it shares with its neighbours.
    """

    behind_m: Float[np.ndarray, " samples"]
    rsrp_db: Float[np.ndarray, "samples cells"]
    heard: Float[np.ndarray, "samples cells"]
    share: Float[np.ndarray, "samples cells"]
    weight: Float[np.ndarray, " samples"]


def profile(
    cells: Sequence[str],
    mean_dbm: Float[np.ndarray, "columns cells"],
    spread_db: Float[np.ndarray, "columns cells"],
    heard: Float[np.ndarray, "columns cells"],
    outside: Bool[np.ndarray, " columns"],
    others: Sequence[str] = (),
) -> Profile:
    """
    The map's side of the likelihood.

    Args:
        mean_dbm, spread_db: Expected level and its spread; NaN where the cell is not mapped.
        heard: Probability of hearing the cell, given that its carrier is heard; where the cell is
            not mapped, see `app.numerics.hearing.stranger_chance`.
        outside: Columns that are no road; everything else about them must be NaN.
        others: Carriers of other roads.
    """
    mapped = ~np.isnan(mean_dbm)
    variance = np.where(mapped, spread_db, 1.0) ** 2
    level_db = np.where(mapped, mean_dbm, CENTRE_DBM) - CENTRE_DBM
    precision = np.where(mapped, 1.0 / variance, 0.0)
    normaliser = np.log(variance * (2.0 * np.pi)) - 2.0 * np.log(BACKGROUND_SPAN_DB)
    carrier = carriers.numbers(cells)
    strange = carriers.unmapped_chance(heard, mean_dbm, carrier, HEARD_FLOOR)
    chance = np.clip(np.where(mapped, heard, strange[:, carrier]), HEARD_FLOOR, 1.0 - HEARD_FLOOR)
    silent = np.where(mapped, np.log1p(-chance), 0.0)
    of_carrier = np.eye(strange.shape[1])[carrier]
    silence, road = silent @ of_carrier, ~outside[:, None]
    terms = [
        precision,
        precision * level_db,
        precision * level_db**2 + np.where(mapped, normaliser, 0.0),
        np.where(road, logit(chance), 0.0),
        np.where(road, silence[:, carrier], 0.0),
    ]
    columns, count = mean_dbm.shape
    stand_ins = len(carriers.carriers_of(cells, others))
    rows = np.zeros((TERMS * (count + stand_ins) + 1, columns), dtype=np.float32)
    for term, values in enumerate(terms):
        rows[term : TERMS * count : TERMS] = values.T
    unknown = np.full((columns, stand_ins - strange.shape[1]), carriers.NOTHING_KNOWN)
    logits = logit(np.concatenate((strange, unknown), axis=1))
    rows[TERMS * count + 3 : -1 : TERMS] = np.where(road, logits, 0.0).T
    rows[TERMS * count + 4 : TERMS * (count + strange.shape[1]) : TERMS] = np.where(
        road, silence, 0.0
    ).T
    rows[-1] = outside
    bend = np.zeros((count + stand_ins, columns), dtype=np.float32)
    between = mapped[:-1] & mapped[1:]
    steps_db = np.diff(level_db, axis=0)
    bend[:count, :-1] = np.where(between, 0.5 * precision[:-1] * steps_db**2, 0.0).T
    return Profile(rows, bend)


def logit(chance: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Log odds of chances."""
    return np.asarray(np.log(chance) - np.log1p(-chance))


def evidence(
    distance_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    step_m: float,
    carrier: Int[np.ndarray, " cells"],
) -> Evidence:
    """
    Readings of a window averaged over stretches of ``step_m`` that end at its last sample.

    A standing car's hundred readings of one place become one; the order of the samples within a
    stretch, and of the cells, moves nothing.

    Args:
        carrier: Number of each cell's carrier.
    """
    level_db = rsrp_dbm[::-1] - CENTRE_DBM
    known = level_db == level_db  # noqa: PLR0124  # False for NaN alone, in one pass
    heard = known.astype(float)
    level_db = np.where(known, level_db, 0.0)
    behind_m = distance_m[-1] - distance_m[::-1]
    stretch = np.floor(behind_m / step_m + 0.5)  # of samples each half metre two are one
    change = stretch[1:] != stretch[:-1]
    if not change.all():
        starts = np.concatenate(([0], np.flatnonzero(change) + 1))
        count = np.add.reduceat(heard, starts, axis=0)
        samples = np.diff(np.append(starts, len(stretch)))
        level_db = np.add.reduceat(level_db, starts, axis=0) / np.maximum(count, 1.0)
        heard = count / samples[:, None]
        behind_m = np.add.reduceat(behind_m, starts) / samples
    same = carrier[:, None] == carrier
    share = heard / np.maximum(heard @ same, 1e-12)
    return Evidence(behind_m, level_db, heard, share, sample_weight(behind_m))


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


def coefficients(
    seen: Evidence, group: Int[np.ndarray, " cells"]
) -> Float[np.ndarray, "channels samples rows"]:
    """
    The window's side of the likelihood: what multiplies each of a profile's rows.

    Channels: the score, then of each group the weighted residual and the weight, which
    integrating offsets out needs (`app.numerics.offsets`). Rows are the five terms of each cell of
    the window, then "outside the road".

    Args:
        group: Number of each cell's group.
    """
    samples, count = seen.heard.shape
    heard = seen.heard * seen.weight[:, None]
    heard_level = heard * seen.rsrp_db
    cells, channel = np.arange(count), 1 + 2 * group
    out = np.zeros((1 + 2 * carriers.count(group), samples, count * TERMS + 1))
    by_cell = out[:, :, :-1].reshape(len(out), samples, count, TERMS)
    by_cell[0, :, :, 0] = -0.5 * heard_level * seen.rsrp_db
    by_cell[0, :, :, 1] = heard_level
    by_cell[0, :, :, 2] = -0.5 * heard
    by_cell[0, :, :, 3] = HEARING_WEIGHT * heard
    by_cell[0, :, :, 4] = HEARING_WEIGHT * seen.weight[:, None] * seen.share
    by_cell[channel, :, cells, 0] = heard_level.T
    by_cell[channel, :, cells, 1] = -heard.T
    by_cell[channel + 1, :, cells, 0] = heard.T
    out[0, :, -1] = (HEARING_WEIGHT * np.log(OUTSIDE_HEARD)) * heard.sum(axis=1)
    return out
