"""
The device's offset: unknown, the same for a whole window, and integrated out.

A vehicle's phone reads every cell louder or softer than the surveys' phones by one offset ``b``.
Groups of cells may have an offset of their own on top. Where a map has several carriers each of
them is a group, as antennas and receivers differ from band to band. Where it has but one each cell
is, as it may have changed since the survey; whether that is so nobody knows beforehand, and places
count under both hypotheses. With residual ``R`` and weight ``W`` of a place (the slope of its log
likelihood in the offset, and minus its curvature) an offset of variance ``v`` adds
``R^2 v / (2 (1 + W v)) - log(1 + W v) / 2`` and leaves ``R / (1 + W v)`` and ``W / (1 + W v)`` to
those that all groups share.

Samples of a window are not independent, which is why its scores are divided by a temperature
``T``. What is known of devices has nothing to do with that: the prior meets readings that are
tempered already, ``R / T`` and ``W / T``, and what it adds is multiplied by ``T``, since the score
is divided by it in the end. Were the whole integral divided instead, an honest prior of 1 dB
would allow offsets ``sqrt(T)`` times as large, and most of what levels say would be lost to them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

BROAD_OFFSET_SD_DB = 6.0  # devices differ by up to 8 dB
BROAD_OFFSET_SHARE = 0.3  # how often a device is unlike those of the surveys
GROUP_OFFSET_SD_DB = 2.0  # of each carrier about the device; chosen on survey passes held out
APART_SHARE = 0.05  # how often cells of one carrier have changed by as much, each for itself


class OffsetPrior(NamedTuple):
    """
    What a device's offset may be: like the surveys' devices, ``N(0, sd^2)``, or any device,
    ``N(0, BROAD_OFFSET_SD_DB^2)``; each part as its variance and the log of its share.

    Attributes:
        group_db2: Variance of each group's own offset.
        apart: How often groups have offsets of their own: always, or the share of a hypothesis.
        temperature: Of the window that is asked about.
    """

    like_db2: float
    like_log: float
    any_db2: float
    any_log: float
    group_db2: float = 0.0
    apart: float = 1.0
    temperature: float = 1.0

    @classmethod
    def learnt(cls, offset_sd_db: float, carriers: int = 1) -> OffsetPrior:
        """
        The prior of a map whose survey devices differ by ``offset_sd_db``.

        Args:
            carriers: How many the map has.
        """
        return cls(
            max(offset_sd_db, 1e-2) ** 2,
            float(np.log(1.0 - BROAD_OFFSET_SHARE)),
            max(BROAD_OFFSET_SD_DB, offset_sd_db) ** 2,
            float(np.log(BROAD_OFFSET_SHARE)),
            GROUP_OFFSET_SD_DB**2,
            1.0 if carriers > 1 else APART_SHARE,
        )

    def at(self, temperature: float) -> OffsetPrior:
        """The same for a window of this temperature."""
        return OffsetPrior(*self[:-1], temperature)


class Taken(NamedTuple):
    """
    What the offsets took.

    Attributes:
        gain: What they add to the score.
        residual, weight: What is left to the device's; where groups may have none of their own,
            what there is if they have not.
        apart: Probability that groups have offsets of their own.
    """

    gain: Float[np.ndarray, " places"]
    residual: Float[np.ndarray, " places"]
    weight: Float[np.ndarray, " places"]
    apart: Float[np.ndarray, " places"]


def take_offsets(sums: Float[np.ndarray, "sums places"], prior: OffsetPrior) -> Taken:
    """
    Integrate out each group's offset, then the device's.

    Args:
        sums: Residual and weight of the first group, of the second, and so on.

    Returns:
        Gains in units of the score: before the temperature.
    """
    temperature, variance = prior.temperature, prior.group_db2 / prior.temperature
    inflation = 1.0 + sums[1::2] * variance
    gains = 0.5 * variance * sums[::2] ** 2 / inflation - 0.5 * temperature * np.log(inflation)
    residual, weight = (sums[::2] / inflation).sum(axis=0), (sums[1::2] / inflation).sum(axis=0)
    gain = gains.sum(axis=0) + offset_gain(residual, weight, prior)
    if prior.apart == 1.0:
        return Taken(gain, residual, weight, np.ones(len(gain)))
    all_residual, all_weight = sums[::2].sum(axis=0), sums[1::2].sum(axis=0)
    together = offset_gain(all_residual, all_weight, prior) / temperature + np.log1p(-prior.apart)
    apart = gain / temperature + np.log(prior.apart)
    both = np.logaddexp(together, apart)
    return Taken(temperature * both, all_residual, all_weight, np.exp(apart - both))


def offset_gain(
    residual: Float[np.ndarray, " places"], weight: Float[np.ndarray, " places"], prior: OffsetPrior
) -> Float[np.ndarray, " places"]:
    """What integrating the device's offset out adds to the score; both parts mixed by shares."""
    cooled = 1.0 / prior.temperature
    squared = 0.5 * residual * residual * cooled
    like_db2, any_db2 = prior.like_db2 * cooled, prior.any_db2 * cooled
    like, broad = weight * like_db2 + 1.0, weight * any_db2 + 1.0
    first = squared * (like_db2 / like) - 0.5 * np.log(like) + prior.like_log
    second = squared * (any_db2 / broad) - 0.5 * np.log(broad) + prior.any_log
    return np.asarray(prior.temperature * np.logaddexp(first, second))


def offset_gain_at(residual: float, weight: float, prior: OffsetPrior) -> float:
    """`offset_gain` at one place."""
    first, _, second, _ = _offset_parts(residual, weight, prior)
    return prior.temperature * (max(first, second) + math.log1p(math.exp(-abs(first - second))))


def offset_db(residual: float, weight: float, prior: OffsetPrior) -> float:
    """Mean of the device offset given the residual and weight at one place, in dB."""
    first_log, first_db, second_log, second_db = _offset_parts(residual, weight, prior)
    odds = math.exp(max(min(second_log - first_log, 50.0), -50.0))
    return (first_db + odds * second_db) / (1.0 + odds)


def _offset_parts(
    residual: float, weight: float, prior: OffsetPrior
) -> tuple[float, float, float, float]:
    """Of each part of the prior: the log of what it adds to the likelihood, and its mean in dB."""
    cooled = 1.0 / prior.temperature
    squared, like_db2, any_db2 = 0.5 * residual**2 * cooled, prior.like_db2, prior.any_db2
    like, broad = 1.0 + weight * like_db2 * cooled, 1.0 + weight * any_db2 * cooled
    like_db2, any_db2 = like_db2 * cooled / like, any_db2 * cooled / broad
    return (
        prior.like_log + squared * like_db2 - 0.5 * math.log(like),
        residual * like_db2,
        prior.any_log + squared * any_db2 - 0.5 * math.log(broad),
        residual * any_db2,
    )


def group_offsets_db(
    sums: Float[np.ndarray, " sums"], device_db: float, apart: float, prior: OffsetPrior
) -> Float[np.ndarray, " groups"]:
    """
    Mean offset of each group at one place, the device's own included.

    Args:
        sums: As `take_offsets` has them.
        device_db: Offset of the device, from `offset_db`.
        apart: Probability that groups have offsets of their own, from `take_offsets`.
    """
    spread = prior.group_db2 / prior.temperature
    own = (sums[::2] - sums[1::2] * device_db) * spread / (1.0 + sums[1::2] * spread)
    return np.asarray(device_db + apart * own)
