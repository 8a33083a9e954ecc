"""
What is known beforehand of the odometer that told a window's distances.

A window may say how far its distances err; of most nobody knows: some odometers are exact, most err
by worn tyres or slip, some by far more. The factors that a window is laid under stand for all that
its own may be, each with its share, as close to each other as the window can tell them apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

SCALE_SD, FAR_SD = 0.03, 0.07  # of odometers that err, and that err by far more, where nobody said
ERR, ERR_FAR = 0.35, 0.3  # shares of these; the rest are exact
FINE_REACH, FARTHER_REACH = 1.8, 3.6  # standard deviations to either side, and on one of them
FINE_STEPS = 2.0 / SCALE_SD  # to either side, of each unit of a standard deviation, at least
FEWEST_STEPS, MOST_STEPS = 2, 12  # to either side
APART_WIDTHS, APART_M = 2.0, 0.5  # what factors move the oldest sample by: peak widths, or so much
ROUGH_SDS = (-(3.0**0.5), 3.0**0.5)  # Gauss and Hermite's with the middle: exact for wide peaks
ROUGH_SHARE = 1.0 / 6.0  # of each of these
ROUGH_ERR = 0.8  # share of odometers that err, as wide peaks see it: far ones count for more
FINE_FROM = 1.0  # of a peak's width that one standard deviation moves the oldest sample by
ROUGH_FROM = 0.25  # less than this part of it is no news


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """
    The factors other than 1 that a window's distances may be multiplied by.

    Attributes:
        log_prior: Log of each one's share, against the share of 1.
    """

    value: Float[np.ndarray, " factors"]
    log_prior: Float[np.ndarray, " factors"]

    @property
    def together(self) -> float:
        """Log of all shares, that of 1 included, against the share of 1."""
        return float(np.log1p(np.exp(self.log_prior).sum()))

    @classmethod
    def of(
        cls, value: Float[np.ndarray, " factors"], share: Float[np.ndarray, " factors"]
    ) -> Factors:
        """Factors and their shares of the prior; the rest of it is that of 1."""
        return cls(value, np.log(share) - np.log1p(-share.sum()))

    def take(self, which: slice) -> Factors:
        """Some of them."""
        return Factors(self.value[which], self.log_prior[which])

    def and_then(self, more: Factors) -> Factors:
        """These, and others after them."""
        value = np.concatenate((self.value, more.value))
        return Factors(value, np.concatenate((self.log_prior, more.log_prior)))


@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """
    Which factors a window is laid under.

    Attributes:
        near: By growing value; of all windows.
        farther: Beyond the lowest and beyond the highest of these, as many each, on the side where
            the outermost fits about as well as any; None = there are none.
        every: All of them, those below first of the farther ones.
    """

    near: Factors
    farther: tuple[Factors, Factors] | None
    every: Factors


def scale_sd_of(distance_error: float | None) -> float:
    """
    Spread of an odometer's factor about 1.

    Args:
        distance_error: As the window says; None = it does not, and the odometer is any.
    """
    return SCALE_SD if distance_error is None else distance_error


@lru_cache(maxsize=256)
def rough_factors(distance_error: float | None) -> Looked:
    """Two factors, for peaks about as wide as the factors move them."""
    share = (ROUGH_ERR if distance_error is None else 1.0) * ROUGH_SHARE
    value = 1.0 + scale_sd_of(distance_error) * np.array(ROUGH_SDS)
    near = Factors.of(value, np.full(2, share))
    return Looked(near, None, near)


@lru_cache(maxsize=256)
def fine_factors(distance_error: float | None, steps: int) -> Looked:
    """
    For peaks that are narrower.

    Args:
        steps: Factors to either side, as far as they mostly reach.
    """
    near = np.delete(np.linspace(-FINE_REACH, FINE_REACH, 2 * steps + 1), steps)
    if distance_error is not None:
        known = Factors.of(1.0 + distance_error * near, _shares(near))
        return Looked(known, None, known)
    far = np.linspace(FINE_REACH, FARTHER_REACH, steps + 1)[1:]
    sds = np.concatenate((near, -far[::-1], far))
    share = ERR * _shares(sds) + ERR_FAR * _shares(sds * (SCALE_SD / FAR_SD))
    every = Factors.of(1.0 + SCALE_SD * sds, share)
    ends = len(near), len(near) + len(far)
    farther = every.take(slice(*ends)), every.take(slice(ends[1], None))
    return Looked(every.take(slice(ends[0])), farther, every)


def _shares(sds: Float[np.ndarray, " factors"]) -> Float[np.ndarray, " factors"]:
    """Of a normal prior, that of each factor, so many standard deviations away; the rest is 1's."""
    density = np.exp(-0.5 * sds**2)
    return np.asarray(density / (1.0 + density.sum()))


def factors_for(distance_error: float | None, length_m: float, width_m: float) -> Looked | None:
    """
    Which factors are worth a look; None = none could be told.

    Args:
        length_m: Of the window.
        width_m: Of its peak.
    """
    scale_sd = scale_sd_of(distance_error)
    moved_m = scale_sd * length_m
    if moved_m == 0.0 or moved_m < ROUGH_FROM * width_m:
        return None
    if moved_m <= FINE_FROM * width_m:
        return rough_factors(distance_error)
    apart_m = max(APART_WIDTHS * width_m, APART_M)
    told = min(math.ceil(FINE_REACH * moved_m / apart_m), MOST_STEPS)
    return fine_factors(
        distance_error, max(told, math.ceil(scale_sd * FINE_STEPS - 1e-9), FEWEST_STEPS)
    )
