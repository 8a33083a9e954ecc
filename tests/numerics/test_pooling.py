"""More survey data never makes a map worse: passes pool, copies and other devices do no harm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import jaxtyping
import numpy as np
import pytest

from app.domain import Trace
from app.evaluation.scenario import City, build_city, preset, survey, windows
from app.evaluation.truth import Labelled
from app.numerics.geodesy import distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.posterior import masses
from app.numerics.query import ask
from app.numerics.roadfit import fit_road
from app.numerics.stretches import whole_roads
from tests.numerics.cities import index_with

SEEDS = (21, 22)
COUNTS = {"paper": (1, 2, 5), "harsh": (1, 2, 3, 5)}
WINDOWS = 60  # a seed: 120 pairs a law
NOISE_SDS = 2.5  # standard errors of a paired mean that chance may move it by
SLACK_M, SLACK_LOG = 0.02, 0.01  # and what nobody would call worse
NEAR_M = 5.0
LEAST = 1e-4  # a window in the wrong place must not decide alone
CELLS = {"paper": 2, "harsh": 3}  # few, where a map that got worse is a wrong place
OTHER_DEVICE_DB = 6.0
LATE_S = 1.5


@pytest.fixture(autouse=True, scope="module")
def _unchecked_shapes():
    """Every other test checks the shapes of what runs here; here the checks take half the time."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """Windows asked for in one map: error in metres, log probability of the truth."""

    error_m: np.ndarray
    log_truth: np.ndarray


@cache
def city_of(name: str, seed: int) -> City:
    return build_city(replace(preset(name), cells=CELLS[name], survey_passes=5), seed)


@cache
def asked_of(name: str, seed: int) -> tuple[Labelled, ...]:
    """Windows as a vehicle has them: 30 m, or 10 s where samples come once a second."""
    city = city_of(name, seed)
    if city.scenario.sample_interval_s is None:
        return tuple(windows(city, WINDOWS))
    return tuple(windows(city, WINDOWS, duration_s=10.0))


def passes_of(name: str, seed: int, count: int) -> list[Trace]:
    """The first passes of each road."""
    city = city_of(name, seed)
    passes = survey(city)
    each = {truth.road_id: [] for truth in city.roads}
    for one in passes:
        each[one.road_id].append(one)
    return [one for road in each.values() for one in road[:count]]


def map_of(city: City, passes: list[Trace]) -> MapIndex:
    return index_with(
        [
            fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
            for truth in city.roads
        ]
    )


def ask_in(index: MapIndex, asked: tuple[Labelled, ...]) -> Asked:
    error_m, log_truth = [], []
    for one in asked:
        fix = locate(index, one.window)
        error_m.append(float(distance_m(fix.lon, fix.lat, one.truth.lon, one.truth.lat)))
        query = ask(index, one.window)
        places = whole_roads(index, query)
        mass = masses(places, query.temperature(index.calibration))
        near = np.abs(places.chainage_m - one.truth.chainage_m) <= NEAR_M
        near &= places.road == index.road_ids.index(one.truth.road_id)
        near &= places.sign == one.truth.direction.sign
        log_truth.append(np.log(max(float(mass[near].sum()), LEAST)))
    return Asked(np.array(error_m), np.array(log_truth))


@cache
def pooled(name: str, seed: int, count: int) -> MapIndex:
    """The map of so many passes."""
    return map_of(city_of(name, seed), passes_of(name, seed, count))


@cache
def measured(name: str, count: int) -> Asked:
    """All seeds' windows in maps of so many passes."""
    return joined([ask_in(pooled(name, seed, count), asked_of(name, seed)) for seed in SEEDS])


def joined(parts: list[Asked]) -> Asked:
    return Asked(
        np.concatenate([part.error_m for part in parts]),
        np.concatenate([part.log_truth for part in parts]),
    )


def mean_and_error(change: np.ndarray) -> tuple[float, float]:
    return float(change.mean()), float(change.std() / np.sqrt(len(change)))


def assert_no_worse(before: Asked, after: Asked) -> None:
    """The paired means got no worse by more than chance moves them."""
    worse_m, error_m = mean_and_error(after.error_m - before.error_m)
    worse_log, error_log = mean_and_error(before.log_truth - after.log_truth)
    assert worse_m <= SLACK_M + NOISE_SDS * error_m
    assert worse_log <= SLACK_LOG + NOISE_SDS * error_log


@pytest.mark.parametrize(
    ("name", "fewer", "more"),
    [(name, *pair) for name, counts in COUNTS.items() for pair in pairwise(counts)],
)
def test_more_passes_never_make_a_map_worse(name, fewer, more):
    """Paired windows: mean error and the truth's probability get no worse beyond noise."""
    before, after = measured(name, fewer), measured(name, more)
    assert_no_worse(before, after)


@pytest.mark.parametrize(("name", "fewer", "more"), [("paper", 1, 5), ("harsh", 1, 5)])
def test_pooling_earns_its_keep(name, fewer, more):
    """More passes than one take a fifth off the mean error at least."""
    assert measured(name, more).error_m.mean() < 0.8 * measured(name, fewer).error_m.mean()


def test_the_same_passes_again_change_no_answer():
    """Copies of every pass, under another device's name, make the same map bit by bit."""
    city, passes = city_of("harsh", SEEDS[0]), passes_of("harsh", SEEDS[0], 2)
    copies = [replace(one, device="copied") for one in passes]
    asked = asked_of("harsh", SEEDS[0])
    once = ask_in(pooled("harsh", SEEDS[0], 2), asked)
    twice = ask_in(map_of(city, passes + copies), asked)
    np.testing.assert_array_equal(once.error_m, twice.error_m)
    np.testing.assert_array_equal(once.log_truth, twice.log_truth)


@pytest.mark.parametrize("name", ["paper", "harsh"])
def test_a_louder_device_is_no_worse_than_an_equal_one(name):
    """A second pass 6 dB louder: the map is no worse than with an equal one, beyond noise."""
    parts = [
        ask_in(map_of(city_of(name, seed), louder_second(name, seed)), asked_of(name, seed))
        for seed in SEEDS
    ]
    assert_no_worse(measured(name, 2), joined(parts))


def louder_second(name: str, seed: int) -> list[Trace]:
    passes = passes_of(name, seed, 2)
    louder_dbm = [one.rsrp_dbm + np.float32(OTHER_DEVICE_DB) for one in passes]
    return [
        replace(one, rsrp_dbm=louder_dbm[i], device="other") if i % 2 else one
        for i, one in enumerate(passes)
    ]


def test_a_late_pass_is_no_worse_than_a_timely_one():
    """One pass of three whose readings lag by a second and a half makes the map no worse."""
    name = "harsh"
    parts = [
        ask_in(map_of(city_of(name, seed), late_second(name, seed)), asked_of(name, seed))
        for seed in SEEDS
    ]
    assert_no_worse(measured(name, 3), joined(parts))


def late_second(name: str, seed: int) -> list[Trace]:
    """The second pass of each road with its clock set wrong: each fix between those after it."""
    passes = passes_of(name, seed, 3)
    return [out_of_step(one) if i % 3 == 1 else one for i, one in enumerate(passes)]


def out_of_step(one: Trace) -> Trace:
    ahead_s = np.minimum(one.time_s + LATE_S, one.time_s[-1])
    kept = one.time_s + LATE_S <= one.time_s[-1]
    lon, lat = (np.interp(ahead_s, one.time_s, place)[kept] for place in (one.lon, one.lat))
    return replace(one, time_s=one.time_s[kept], lon=lon, lat=lat, rsrp_dbm=one.rsrp_dbm[kept])
