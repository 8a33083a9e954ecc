"""
Windows whose odometer is a few per cent off.

Tyres, slip and wheel counts make a vehicle's metres longer or shorter than the map's by a factor
that holds for a whole window and that nobody reports. Each of a few factors is a hypothesis of its
own: about the places that carry mass the window is laid again with its distances multiplied, and
the places of all factors share the posterior by the factors' prior. Where the place is known no
better than the factor could move it there is nothing to tell, and nothing is laid again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.numerics import native
from app.numerics.index import MapIndex
from app.numerics.observation import Evidence
from app.numerics.posterior import Places
from app.numerics.query import Query
from app.numerics.refinement import refine_each
from app.numerics.stretches import Stretch, lay

SCALE_SD = 0.03  # of odometers that err at all: worn tyres, wrong ones, slip
EXACT = 0.7  # share of odometers that do not, before anything is seen
FINE_SDS = (-1.6, -0.8, 0.8, 1.6)
ROUGH_SDS = (-(3.0**0.5), 3.0**0.5)  # Gauss and Hermite's with the middle: exact for wide peaks
ROUGH_SHARE = 1.0 / 6.0  # of each of these
FINE_FROM = 1.0  # of a peak's width that one standard deviation moves the oldest sample by
ROUGH_FROM = 0.25  # less than this part of it is no news
WITHIN = 0.5  # a peak is as wide as its places whose score over temperature lies so near the best
LIGHTEST = 4.0  # places so far under the best carry next to nothing
MOST_M = 400.0  # of road that is looked at again: a window that fits everywhere tells no factor


@dataclass(frozen=True, slots=True)
class Factor:
    """What the window's distances are multiplied by, and the log of its share."""

    value: float
    log_share: float


@dataclass(frozen=True, slots=True)
class Factors:
    """The factors other than 1, and the log of the share of 1."""

    others: tuple[Factor, ...]
    exact_log: float

    @classmethod
    def rough(cls) -> Factors:
        """Two, for peaks about as wide as the factors move them."""
        share = (1.0 - EXACT) * ROUGH_SHARE
        return cls._of(ROUGH_SDS, np.full(len(ROUGH_SDS), share))

    @classmethod
    def fine(cls) -> Factors:
        """Four, for peaks that are narrower."""
        density = np.exp(-0.5 * np.square(FINE_SDS))
        return cls._of(FINE_SDS, (1.0 - EXACT) * density / (1.0 + density.sum()))

    @classmethod
    def _of(cls, sds: tuple[float, ...], share: Float[np.ndarray, " factors"]) -> Factors:
        told = zip(sds, np.log(share).tolist(), strict=True)
        others = tuple(Factor(1.0 + SCALE_SD * sd, log) for sd, log in told)
        return cls(others, float(np.log1p(-share.sum())))


FINE, ROUGH = Factors.fine(), Factors.rough()


def multiplied(query: Query, factor: float) -> Query:
    """The window with its travelled distances so much longer; what its samples weigh stays."""
    seen, told = query.fine, query.told
    if told is None:
        behind_m = seen.behind_m * factor
    else:
        block = told.block.copy()
        behind_m = block[: told.samples]
        behind_m *= factor
        told = native.Told(block, told.samples)
    fine = Evidence(behind_m, seen.rsrp_db, seen.heard, seen.share, seen.weight)
    return Query(query.cells, query.unknown, query.samples, fine, told)


def factors_for(query: Query, places: Places, temperature: float) -> Factors | None:
    """
    Which factors are worth a look.

    Args:
        places: Along single roads, the window taken at its word.
        temperature: What scores are divided by.
    """
    moved_m = SCALE_SD * query.length_m
    near = places.score >= places.score.max() - WITHIN * temperature
    width_m = float(places.width_m[near].sum())
    if moved_m < ROUGH_FROM * width_m:
        return None
    return FINE if moved_m > FINE_FROM * width_m else ROUGH


@dataclass(frozen=True, slots=True, eq=False)
class Others:
    """
    Places of a window under factors other than 1.

    Attributes:
        log_share: Of each place's factor.
        exact_log: Log of the share of the factor 1.
    """

    places: Places
    log_share: Float[np.ndarray, " places"]
    exact_log: float


def under_other_factors(index: MapIndex, query: Query, places: Places) -> Others | None:
    """
    The window with its distances multiplied, about the places that carry mass.

    Args:
        places: Along single roads, the window taken at its word.

    Returns:
        None where no factor could be told.
    """
    temperature = query.temperature(index.calibration)
    factors = factors_for(query, places, temperature)
    stretches = _stretches(index, query, places, temperature) if factors is not None else []
    if factors is None or not stretches:
        return None
    queries = [multiplied(query, one.value) for one in factors.others]
    laid, count = refine_each(index, queries, lay(index, queries, stretches))
    log_share = np.repeat([one.log_share for one in factors.others], count)
    return Others(laid, log_share, factors.exact_log)


def _stretches(index: MapIndex, query: Query, places: Places, temperature: float) -> list[Stretch]:
    """Stretches about the places that carry mass; none when they are longer than `MOST_M`."""
    heavy = (places.score >= places.score.max() - LIGHTEST * temperature).nonzero()[0]
    reach_m = -ROUGH_SDS[0] * SCALE_SD * query.length_m
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
