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

from app.domain import Calibration, RadioMap, Reliability, RoadModel
from app.numerics.evidence_table import HeldOut
from app.numerics.geodesy import Floats
from app.numerics.index import MapIndex
from app.numerics.odds import OF_REAL_STREETS, log_odds_of
from app.numerics.offsets import OffsetPrior
from app.numerics.posterior import RESIDUAL, WEIGHT, masses
from app.numerics.reliability import reliability
from app.numerics.trials import Trial, ask_all, size_of, with_offset
from app.numerics.unseen import Asked, ask_at_home, held_out_windows

MIN_WINDOWS = 20  # fewer held-out windows say nothing reliable
ASTRAY = 0.05  # chance that nothing could place a held-out window: such must not decide alone
NEAR_TRUTH_M = 20.0  # of the same sub-segment; survey positions themselves err by metres
SMALLEST_OFFSET_SD_DB = 0.5
HELD = 0.68  # of the truths lie within the radius that clients are told unless they ask otherwise
MOST_WIDENED = 2.0  # times the position error of the logarithmic score

UNTRIED = Calibration(  # of real streets driven once, asked on another day: decisions 12 and 17
    information_once=0.45,
    information_each=0.08,
    offset_sd_db=2.0,
    position_sd_m=8.0,
    segment_sd_m=4.5,
    off_map=OF_REAL_STREETS,
)

TEMPERATURES = np.geomspace(0.05, 40.0, 24)
POSITION_SDS_M = (0.0, 1.0, 1.5, 2.0, 3.0, 4.5, 6.0, 8.0, 11.0)
INFORMATION_ONCE = (0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.4, 2.0, 2.8, 4.0)
INFORMATION_EACH = tuple(float(each) for each in np.geomspace(0.01, 20.0, 31))
# Of windows drawn reading by reading from the map's own curves: every sample counts, in its place
EVERY_SAMPLE = (0.0, INFORMATION_EACH[-1])


def calibrate(models: Sequence[RoadModel], given: Calibration | None = None) -> Calibration:
    """
    Try the map on the windows that its roads held out.

    Args:
        models: All roads of the map; those without evidence have no say.
        given: Whose information and position error to take; None = the most probable ones, or
            `EVERY_SAMPLE` where all held-out windows are drawn. Places err at least as the passes'
            own may.

    Returns:
        `UNTRIED` where there is too little evidence to say better.
    """
    windows = held_out_windows(models)
    if len(windows) < MIN_WINDOWS:
        return UNTRIED
    index = MapIndex.build(RadioMap(0, tuple(models), Calibration()))
    asked = ask_at_home(index, models, windows)
    learnt = Calibration(
        offset_sd_db=_offset_sd_db(asked, index.offset_prior), window_count=len(asked)
    )
    index = index.recalibrated(learnt)
    sizes = np.array([size_of(one.truth) for one in asked])
    if given is not None:
        likeliest = (given.information_once, given.information_each, given.position_sd_m)
    elif not any(one.truth.measured for one in asked):
        likeliest = (*EVERY_SAMPLE, 0.0)
    else:
        likeliest = _most_probable(asked, sizes, index.offset_prior, index.lengths_m)
    once, each, error_m = likeliest
    error_m = max(error_m, _map_error_m(models, windows))
    learnt = replace(
        learnt,
        information_once=once,
        information_each=each,
        position_sd_m=error_m,
        segment_sd_m=error_m,
    )
    trials = ask_all(index.recalibrated(learnt), models, asked)
    learnt = replace(learnt, off_map=log_odds_of(trials, learnt))
    return _wide_enough(index, trials, learnt)


def _wide_enough(index: MapIndex, trials: Sequence[Trial], learnt: Calibration) -> Calibration:
    """
    The calibration with its reliability; its position error is that of the logarithmic score, or
    as much more, twice at most, as radii need to hold what they say: clocks of days err in tails.
    """
    least_m = learnt.position_sd_m
    told = reliability(index, trials, learnt)
    for wider_m in POSITION_SDS_M:
        if not least_m < wider_m <= MOST_WIDENED * least_m or held(told) >= HELD:
            continue
        learnt = replace(learnt, position_sd_m=wider_m)
        told = reliability(index, trials, learnt)
    return replace(learnt, reliability=told)


def held(told: Reliability) -> float:
    """Share of the truths within the radius that should hold `HELD` of them."""
    return dict(told.coverage)[HELD]


