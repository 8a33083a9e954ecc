"""
Whether a window comes from the map's roads at all.

A logistic curve of how well it fits there and how probable its levels are anywhere else, of how
loud the device would have to be and of how much there was to fit, learnt from windows that are on
the map and windows that the map cannot know, see `app.numerics.odds`.
"""

from __future__ import annotations

import math
from operator import mul
from typing import NamedTuple

from app.domain import Calibration
from app.numerics.offsets import APART_SHARE, OffsetPrior, offset_gain_at

LEAST, MOST = 0.3, 40.0  # independent samples; beyond these, nothing is learnt
TYPICAL_DB = 1.0  # devices of one kind differ by about so much
# Which of `off_map_terms` is what; only older maps have learnt the one that grows with size
FIT, SIZE, GROWING, STRANGE, SCORE, ELSEWHERE, FACTOR = range(1, 8)
# Samples of 100 m, weight 10, err each for itself if they say as much as 6; real ones say up to 5
TYPICAL_WEIGHT, INDEPENDENT = 10.0, 6.0
OFF_MAP_PRIOR = 0.02  # share of windows from roads that the map lacks: decision 17


class Fit(NamedTuple):
    """
    How well a window fits the map where it fits best.

    Attributes:
        per_reading: Log likelihood against the background per independent reading, the device's
            offset being what suits best, at no cost.
        offset_db: That offset. Devices differ, but windows of unknown roads need any offset.
        apart: Probability that cells have offsets of their own, where that is not known beforehand:
            windows of unknown roads fit best with any; else 0.
        score: Log likelihood of all readings against the background, offsets by their prior; over
            the window's temperature where samples say more than by their weight.
        weight: Minus the curvature of the undivided score in the device's offset, per dB^2.
        elsewhere: As the score, of the levels on a road of which nothing is known, see
            `app.numerics.elsewhere`.
        factor: How much more probable the levels are on this road than on others, by the logarithm,
            see `app.numerics.this_road`; 0 where samples do not err each for itself.
        noise: How many times the surveys' variance readings have, likewise; else 1.
    """

    per_reading: float
    offset_db: float
    apart: float = 0.0
    score: float = 0.0
    weight: float = 0.0
    elsewhere: float = 0.0
    factor: float = 0.0
    noise: float = 1.0

    def heard_by(self, offset_db: float, prior: OffsetPrior) -> Fit:
        """
        The fit of the same window, had a device of another offset heard it.

        The factor is taken to pay as much for that as the score: that drift might explain a part
        is left out.
        """
        dearer = _offset_cost(offset_db, self.weight, prior)
        dearer -= _offset_cost(self.offset_db, self.weight, prior)
        dearer /= min(prior.temperature, 1.0)
        score, factor = self.score - dearer, self.factor - dearer
        return self._replace(offset_db=offset_db, score=score, factor=factor)


def _offset_cost(offset_db: float, weight: float, prior: OffsetPrior) -> float:
    """By how much a device of the prior fits worse than one of just the offset that suits best."""
    return 0.5 * weight * offset_db**2 - offset_gain_at(weight * offset_db, weight, prior)


def off_map_terms(fit: Fit, information: float) -> tuple[float, ...]:
    """
    What the log odds of being on the map are linear in.

    An offset counts by the logarithm of a Cauchy density of scale `TYPICAL_DB`, large ones hardly
    more than middling ones, and however long the window is: it has one device. Score and evidence
    are, but for what samples share, the two sides of a Bayes factor: this road, or any other. The
    last is one that says what they share, where that is known.
    """
    size = math.log(min(max(information, LEAST), MOST))
    strange = math.log1p((fit.offset_db / TYPICAL_DB) ** 2)
    bayes = (fit.score, fit.elsewhere, fit.factor)
    return 1.0, fit.per_reading, size, fit.per_reading * size, strange, *bayes


def err_apart(learnt: Calibration) -> bool:
    """Whether samples err each for itself, as made-up ones do: by how much a window says."""
    many = 1000  # however closely it was sampled
    return learnt.information(TYPICAL_WEIGHT, many) >= INDEPENDENT


def known_beforehand(fit: Fit) -> float:
    """
    Log odds of being on the map that are not learnt: on the map cells have changed in `APART_SHARE`
    of all cases, off it a window fits best if they may have.
    """
    return math.log(APART_SHARE / (1.0 - APART_SHARE)) * fit.apart


def best_fit(
    sums: tuple[float, float, float, float],
    prior: OffsetPrior,
    readings: float,
    elsewhere: float,
    judged: tuple[float, float],
) -> Fit:
    """
    How well a window fits the map at all.

    Args:
        sums: Score, residual and weight of the best place, and how probably groups are apart there.
        readings: See `app.numerics.query.Query`.
        elsewhere: Log evidence of its levels on any road.
        judged: Factor and noise, see `Fit`.
    """
    score, residual, weight, apart = sums
    weight = max(weight, 1e-6)
    readings = max(readings, 1e-6)
    offset_db = residual / weight
    return Fit(
        per_reading=(score + _offset_cost(offset_db, weight, prior)) / readings,
        offset_db=offset_db,
        apart=0.0 if prior.apart == 1.0 else apart,
        score=score / min(prior.temperature, 1.0),
        weight=weight,
        elsewhere=elsewhere,
        factor=judged[0],
        noise=judged[1],
    )


def off_map_probability(calibration: Calibration, fit: Fit | None, information: float) -> float:
    """
    Probability that the window comes from a road that the map lacks.

    Args:
        calibration: Older ones have coefficients of the first four, five or seven terms alone.
        fit: From `best_fit`; None for a window that heard no cell of the map.
        information: How many independent samples the window is worth: the fit of many says more.
    """
    if fit is None:
        return 1.0 - 1e-6
    known = calibration.off_map
    log_odds_on = sum(map(mul, known, off_map_terms(fit, information)))
    if known[FACTOR:] in ((), (0.0,)):  # it pays for changed cells itself
        log_odds_on += known_beforehand(fit)
    return 1.0 / (1.0 + math.exp(min(max(log_odds_on, -30.0), 30.0)))
