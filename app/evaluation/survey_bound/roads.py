"""What is known of the levels along a simulated road, by who knows the law it was drawn from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.drives import survey, survey_chainage_m
from app.evaluation.scenario.params import Scenario
from app.evaluation.survey_bound.curves import Curve, field_covariance_db2

CurvesOn: TypeAlias = Callable[[City, RoadTruth], list[Curve]]


def surveyed_curves(city: City, truth: RoadTruth) -> list[Curve]:
    """
    Every cell's level along a road when the vehicles drive.

    Given the survey's readings at their true places.
    """
    passes = [one for one in survey(city) if one.road_id == truth.road_id]
    chainage_m = np.concatenate(
        [survey_chainage_m(city, truth, number) for number in range(len(passes))]
    )
    rsrp_dbm = np.concatenate([one.rsrp_dbm for one in passes]).astype(float)
    reading_db2 = reading_variance_db2(city.scenario)
    return [
        _drifted(city, curve.given(chainage_m, rsrp_dbm[:, cell], reading_db2))
        for cell, curve in enumerate(_before(city, truth))
    ]


def unsurveyed_curves(city: City, truth: RoadTruth) -> list[Curve]:
    """The same of a road that nobody has driven: its median path loss, and any shadowing."""
    return [_drifted(city, curve) for curve in _before(city, truth)]


def reading_variance_db2(scenario: Scenario) -> float:
    """Of a reading about the level: its noise, and its rounding as if that were noise."""
    return scenario.noise_db**2 + scenario.quantisation_db**2 / 12.0


def _before(city: City, truth: RoadTruth) -> list[Curve]:
    """Every cell's level on the survey's day, before any reading."""
    correlation_m = city.scenario.shadowing_correlation_m
    step_m = truth.length_m / (len(truth.median_dbm) - 1)
    return [
        Curve(step_m, median_dbm, field_covariance_db2(spread_db, step_m, correlation_m))
        for median_dbm, spread_db in zip(truth.median_dbm.T, truth.shadowing_db.T, strict=True)
    ]


def _drifted(city: City, curve: Curve) -> Curve:
    """The level when the vehicles drive."""
    scenario = city.scenario
    drift_db = np.full(len(curve.mean_dbm), scenario.drift_db)
    return curve.drifted(field_covariance_db2(drift_db, curve.step_m, scenario.drift_correlation_m))
