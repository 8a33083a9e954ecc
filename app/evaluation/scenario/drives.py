"""Driving the city: what a receiver on a vehicle reports, sample by sample."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
from jaxtyping import Float

from app.domain import LTE_RSRP_RANGE_DBM, Direction, Trace
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.params import Scenario
from app.evaluation.streams import Purpose, stream
from app.numerics.geodesy import metres_per_degree
from app.numerics.lines import point_at

SURVEY_START = datetime(2024, 3, 4, 8, 0, tzinfo=UTC)
DRIVE_START = datetime(2024, 5, 6, 8, 0, tzinfo=UTC)


def survey(city: City) -> list[Trace]:
    """The survey's passes: every road in turn, as often as the scenario says."""
    passes = range(city.scenario.survey_passes)
    return [_survey_pass(city, truth, number) for truth in city.roads for number in passes]


def drive(
    city: City, road_id: str, direction: Direction = Direction.FORWARD, number: int = 0
) -> Trace:
    """
    One vehicle's whole pass over a road, after the drift, with its device's offset.

    Positions are the true ones: they are what a fix is compared with. ``number`` tells apart the
    drives of one road and direction.

    Raises:
        KeyError: The city has no such road.
    """
    truth = city.by_id[road_id]
    way = 0 if direction is Direction.FORWARD else 1
    rng = stream(city.seed, Purpose.DRIVE, truth.index, way, number)
    offset_db = city.scenario.device_offset_sd_db * rng.normal()
    chainage_m = _chainage_m(truth, direction, city.scenario, rng.uniform())
    mean_dbm = truth.mean_dbm(chainage_m, drifted=True) + offset_db
    start = DRIVE_START + timedelta(hours=number)
    return _trace(city, truth, chainage_m, report(mean_dbm, city.scenario, rng), start)


def survey_chainage_m(city: City, truth: RoadTruth, number: int) -> Float[np.ndarray, " samples"]:
    """Where the samples of the survey's pass of that number were truly taken, in driving order."""
    start = stream(city.seed, Purpose.START, truth.index, number).uniform()
    return _chainage_m(truth, survey_direction(city.scenario, number), city.scenario, start)


def survey_direction(scenario: Scenario, number: int) -> Direction:
    """Which way the survey's pass of that number goes."""
    backward = scenario.both_directions and number % 2 == 1
    return Direction.BACKWARD if backward else Direction.FORWARD


def report(
    mean_dbm: Float[np.ndarray, "samples cells"], scenario: Scenario, rng: np.random.Generator
) -> Float[np.ndarray, "samples cells"]:
    """
    What the receiver reports of a mean: noise, sensitivity, the reporting range and its steps.

    NaN = not heard. A reading beyond an edge of the LTE range is reported as that edge, as 3GPP TS
    36.133 maps it.
    """
    reading_dbm = mean_dbm + scenario.noise_db * rng.normal(size=mean_dbm.shape)
    heard = reading_dbm >= scenario.sensitivity_dbm
    reported_dbm = np.clip(reading_dbm, *LTE_RSRP_RANGE_DBM)
    if scenario.quantisation_db > 0:
        reported_dbm = np.round(reported_dbm / scenario.quantisation_db) * scenario.quantisation_db
    return np.where(heard, reported_dbm, np.nan)


def _survey_pass(city: City, truth: RoadTruth, number: int) -> Trace:
    scenario = city.scenario
    rng = stream(city.seed, Purpose.SURVEY, truth.index, number)
    chainage_m = survey_chainage_m(city, truth, number)
    rsrp_dbm = report(truth.mean_dbm(chainage_m), scenario, rng)
    start = SURVEY_START + timedelta(days=number, minutes=2 * truth.index)
    trace = _trace(city, truth, chainage_m, rsrp_dbm, start)
    noise_m = scenario.survey_position_noise_m * rng.normal(size=(2, len(chainage_m)))
    degree = metres_per_degree(trace.lat)
    lon, lat = trace.lon + noise_m[0] / degree.x_m, trace.lat + noise_m[1] / degree.y_m
    return replace(trace, lon=lon, lat=lat)


def _chainage_m(
    truth: RoadTruth, direction: Direction, scenario: Scenario, start: float
) -> Float[np.ndarray, " samples"]:
    """
    Chainage of every sample from one end towards the other.

    Args:
        start: Of the first, as a share of the distance between samples: no two drives report at the
            very same places.
    """
    into_m = start * scenario.spacing_m
    samples = int((truth.length_m - into_m) / scenario.spacing_m) + 1
    travelled_m = into_m + np.arange(samples) * scenario.spacing_m
    return travelled_m if direction is Direction.FORWARD else truth.length_m - travelled_m


def _trace(
    city: City,
    truth: RoadTruth,
    chainage_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    start: datetime,
) -> Trace:
    place = point_at(truth.line, chainage_m)
    macro = city.layout.sites[0].cell
    return Trace(
        cells=truth.cells,
        time_s=np.arange(len(chainage_m)) * city.scenario.spacing_m / city.scenario.speed_mps,
        lon=place.lon,
        lat=place.lat,
        rsrp_dbm=rsrp_dbm.astype(np.float32),
        road_id=truth.road_id,
        device="simulated",
        recorded_at=start,
        reference_cell=macro if macro in truth.cells else None,
    )
