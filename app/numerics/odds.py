"""
How the odds of being off the map are learnt: by logistic regression on held-out windows, asked of
the map and of the map without their road. What they are linear in says `app.numerics.offmap`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.domain import Calibration
from app.numerics.geodesy import Floats
from app.numerics.offmap import (
    ELSEWHERE,
    FACTOR,
    FIT,
    GROWING,
    OFF_MAP_PRIOR,
    SCORE,
    SIZE,
    STRANGE,
    Fit,
    err_apart,
    known_beforehand,
    off_map_terms,
)
from app.numerics.offsets import BROAD_OFFSET_SD_DB, BROAD_OFFSET_SHARE, OffsetPrior
from app.numerics.trials import Trial

ENOUGH_TO_PART = 200  # windows: three roads'; a road or two tell little of what strangers are like
QUARTERS = (0.31864, 1.15035)  # middles of the two halves of |N(0, 1)|
RIDGE = 3e-5  # next to nothing: it only stops classes that do not overlap from parting for ever
FACTOR_RIDGE = 1e-4  # likewise, of a Bayes factor's slope, which is 1 if its laws are right
FIT_RIDGE = 1e-3  # of the fit beside it: drawn windows fit better than any that are driven
# Terms that are not learnt where samples err together, and where each errs for itself
TOGETHER, APART = [GROWING, FACTOR], [SIZE, GROWING, STRANGE, SCORE, ELSEWHERE]
# Of 17 streets driven twice, each day asked of the other: `benchmarks.first_night --constants`
OF_REAL_STREETS = (3.25, 1.36, 0.62, 0.0, -0.02, 0.0101, -0.0019)


def log_odds_of(trials: Sequence[Trial], learnt: Calibration) -> tuple[float, ...]:
    """
    Coefficients of the log odds of being on the map: from its own trials, or those of real streets
    where these are few.

    Args:
        learnt: How much the map's windows say.
    """
    if len(trials) >= ENOUGH_TO_PART or err_apart(learnt):
        return _log_odds(trials, learnt)
    return OF_REAL_STREETS


def _log_odds(trials: Sequence[Trial], learnt: Calibration) -> tuple[float, ...]:
    """
    Log odds of being on the map, both classes weighing alike, then shifted by `OFF_MAP_PRIOR`.

    Logistic regression by Newton's method, with a small ridge so that classes that do not overlap
    end at a finite slope. Surveys are often driven with one device, vehicles are not: a share of
    the windows on the map counts as heard by devices unlike the surveys', and an offset is never
    worse evidence than a Cauchy density against an even one.

    Where samples err independently a Bayes factor tells, whose laws are known, and the fit per
    reading. Roads of one area are told apart by much else, which is wrong of windows from other
    areas that hear the same names: decision 20.
    """
    on: list[tuple[Fit, float, float]] = []
    off: list[tuple[Fit, float, float]] = []
    for one in trials:
        much, measured = one.information(learnt), one.truth.measured
        if one.fit is not None:
            devices = _of_any_device(one.fit, one.prior, measured=measured)
            on += [(fit, much, weight) for fit, weight in devices]
        if one.stranger_fit is not None:
            fit = one.stranger_fit if measured else one.stranger_fit.heard_by(0.0, one.prior)
            off.append((fit, much, 1.0))
    if not on or not off:
        return Calibration().off_map
    apart = err_apart(learnt)
    terms = np.array([off_map_terms(fit, much) for fit, much, _ in on + off])
    known = np.array([0.0 if apart else known_beforehand(fit) for fit, _, _ in on + off])
    label = np.concatenate([np.ones(len(on)), np.zeros(len(off))])
    weight = np.array([each for _, _, each in on + off])
    weight *= np.where(label > 0, 0.5 / weight[: len(on)].sum(), 0.5 / len(off))
    centre, scale = terms.mean(axis=0), terms.std(axis=0) + 1e-9
    centre[0], scale[0] = 0.0, 1.0
    design = (terms - centre) / scale
    design[:, APART if apart else TOGETHER] = 0.0
    usual, ridge = np.zeros(len(scale)), np.full(len(scale), RIDGE)
    ridge[0] *= 1e-6
    if apart:
        usual[FACTOR], ridge[FACTOR] = scale[FACTOR], FACTOR_RIDGE / scale[FACTOR] ** 2
        ridge[FIT] = FIT_RIDGE
    theta = _newton(design, label, weight, known, (usual, ridge))
    strange = float(np.clip(theta[STRANGE], -scale[STRANGE], 0.0))
    if strange != theta[STRANGE]:
        known += strange * design[:, STRANGE]
        design[:, STRANGE] = 0.0
        theta = _newton(design, label, weight, known, (usual, ridge))
        theta[STRANGE] = strange
    slopes = theta / scale
    slopes[0] -= float(slopes[1:] @ centre[1:]) + np.log(OFF_MAP_PRIOR / (1.0 - OFF_MAP_PRIOR))
    return tuple(slopes.tolist())


def _of_any_device(fit: Fit, prior: OffsetPrior, *, measured: bool) -> list[tuple[Fit, float]]:
    """A window's fit, had it been heard by devices of the prior; drawn ones tell no offset."""
    if not measured:
        return [(fit.heard_by(0.0, prior), 1.0)]
    share = BROAD_OFFSET_SHARE / len(QUARTERS)
    others = [(fit.heard_by(BROAD_OFFSET_SD_DB * z, prior), share) for z in QUARTERS]
    return [(fit, 1.0 - BROAD_OFFSET_SHARE), *others]


def _newton(
    design: Floats, label: Floats, weight: Floats, given: Floats, prior: tuple[Floats, Floats]
) -> Floats:
    """
    Coefficients of a logistic regression.

    Args:
        given: Log odds that are known beforehand, of each row.
        prior: What the coefficients are usually, and how strongly each is held to that.
    """
    usual, ridge = prior
    theta = np.zeros(design.shape[1])
    for _ in range(30):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ theta + given, -50.0, 50.0)))
        gradient = design.T @ (weight * (label - chance)) - ridge * (theta - usual)
        hessian = (design.T * (weight * chance * (1.0 - chance))) @ design + np.diag(ridge)
        theta = theta + np.linalg.solve(hessian, gradient)
    return theta
