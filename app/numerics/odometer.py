"""
Windows whose odometer is a few per cent off.

Tyres, slip and wheel counts make a vehicle's metres longer or shorter than the map's by a factor
that holds for a whole window. Each of a few factors is a hypothesis of its own: about the places
that carry mass the window is laid again with its distances multiplied, and the places of all
factors share the posterior by the factors' prior (`app.numerics.odometer_prior`). A place that is
not laid again is as likely under each of them as it is at its word.
Where the place is known no better than the factor could move it there is nothing to tell, and
nothing is laid again. Some odometers err by far more than most: factors beyond the usual ones are
looked at on the side where the outermost of these fits about as well as any.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.numerics import native, native_factors
from app.numerics.index import MapIndex
from app.numerics.odometer_prior import (
    ROUGH_FROM,
    ROUGH_SDS,
    Factors,
    Looked,
    factors_for,
    scale_sd_of,
)
from app.numerics.posterior import Known, Places, raised
from app.numerics.query import Query
from app.numerics.refinement import AROUND, MIN_ROW, MOST_ROWS, PARTS, refine_each
from app.numerics.refinement import LIGHTEST as DRAWN_FROM
from app.numerics.stretches import Stretch, lay

FARTHER_FROM = 2.0  # under the best by the logarithm: where the outermost factor's best place is
WITHIN = 0.5  # a peak is as wide as its places whose score over temperature lies so near the best
LIGHTEST = 4.0  # places so far under the best carry next to nothing
MOST_M = 400.0  # of road that is looked at again: a window that fits everywhere tells no factor


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
    looked = _factors_for(query, peak_width_m(straight, temperature))
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


def _factors_for(query: Query, width_m: float) -> Looked | None:
    return factors_for(query.distance_error, query.length_m, width_m)


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
    looked = _factors_for(query, width_m)
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
