"""
Whether a window's levels are this road's: a Bayes factor at the place where it fits best.

Scores of places count readings as if each erred for itself. Against other roads that says too
little and too much: what has changed since the survey changes slowly along the road, and so does
the shadowing of a road that is another. Here the same readings meet three laws:

    this road   y = mu(s) + offset + drift + noise
    another     y = mean of mu(s) over the window + offset + shadowing + noise
    any road    see `app.numerics.elsewhere`

with drift ``N(0, sd^2 exp(-d / length))`` and shadowing likewise, each of a cell's own, and noise
``N(0, sigma(s)^2)``. How much has drifted since the survey nobody knows beforehand, mostly little,
now and then much; nor whether the device is noisier than the surveys' were. Another road is one of
the same means: of a city that has the same cell names and sites. The factor is the likelihood of
this road over that of a mixture of the others and of no law
(`app.numerics.elsewhere.or_featureless`). Cells that the road has not mapped, and readings from
beyond its ends, say nothing here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from app.numerics import native, native_laws
from app.numerics.elsewhere import Field, filtered, of_any_road, or_featureless
from app.numerics.index import RoadIndex
from app.numerics.observation import BACKGROUND_SPAN_DB, TERMS
from app.numerics.offsets import OffsetPrior, take_offsets
from app.numerics.query import Query

# Chosen on windows of `harsh` and `paper`, seeds 601 to 608: twice or half matters little.
DRIFT = Field(1.2, 100.0)
MUCH_DRIFT = Field(3.0, 100.0)
SHADOWING = Field(6.0, 20.0)
MUCH = 0.1  # how often an area has drifted much
NOISIER = 0.05  # how often a device is noisier than the surveys' were
NOISE_TIMES = 3.0  # its variance then: of twice to five times as much radii hold what they say
DRIFT_TIMES = 2.4  # what readings miss a road by that has drifted much, as a variance likewise
WORTH_TELLING = 1.05  # times the surveys' variance: less than that is none
ANOTHER = 0.01  # how often a stranger's means are the road's own
BACKGROUND_LOG = math.log(BACKGROUND_SPAN_DB) - 0.5 * math.log(2.0 * math.pi)
KERNEL_LAWS = (*DRIFT.law, *MUCH_DRIFT.law, *SHADOWING.law, NOISE_TIMES, BACKGROUND_LOG)
MUCH_LOG, NOISIER_LOG = math.log(MUCH), math.log(NOISIER)
LITTLE_LOG = math.log1p(-MUCH - NOISIER)
ANOTHER_LOG, ANY_LOG = math.log(ANOTHER), math.log1p(-ANOTHER)


class Likelihoods(NamedTuple):
    """
    Logs of how probable levels are under each law, against the background.

    Attributes:
        here, drifted: On this road, drifted little and much.
        noisier: On this road, drifted little, read by a noisier device.
        another: On another road of the same means.
        any_road: On any.
    """

    here: float
    drifted: float
    noisier: float
    another: float
    any_road: float

    def judged(self) -> tuple[float, float]:
        """
        The log of the factor, of this road against the others, and the noise: how many times the
        surveys' variance readings have here, expected, as the device is noisier or the area has
        drifted; 1 where that is hardly more.
        """
        here, drifted = LITTLE_LOG + self.here, MUCH_LOG + self.drifted
        noisier = NOISIER_LOG + self.noisier
        most = max(here, drifted, noisier)
        shares = math.exp(here - most), math.exp(drifted - most), math.exp(noisier - most)
        times = (shares[0] + DRIFT_TIMES * shares[1] + NOISE_TIMES * shares[2]) / sum(shares)
        any_road, another = ANY_LOG + self.any_road, ANOTHER_LOG + self.another
        others = max(any_road, another) + math.log1p(math.exp(-abs(any_road - another)))
        log_factor = most + math.log(sum(shares)) - or_featureless(others)
        return log_factor, times if times > WORTH_TELLING else 1.0


class OnRoad(NamedTuple):
    """
    A place on a road, as the kernels take it.

    Attributes:
        low: Grid position below it, with another one above.
        share: Of the way to that.
        sign: +1 for travel towards growing chainage, else -1.
        step_m: Of the road's grid.
        factor: What the window's distances are multiplied by.
    """

    low: int
    share: float
    sign: int
    step_m: float
    factor: float = 1.0

    @classmethod
    def of(cls, road: RoadIndex, sign: int, chainage_m: float, factor: float = 1.0) -> OnRoad:
        """Where a chainage lies on a road."""
        at = chainage_m / road.step_m
        low = min(int(at), road.grid_size - 2)
        return cls(low, min(at - low, 1.0), sign, road.step_m, factor)


def weigh(
    query: Query,
    road: RoadIndex,
    sign: int,
    chainage_m: float,
    prior: OffsetPrior,
    factor: float = 1.0,
) -> Likelihoods:
    """
    What each law makes of a window's levels at a place.

    Args:
        sign, chainage_m: Where on the road it fits best.
        prior: Of the device's offset, for this window.
        factor: What its distances are multiplied by where it fits best.
    """
    at, temperature = OnRoad.of(road, sign, chainage_m, factor), min(prior.temperature, 1.0)
    devices = prior.at(max(prior.temperature, 1.0))
    if query.told is None:
        return log_likelihoods(query, road, at, temperature, devices)
    return Likelihoods(
        *native_laws.log_likelihoods(
            query.aimed(query.told, road.column),
            road.along.rows,
            at,
            (*KERNEL_LAWS, temperature),
            native.likelihood(devices),
        )
    )


def log_likelihoods(
    query: Query, road: RoadIndex, at: OnRoad, temperature: float, devices: OffsetPrior
) -> Likelihoods:
    """
    What each law makes of the levels.

    Args:
        temperature: Of the window, 1 at most: each reading counts for its weight over it.
        devices: What the device's offset may be, where readings count for so much.
    """
    query = query.multiplied(at.factor)
    seen = query.fine
    mean_db, precision = _expected(query, road, at)
    count = np.where(precision > 0.0, seen.heard * (seen.weight[:, None] / temperature), 0.0)
    noise = count * (BACKGROUND_LOG + 0.5 * np.log(np.where(precision > 0.0, precision, 1.0)))
    about_db = (count * mean_db).sum(axis=0) / np.maximum(count.sum(axis=0), 1e-9)
    here, drifted, noisier, another = (
        float((noise - 0.5 * math.log(times) * count).sum())
        + _settled(query, expected_db, count * precision / times, field, devices)
        for expected_db, field, times in (
            (mean_db, DRIFT, 1.0),
            (mean_db, MUCH_DRIFT, 1.0),
            (mean_db, DRIFT, NOISE_TIMES),
            (about_db, SHADOWING, 1.0),
        )
    )
    any_road = of_any_road(seen.behind_m, seen.rsrp_db, count)
    return Likelihoods(here, drifted, noisier, another, any_road)


def _expected(
    query: Query, road: RoadIndex, at: OnRoad
) -> tuple[Float[np.ndarray, "samples cells"], Float[np.ndarray, "samples cells"]]:
    """Level above the centre and precision of every reading; 0 where the road expects none."""
    behind = np.rint(query.fine.behind_m / road.step_m).astype(np.intp)
    column = at.low + 1 - at.sign * behind
    inside = (column >= 1) & (column < road.grid_size)
    low = np.where(inside, column, 1)
    numbers = np.array(query.numbers(road.column), dtype=np.intp)
    row = np.where(numbers >= 0, numbers, 0) * TERMS
    (here, there), (here_db, there_db) = (
        [road.along.rows[row + term, (low + step)[:, None]].astype(float) for step in (0, 1)]
        for term in (0, 1)
    )
    mapped = inside[:, None] & (numbers >= 0) & (here > 0.0) & (there > 0.0)
    here, there = np.where(mapped, here, 1.0), np.where(mapped, there, 1.0)
    level_db = here_db / here + at.share * (there_db / there - here_db / here)
    precision = here + at.share * (there - here)
    return np.where(mapped, level_db, 0.0), np.where(mapped, precision, 0.0)


def _settled(
    query: Query,
    expected_db: Float[np.ndarray, "..."],
    precision: Float[np.ndarray, "samples cells"],
    field: Field,
    devices: OffsetPrior,
) -> float:
    """Log likelihood of a field about what is expected, offsets integrated out."""
    seen = query.fine
    sums = filtered(seen.behind_m, seen.rsrp_db - expected_db, precision, field)
    groups = np.zeros((int(query.group.max(initial=0)) + 1, 2, 1))
    np.add.at(groups[:, 0, 0], query.group, sums.residual)
    np.add.at(groups[:, 1, 0], query.group, sums.weight)
    gain = take_offsets(groups.reshape(-1, 1), devices).gain
    return float(gain[0]) - 0.5 * float((sums.squares + sums.log).sum())
