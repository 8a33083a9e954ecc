"""How often a map's probabilities came true on its held-out windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from app.domain import Calibration, Reliability
from app.numerics import native
from app.numerics.index import MapIndex
from app.numerics.offmap import off_map_probability
from app.numerics.summary import Summary, summarise
from app.numerics.trials import Trial

BINS = 10
CONFIDENCES = (0.5, 0.68, 0.8, 0.9, 0.95)

Curve = tuple[tuple[float, float, int], ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """
    One trial's answer.

    Attributes:
        right, posterior: Of the road; ``segment_right`` and ``segment_posterior`` of the
            sub-segment that holds the position, either way along it.
        error_m: Distance from the truth; ``within`` tells for each confidence if the radius held.
    """

    right: bool
    posterior: float
    segment_right: bool
    segment_posterior: float
    error_m: float
    within: tuple[bool, ...]


def reliability(index: MapIndex, trials: Sequence[Trial], learnt: Calibration) -> Reliability:
    """
    What a map answers to its trials under its calibration.

    Args:
        index: The map; its own calibration has no say but for the offsets.
    """
    judged = index.recalibrated(learnt)
    outcomes = [_outcome(judged, one) for one in trials]
    right = np.array([one.right for one in outcomes])
    posterior = np.array([one.posterior for one in outcomes])
    error_m = np.array([one.error_m for one in outcomes])
    within = np.array([one.within for one in outcomes]).mean(axis=0)
    curve = curve_of(posterior, right)
    segment_right = np.array([one.segment_right for one in outcomes])
    segments = curve_of(np.array([one.segment_posterior for one in outcomes]), segment_right)
    told = [(one.fit, one.stranger_fit, one.information(learnt)) for one in trials]
    off = np.array([off_map_probability(learnt, fit, much) for fit, _, much in told])
    strangers = np.array([off_map_probability(learnt, fit, much) for _, fit, much in told])
    return Reliability(
        window_count=len(trials),
        measured_count=sum(one.truth.measured for one in trials),
        road_right=float(right.mean()),
        ece=calibration_error(curve),
        curve=curve,
        coverage=tuple(zip(CONFIDENCES, within.tolist(), strict=True)),
        median_m=float(np.median(error_m)),
        p90_m=float(np.percentile(error_m, 90)),
        refused=float(np.mean(off > 0.5)),
        strangers_refused=float(np.mean(strangers > 0.5)),
        off_map_auroc=auroc(strangers, off),
        segment_right=float(segment_right.mean()),
        segment_ece=calibration_error(segments),
    )


def _outcome(index: MapIndex, one: Trial) -> Outcome:
    temperature = index.calibration.temperature(one.weight, one.samples)
    temperature *= 1.0 if one.fit is None else one.fit.noise
    if one.truth.measured and one.truth.doubt_m > 0.0:
        index = index.recalibrated(_beside(index.calibration, one.truth.doubt_m))
    told = [
        summarise(index, one.places, temperature, confidence, in_c=native.BUILT)
        for confidence in CONFIDENCES
    ]
    atlas = index.atlas
    chainages_m = np.array([one.truth.chainage_m, told[0].chainage_m])
    x_m, y_m = atlas.spot(np.array([one.road, told[0].road]), chainages_m).of(atlas.plane[:2])
    error_m = float(np.hypot(x_m[0] - x_m[1], y_m[0] - y_m[1]))
    within = tuple(error_m <= each.radius_m for each in told)
    right = told[0].road == one.road
    hit, posterior = _segment(index, told[0], one.truth.chainage_m)
    return Outcome(right, told[0].road_mass, right and hit, posterior, error_m, within)


def _beside(learnt: Calibration, doubt_m: float) -> Calibration:
    """What a map says of places that are known no better than so."""
    errors_m = np.hypot([learnt.position_sd_m, learnt.segment_sd_m], doubt_m).tolist()
    return replace(learnt, position_sd_m=errors_m[0], segment_sd_m=errors_m[1])


def _segment(index: MapIndex, told: Summary, chainage_m: float) -> tuple[bool, float]:
    """Whether the sub-segment that was told holds a place of its road, and its posterior."""
    road = index.roads[told.road]
    segment = road.segment_at(told.chainage_m)
    mass = sum(one[3] for one in told.rivals if one[:2] == (told.road, segment))
    return bool(road.edges_m[segment] <= chainage_m <= road.edges_m[segment + 1]), mass


def calibration_error(curve: Curve) -> float:
    """Expected calibration error: by how much the share right misses the posterior."""
    windows = sum(count for *_, count in curve)
    return sum(count * abs(said - true) for said, true, count in curve) / windows


def curve_of(
    posterior: Float[np.ndarray, " windows"], right: Bool[np.ndarray, " windows"]
) -> Curve:
    """Mean posterior, share right and number of windows of every bin that has any."""
    bins = np.minimum((posterior * BINS).astype(int), BINS - 1)
    found = [bins == number for number in range(BINS)]
    return tuple(
        (float(posterior[one].mean()), float(right[one].mean()), int(one.sum()))
        for one in found
        if one.any()
    )


def auroc(
    positive: Float[np.ndarray, " positives"], negative: Float[np.ndarray, " negatives"]
) -> float:
    """Chance that a positive scores above a negative, ties counting half (Mann and Whitney)."""
    order = np.sort(negative)
    below = np.searchsorted(order, positive, side="left")
    ties = np.searchsorted(order, positive, side="right") - below
    return float((below + 0.5 * ties).mean() / len(negative))
