"""
Windows whose odometer is a few per cent off.

Tyres, slip and wheel counts make a vehicle's metres longer or shorter than the map's by a factor
that holds for a whole window. A window may say how far its distances err; of most nobody knows.
Each of a few factors is a hypothesis of its own: about the places that carry mass the window is
laid again with its distances multiplied, and the places of all factors share the posterior by the
factors' prior. A place that is not laid again is as likely under each of them as it is at its word.
Where the place is known no better than the factor could move it there is nothing to tell, and
nothing is laid again. Some odometers err by far more than most: factors beyond the usual ones are
looked at on the side where the outermost of these fits about as well as any.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float

from app.numerics import native, native_factors
from app.numerics.index import MapIndex
from app.numerics.posterior import Known, Places, raised
from app.numerics.query import Query
from app.numerics.refinement import AROUND, MIN_ROW, MOST_ROWS, PARTS, refine_each
from app.numerics.refinement import LIGHTEST as DRAWN_FROM
from app.numerics.stretches import Stretch, lay

# Where nobody said: some odometers are exact, most err by worn tyres or slip, others by far more
SCALE_SD, FAR_SD = 0.03, 0.07
ERR, ERR_FAR = 0.35, 0.3  # shares of these; the rest are exact
import os

APW, APM, MST = (
    float(os.environ.get("APW", "1.5")),
    float(os.environ.get("APM", "1.0")),
    int(os.environ.get("MST", "12")),
)
FINE_REACH = 1.8  # standard deviations to either side
FINE_STEPS = 2.0 / SCALE_SD  # to either side, of each unit of a standard deviation
FARTHER_REACH = 3.6  # of those that are looked at on one side
FARTHER_FROM = 2.0  # under the best by the logarithm: where the outermost factor's best place is
ROUGH_SDS = (-(3.0**0.5), 3.0**0.5)  # Gauss and Hermite's with the middle: exact for wide peaks
ROUGH_SHARE = 1.0 / 6.0  # of each of these
ROUGH_ERR = 0.8  # share of odometers that err, as wide peaks see it: far ones for more
APART_WIDTHS, APART_M, MOST_STEPS = APW, APM, MST
FINE_FROM = 1.0  # of a peak's width that one standard deviation moves the oldest sample by
ROUGH_FROM = 0.25  # less than this part of it is no news
WITHIN = 0.5  # a peak is as wide as its places whose score over temperature lies so near the best
LIGHTEST = 4.0  # places so far under the best carry next to nothing
MOST_M = 400.0  # of road that is looked at again: a window that fits everywhere tells no factor


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


def _rough(scale_sd: float, err: float) -> Factors:
    return Factors.of(1.0 + scale_sd * np.array(ROUGH_SDS), np.full(2, err * ROUGH_SHARE))


def _shares(sds: Float[np.ndarray, " factors"]) -> Float[np.ndarray, " factors"]:
    """Of a normal prior, that of each factor, so many standard deviations away; the rest is 1's."""
    density = np.exp(-0.5 * sds**2)
    return np.asarray(density / (1.0 + density.sum()))


def factors_for(query: Query, width_m: float) -> Looked | None:
    """
    Which factors are worth a look.

    Args:
        width_m: Of the window's peak.
    """
    scale_sd = scale_sd_of(query.distance_error)
    moved_m = scale_sd * query.length_m
    if moved_m == 0.0 or moved_m < ROUGH_FROM * width_m:
        return None
    if moved_m <= FINE_FROM * width_m:
        return rough_factors(query.distance_error)
    least = max(math.ceil(scale_sd * FINE_STEPS - 1e-9), 2)
    apart_m = max(APART_WIDTHS * width_m, APART_M)
    return fine_factors(
        query.distance_error, max(least, min(math.ceil(FINE_REACH * moved_m / apart_m), MOST_STEPS))
    )


@dataclass(frozen=True, slots=True, eq=False)
class Others:
    """
    Places of a window under factors other than 1, after those that were there before.

    Attributes:
        known: Of the new places.
        together: The log prior of places that were there before and stand for every factor.
    """

    places: Places
    known: Known
    together: float


