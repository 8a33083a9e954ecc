"""
What held-out windows say of a map's probabilities.

Every road model carries windows of its own passes, with where they fit on curves that have not seen
them; asked for in the rest of the map, each is a trial of the whole map. How much information a
window holds and the error of surveyed positions are those that make the truths most probable (the
logarithmic score, which is proper: only honest probabilities maximise it). The spread of device
offsets, and how well windows fit that are on the map or are not, come from the same trials, and so
does the reliability that the map reports.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float

from app.domain import Calibration, RadioMap, RoadModel
from app.numerics.evidence_table import HeldOut
from app.numerics.geodesy import Floats
from app.numerics.index import MapIndex
from app.numerics.observation import OffsetPrior
from app.numerics.offmap import OFF_MAP_PRIOR
from app.numerics.posterior import RESIDUAL, WEIGHT, masses
from app.numerics.reliability import reliability
from app.numerics.trials import Trial, ask_all, held_out_windows, with_offset

MIN_WINDOWS = 20  # fewer held-out windows say nothing reliable
NEAR_TRUTH_M = 20.0  # of the same sub-segment; survey positions themselves err by metres
SMALLEST_DENSITY = 1e-6  # one window in the wrong place must not decide alone
SMALLEST_OFFSET_SD_DB = 0.5
RIDGE = 3e-5  # next to nothing: it only stops classes that do not overlap from parting for ever

TEMPERATURES = np.geomspace(0.05, 40.0, 24)
POSITION_SDS_M = (0.0, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0, 11.0)
INFORMATION_ONCE = (0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0)
INFORMATION_EACH = tuple(float(each) for each in np.geomspace(0.02, 20.0, 28))


def calibrate(models: Sequence[RoadModel]) -> Calibration:
    """
    Try the map on the windows that its roads held out.

    Args:
        models: All roads of the map; those without evidence have no say.

    Returns:
        The defaults where there is too little evidence to say better.
    """
    windows = held_out_windows(models)
    if len(windows) < MIN_WINDOWS:
        return Calibration()
    learnt = Calibration(
        offset_sd_db=_offset_sd_db([one for _, one in windows]), window_count=len(windows)
    )
    index = MapIndex.build(RadioMap(0, tuple(models), learnt))
    trials = ask_all(index, models, windows)
    once, each, position_sd_m = _most_probable(trials)
    intercept, slope = _logistic(
        np.array([one.fit for one in trials if one.fit is not None]),
        np.array([one.stranger_fit for one in trials if one.stranger_fit is not None]),
    )
    learnt = replace(
        learnt,
        information_once=once,
        information_each=each,
        position_sd_m=position_sd_m,
        off_map_intercept=intercept,
        off_map_slope=slope,
    )
    return replace(learnt, reliability=reliability(index, trials, learnt))


def _offset_sd_db(windows: Sequence[HeldOut]) -> float:
    """Spread of device offsets beyond what the windows' own noise explains."""
    told = [_offset_at_truth(one) for one in windows if one.measured]
    if len(told) < MIN_WINDOWS:
        return Calibration().offset_sd_db
    offset_db, noise_db2 = np.array(told).T
    return float(np.sqrt(max(float(np.mean(offset_db**2 - noise_db2)), SMALLEST_OFFSET_SD_DB**2)))


def _offset_at_truth(one: HeldOut) -> tuple[float, float]:
    """Offset at the best place near the truth, and the variance that noise puts into it."""
    places = with_offset(one.places, OffsetPrior.learnt(Calibration().offset_sd_db))
    near = np.abs(places.chainage_m - one.chainage_m) <= NEAR_TRUTH_M
    near &= places.sign == one.sign
    if not near.any():
        return 0.0, 0.0
    truth = int(np.argmax(np.where(near, places.score, -np.inf)))
    weight = max(float(places.values[WEIGHT, truth]), 1e-6)
    return float(places.values[RESIDUAL, truth]) / weight, 1.0 / weight


