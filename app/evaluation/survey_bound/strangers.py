"""
How well any rule can tell windows off the map: the Bayes factor of whoever knows the law.

On the map a window is as probable as on its mean place, given what the survey read; off it, as on
the mean place of such roads, of which nothing was read. Told is the law that the city was drawn
from and where such roads run, so that no rule which learns from the same readings parts the two
better, but by knowing more; that a cell is not heard is taken to say nothing, as in `best`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from app.domain import Window
from app.evaluation.scenario.city import City
from app.evaluation.survey_bound.best import Told, ends_on, told_by
from app.evaluation.survey_bound.roads import CurvesOn, surveyed_curves, unsurveyed_curves

ELSEWHERE_STEP_M = 4.0  # between places of roads of which nothing is known: they differ little


def on_map_log(
    city: City,
    windows: Sequence[Window],
    road_ids: Sequence[str],
    *,
    step_m: float = 0.5,
) -> tuple[Float[np.ndarray, " windows"], Float[np.ndarray, " windows"]]:
    """
    Log of how much more probable each window is on the map than off it.

    Args:
        windows: All of one length, a sample every ``spacing_m`` of the scenario.
        road_ids: The true road of each.
        step_m: Spacing of the places.

    Returns:
        In the whole map, and in the map without the window's own road.

    Raises:
        ValueError: As `app.evaluation.survey_bound.best_answers`.
    """
    told = told_by(city, windows)
    surveyed = _by_road(city, told, surveyed_curves, step_m)
    nothing_read = _by_road(city, told, unsurveyed_curves, ELSEWHERE_STEP_M)
    every = np.ones(surveyed.shape, dtype=bool)
    others = np.array([[truth.road_id != each for each in road_ids] for truth in city.roads])
    elsewhere = _mean_log(city, nothing_read, every)
    here, without = (_mean_log(city, surveyed, kept) for kept in (every, others))
    return here - elsewhere, without - elsewhere


def _mean_log(
    city: City,
    sums: Float[np.ndarray, "roads windows"],
    kept: Bool[np.ndarray, "roads windows"],
) -> Float[np.ndarray, " windows"]:
    """Log of each window's density at its mean place on the roads that are kept for it."""
    length_m = np.array([truth.length_m for truth in city.roads])
    sums = np.where(kept, sums, -np.inf)
    return np.asarray(np.logaddexp.reduce(sums) - np.log(length_m @ kept))


def _by_road(
    city: City, told: Told, curves_on: CurvesOn, step_m: float
) -> Float[np.ndarray, "roads windows"]:
    """Log of each window's density, summed over a road's metres, both ways and all odometers."""
    found = []
    for number, truth in enumerate(city.roads):
        each = [
            np.logaddexp.reduce(ends.log_density.astype(float))
            for ends in ends_on(city, truth, number, told, step_m, curves_on)
        ]
        found.append(np.logaddexp.reduce(each) + np.log(step_m))
    return np.stack(found)