def under_other_factors(
    index: MapIndex, query: Query, straight: Places, before: Places
) -> Others | None:
    """
    The window with its distances multiplied, about the places that carry mass.

    Args:
        straight: Along single roads, the window taken at its word.
        before: What the new places are to follow: those along single roads, then any others.

    Returns:
        None where no factor could be told.
    """
    temperature = query.temperature(index.calibration)
    if query.told is not None:
        return _in_c(index, query, query.told, temperature, straight, before)
    looked = factors_for(query, peak_width_m(straight, temperature))
    stretches = [] if looked is None else stretches_about(index, query, straight, temperature)
    if looked is None or not stretches:
        return None
    factors = looked.near
    queries = [query.multiplied(value) for value in factors.value.tolist()]
    parts = [lay(index, one, stretches) for one in queries]
    best = np.array([float(one.score.max()) for one in parts]) / temperature
    top = float(before.score.max()) / temperature
    more = farther_of(looked, best + factors.log_prior, top)
    if more is not None:
        beyond = [query.multiplied(value) for value in more.value.tolist()]
        parts += [lay(index, one, stretches) for one in beyond]
        queries, factors = queries + beyond, factors.and_then(more)
    laid, count = refine_each(index, queries, Places.join(parts))
    log_prior = np.repeat(factors.log_prior, count)
    standing = np.ones(len(before), dtype=bool)
    standing[: len(straight)] = ~_within(index, straight, stretches)
    weighed = raised(before, temperature * factors.together * standing)
    laid = raised(laid, temperature * log_prior)
    known = Known(log_prior, np.repeat(factors.value, count))
    return Others(Places.join((weighed, laid)), known, factors.together)


def farther_of(
    looked: Looked, log_best: Float[np.ndarray, " factors"], top: float
) -> Factors | None:
    """
    The factors beyond the near ones, on the side where these fit best.

    Args:
        log_best: Log posterior of the best place under each near factor, up to a constant.
        top: The same of the window taken at its word.
    """
    if looked.farther is None:
        return None
    low, high = log_best[[0, -1]].tolist()
    if max(low, high) < max(top, float(log_best.max())) - FARTHER_FROM:
        return None
    return looked.farther[0 if low >= high else 1]


def _within(
    index: MapIndex, places: Places, stretches: Sequence[Stretch]
) -> Bool[np.ndarray, " places"]:
    """Which of the places lie along a stretch, or by half a step beyond it."""
    found = np.zeros(len(places), dtype=bool)
    for number, sign, first, last in stretches:
        at = places.chainage_m * (1.0 / index.roads[number].step_m)
        along = (places.road == number) & (places.sign == sign)
        found |= along & (at >= first - 0.5) & (at <= last + 0.5)
    return found


def _in_c(
    index: MapIndex,
    query: Query,
    told: native.Told,
    temperature: float,
    straight: Places,
    before: Places,
) -> Others | None:
    """The same with the kernels in C."""
    atlas, moved_m = index.atlas, scale_sd_of(query.distance_error) * query.length_m
    near = (WITHIN * temperature, LIGHTEST * temperature)
    limits = (moved_m / ROUGH_FROM, -ROUGH_SDS[0] * moved_m, MOST_M)
    width_m, found = native_factors.stretches_about(
        straight, (atlas.step_m, atlas.size), near, limits
    )
    looked = factors_for(query, width_m)
    if looked is None or not found:
        return None
    stretches = []
    for one in found:
        road = index.roads[one[0]]
        along, cells = road.along, query.numbers(road.column)
        stretches.append((along.rows, along.bend, cells, *one, road.step_m, road.length_m))
    every = looked.every
    far = len(every.value) - len(looked.near.value)
    priors = (every.value, every.log_prior, temperature, far, FARTHER_FROM)
    drawn = (atlas.step_m, DRAWN_FROM * temperature, AROUND, MIN_ROW, MOST_ROWS, PARTS)
    return Others(
        *native_factors.under_factors(
            told, stretches, priors, query.likelihood(index), drawn, (before, len(straight))
        )
    )


def peak_width_m(places: Places, temperature: float) -> float:
    """Metres of road whose score is next to the best."""
    near = places.score >= places.score.max() - WITHIN * temperature
    return float(places.width_m[near].sum())


def stretches_about(
    index: MapIndex, query: Query, places: Places, temperature: float
) -> list[Stretch]:
    """Stretches about the places that carry mass; none when they are longer than `MOST_M`."""
    heavy = (places.score >= places.score.max() - LIGHTEST * temperature).nonzero()[0]
    reach_m = -ROUGH_SDS[0] * scale_sd_of(query.distance_error) * query.length_m
    road, sign = places.where.take(heavy, axis=1).tolist()
    found: list[Stretch] = []
    metres = 0.0
    for number, way, at_m in sorted(
        zip(road, sign, places.chainage_m.take(heavy).tolist(), strict=True)
    ):
        target = index.roads[number]
        first = max(int((at_m - reach_m) / target.step_m), 0)
        last = min(int((at_m + reach_m) / target.step_m) + 1, target.grid_size - 1)
        if found and found[-1][:2] == (number, way) and first <= found[-1][3] + 1:
            metres += (last - found[-1][3]) * target.step_m
            found[-1] = (number, way, found[-1][2], last)
        else:
            metres += (last - first) * target.step_m
            found.append((number, way, first, last))
        if metres > MOST_M:
            return []
    return found