def _offset_sd_db(windows: Sequence[Asked], prior: OffsetPrior) -> float:
    """Spread of device offsets beyond what the windows' own noise and carriers explain."""
    told = [_offset_at_truth(one, prior) for one in windows if one.truth.measured]
    if len(told) < MIN_WINDOWS:
        return Calibration().offset_sd_db
    offset_db, noise_db2 = np.array(told).T
    # A window that tells its offset badly, as where the map lacks all its cells, hardly counts.
    trust = 1.0 / (1.0 + noise_db2) ** 2
    variance_db2 = float(trust @ (offset_db**2 - noise_db2) / trust.sum())
    return float(np.sqrt(max(variance_db2, SMALLEST_OFFSET_SD_DB**2)))


def _offset_at_truth(one: Asked, prior: OffsetPrior) -> tuple[float, float]:
    """Offset at the best place near the truth, and the variance that noise puts into it."""
    places = with_offset(one.places, prior)
    near = np.abs(places.chainage_m - one.truth.chainage_m) <= NEAR_TRUTH_M
    near &= places.sign == one.truth.sign
    if not near.any():
        return 0.0, 0.0
    truth = int(np.argmax(np.where(near, places.score, -np.inf)))
    weight = max(float(places.values[WEIGHT, truth]), 1e-6)
    return float(places.values[RESIDUAL, truth]) / weight, 1.0 / weight


def _most_probable(
    windows: Sequence[Asked],
    sizes: Float[np.ndarray, "windows 2"],
    prior: OffsetPrior,
    lengths_m: Floats,
) -> tuple[float, float, float]:
    """
    Information, once and each, and position error under which the truths were most probable.

    A window may be anywhere on its road, either way, with the chance `ASTRAY`.

    Args:
        sizes: What each one's samples weigh together, and how many they are.
        lengths_m: Of all roads.
    """
    anywhere = ASTRAY / (2.0 * lengths_m)
    tables = np.stack([_log_densities(one, float(anywhere[one.road]), prior) for one in windows])
    weight, samples = sizes.T
    best, best_log = (0.0, 1.0, 0.0), -np.inf
    for once, each in product(INFORMATION_ONCE, INFORMATION_EACH):
        temperature = weight / np.minimum(once + each * weight, samples)
        mean_log = _at_temperatures(tables, temperature).mean(axis=0)
        error = int(np.argmax(mean_log))
        if mean_log[error] > best_log:
            best, best_log = (once, each, POSITION_SDS_M[error]), float(mean_log[error])
    return best


def _map_error_m(models: Sequence[RoadModel], windows: Sequence[tuple[int, HeldOut]]) -> float:
    """By how much the map's places err if its passes' do, each for itself, as they may."""
    variances = [one.doubt_m**2 / models[road].pass_count for road, one in windows]
    return float(np.sqrt(np.mean(variances)))


def _at_temperatures(
    tables: Float[np.ndarray, "windows temperatures errors"], temperature: Floats
) -> Float[np.ndarray, "windows errors"]:
    """The tables between their temperatures, straight in the logarithm."""
    at = np.interp(np.log(temperature), np.log(TEMPERATURES), np.arange(len(TEMPERATURES)))
    low = np.minimum(at.astype(int), len(TEMPERATURES) - 2)
    rows, share = np.arange(len(tables)), (at - low)[:, None]
    return np.asarray(tables[rows, low] * (1.0 - share) + tables[rows, low + 1] * share)


def _log_densities(
    one: Asked, anywhere: float, prior: OffsetPrior
) -> Float[np.ndarray, "temperatures errors"]:
    """
    Log of the posterior per metre at the truth, for every temperature and error of the truth.

    Asked on the window's own road alone: there all curves lack the window's day, while in the whole
    map only its own road's do, which would make the others look better than they are.
    """
    own, truth = one.places, one.truth
    driven = np.where(own.sign == truth.sign)[0]
    miss_m, width_m = own.chainage_m[driven] - truth.chainage_m, own.width_m[driven]
    doubt_m = truth.doubt_m if truth.measured else 0.0
    errors_m = np.hypot(POSITION_SDS_M, doubt_m).tolist()
    near = np.stack([_nearness(miss_m, width_m, sd_m) for sd_m in errors_m], axis=1)
    tempered = [
        masses(with_offset(one.at(t), prior.at(t)), t)[driven] for t in TEMPERATURES.tolist()
    ]
    mass = np.stack(tempered)
    return np.asarray(np.log((1.0 - ASTRAY) * (mass @ near) + anywhere))


def _nearness(miss_m: Floats, width_m: Floats, sd_m: float) -> Floats:
    """Density of the truth at a place missed by so much, when the truth errs by ``sd_m``."""
    spread_m = np.sqrt(sd_m**2 + width_m**2 / 12.0)
    return np.asarray(np.exp(-0.5 * (miss_m / spread_m) ** 2) / (spread_m * np.sqrt(2.0 * np.pi)))