def _most_probable(trials: Sequence[Trial]) -> tuple[float, float, float]:
    """Information, once and each, and position error under which the truths were most probable."""
    tables = np.stack([_log_densities(one) for one in trials])  # windows, temperatures, errors
    weight, samples = np.array([(one.weight, one.samples) for one in trials]).T
    best, best_log = (0.0, 1.0, 0.0), -np.inf
    for once, each in product(INFORMATION_ONCE, INFORMATION_EACH):
        temperature = weight / np.minimum(once + each * weight, samples)
        mean_log = _at_temperatures(tables, temperature).mean(axis=0)
        error = int(np.argmax(mean_log))
        if mean_log[error] > best_log:
            best, best_log = (once, each, POSITION_SDS_M[error]), float(mean_log[error])
    return best


def _at_temperatures(
    tables: Float[np.ndarray, "windows temperatures errors"], temperature: Floats
) -> Float[np.ndarray, "windows errors"]:
    """The tables between their temperatures, straight in the logarithm."""
    at = np.interp(np.log(temperature), np.log(TEMPERATURES), np.arange(len(TEMPERATURES)))
    low = np.minimum(at.astype(int), len(TEMPERATURES) - 2)
    rows, share = np.arange(len(tables)), (at - low)[:, None]
    return np.asarray(tables[rows, low] * (1.0 - share) + tables[rows, low + 1] * share)


def _log_densities(one: Trial) -> Float[np.ndarray, "temperatures errors"]:
    """Log of the posterior per metre at the truth, for every temperature and error of the truth."""
    own = one.places.slice(0, one.own)
    driven = np.where(own.sign == one.truth.sign)[0]
    miss_m, width_m = own.chainage_m[driven] - one.truth.chainage_m, own.width_m[driven]
    near = np.stack([_nearness(miss_m, width_m, sd_m) for sd_m in POSITION_SDS_M], axis=1)
    mass = np.stack([masses(one.places, float(t))[driven] for t in TEMPERATURES])
    return np.asarray(np.log(np.maximum(mass @ near, SMALLEST_DENSITY)))


def _nearness(miss_m: Floats, width_m: Floats, sd_m: float) -> Floats:
    """Density of the truth at a place missed by so much, when the truth errs by ``sd_m``."""
    spread_m = np.sqrt(sd_m**2 + width_m**2 / 12.0)
    return np.asarray(np.exp(-0.5 * (miss_m / spread_m) ** 2) / (spread_m * np.sqrt(2.0 * np.pi)))


def _logistic(on_map: Floats, off_map: Floats) -> tuple[float, float]:
    """
    Intercept and slope of the log odds of being on the map, both classes weighing alike.

    Newton's method with a small ridge, so that classes that do not overlap end at a finite slope;
    the prior `OFF_MAP_PRIOR` then shifts the intercept.
    """
    fit = np.concatenate([on_map, off_map]).astype(float)
    label = np.concatenate([np.ones(len(on_map)), np.zeros(len(off_map))])
    weight = np.where(label > 0, 0.5 / len(on_map), 0.5 / len(off_map))
    centre, scale = float(np.mean(fit)), float(np.std(fit)) + 1e-9
    design = np.column_stack([np.ones_like(fit), (fit - centre) / scale])
    theta = np.zeros(2)
    for _ in range(30):
        chance = 1.0 / (1.0 + np.exp(-design @ theta))
        gradient = design.T @ (weight * (label - chance)) - RIDGE * np.array([0.0, theta[1]])
        curvature = weight * chance * (1.0 - chance)
        hessian = (design.T * curvature) @ design + RIDGE * np.diag([1e-6, 1.0])
        theta = theta + np.linalg.solve(hessian, gradient)
    slope = float(theta[1]) / scale
    prior = float(np.log((1.0 - OFF_MAP_PRIOR) / OFF_MAP_PRIOR))
    return float(theta[0]) - slope * centre + prior, slope
