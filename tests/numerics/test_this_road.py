"""Whether levels are this road's or others': three laws by the book, and the same in C."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Window
from app.evaluation.scenario import build_city, preset, windows
from app.numerics.answer import fit_of_place
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.matching import locate, place
from app.numerics.observation import BACKGROUND_SPAN_DB, TERMS
from app.numerics.offmap import FACTOR, Fit, err_apart
from app.numerics.offsets import OffsetPrior
from app.numerics.query import Query, ask
from app.numerics.this_road import (
    DRIFT,
    MUCH_DRIFT,
    NOISE_TIMES,
    SHADOWING,
    OnRoad,
    log_likelihoods,
    weigh,
)
from tests.numerics.cities import city_of, index_of, models_of
from tests.numerics.test_native import a_window, built
from tests.numerics.test_native import index_of as gentle_index

PLACES = (
    st.integers(0, 10_000),
    st.integers(0, 2),
    st.sampled_from([1, -1]),
    st.floats(0.0, 1.0),
    st.sampled_from([0.2, 1.0, 3.0]),
)


def by_the_book(
    query: Query, road: RoadIndex, at: OnRoad, temperature: float, devices: OffsetPrior
) -> tuple[float, ...]:
    """This road, drifted little and much, read with more noise, and another: all at once."""
    y, mu, noise_db2, count, cell, behind_m = [], [], [], [], [], []
    rows = road.along.rows.astype(float)
    numbers = query.numbers(road.column)
    for sample, behind in enumerate(query.fine.behind_m):
        column = at.low + 1 - at.sign * int(np.rint(behind / road.step_m))
        if not 1 <= column < road.grid_size:
            continue
        for number, row in enumerate(numbers):
            heard = float(query.fine.heard[sample, number] * query.fine.weight[sample])
            a, b = rows[row * TERMS : row * TERMS + 2, column : column + 2]
            if row < 0 or heard == 0.0 or a.min() <= 0.0:
                continue
            levels = b / a
            y.append(query.fine.rsrp_db[sample, number])
            mu.append(levels[0] + at.share * (levels[1] - levels[0]))
            noise_db2.append(1.0 / (a[0] + at.share * (a[1] - a[0])))
            count.append(heard / temperature)
            cell.append(number)
            behind_m.append(behind)
    if not y:
        return 0.0, 0.0, 0.0, 0.0
    y, mu, noise_db2, count, cell, behind_m = map(
        np.array, (y, mu, noise_db2, count, cell, behind_m)
    )
    about = np.array([np.average(mu[cell == one], weights=count[cell == one]) for one in cell])
    same, alike = cell[:, None] == cell, query.group[cell][:, None] == query.group[cell]
    away_m = np.abs(behind_m[:, None] - behind_m)
    told = []
    for missed_db, field, times in (
        (y - mu, DRIFT, 1.0),
        (y - mu, MUCH_DRIFT, 1.0),
        (y - mu, DRIFT, NOISE_TIMES),
        (y - about, SHADOWING, 1.0),
    ):
        of_noise_db2 = times * noise_db2
        # A density to the power of w is one of noise / w, but for this factor.
        known = 0.5 * np.sum(np.log(2.0 * np.pi * of_noise_db2 / count))
        background = np.log(BACKGROUND_SPAN_DB) - 0.5 * np.log(2.0 * np.pi * of_noise_db2)
        known += np.sum(count * background)
        law = np.diag(of_noise_db2 / count)
        law = law + same * field.sd_db**2 * np.exp(-away_m / field.length_m)
        parts = []
        for log_group, group_db2 in (
            (np.log(devices.apart), devices.group_db2),
            *(((np.log1p(-devices.apart), 0.0),) if devices.apart < 1.0 else ()),
        ):
            for log_device, device_db2 in (
                (devices.like_log, devices.like_db2),
                (devices.any_log, devices.any_db2),
            ):
                whole = law + device_db2 + alike * group_db2
                log = -0.5 * missed_db @ np.linalg.solve(whole, missed_db)
                log -= 0.5 * np.linalg.slogdet(2.0 * np.pi * whole)[1]
                parts.append(log + log_group + log_device)
        told.append(float(known + np.logaddexp.reduce(parts)))
    return tuple(told)


@settings(max_examples=60, deadline=None)
@given(*PLACES)
def test_the_laws_are_those_of_the_book(seed, number, sign, share, temperature):
    """At any place: cells that the road lacks, samples beyond its ends."""
    index, window = gentle_index(seed % 5), a_window(seed)
    query, road = ask(index, window), index.roads[number]
    at = OnRoad.of(road, sign, share * road.length_m)
    cooled = min(temperature, 1.0)
    devices = index.offset_prior.at(1.0)
    *found, _ = log_likelihoods(query, road, at, cooled, devices)
    expected = by_the_book(query, road, at, cooled, devices)
    assert tuple(found) == pytest.approx(expected, rel=1e-8, abs=1e-8)


@built
@settings(max_examples=100, deadline=None)
@given(*PLACES, st.sampled_from([1.0, 0.93, 1.04]))
def test_the_kernel_says_the_same(seed, number, sign, share, temperature, factor):
    """For every window, place, temperature and factor of the odometer."""
    index, window = gentle_index(seed % 5), a_window(seed)
    road, prior = index.roads[number], index.offset_prior.at(temperature)
    ours, wanted = (
        weigh(ask(index, window, in_c=in_c), road, sign, share * road.length_m, prior, factor)
        for in_c in (True, False)
    )
    assert tuple(ours) == pytest.approx(tuple(wanted), rel=1e-9, abs=1e-9)
    assert ours.judged() == pytest.approx(wanted.judged(), rel=1e-9, abs=1e-9)


def test_a_factor_is_the_window_with_its_distances_multiplied():
    """What is a third too long is as it was, divided."""
    index = index_of(cells=6)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    road, prior = index.roads[0], index.offset_prior.at(1.0)
    plain = weigh(ask(index, window), road, 1, 100.0, prior)
    query = ask(index, window).multiplied(1.5)
    assert tuple(weigh(query, road, 1, 100.0, prior, 1.0 / 1.5)) == pytest.approx(tuple(plain))
    assert tuple(weigh(query, road, 1, 100.0, prior)) != pytest.approx(tuple(plain))


def test_what_lies_beyond_the_road_says_nothing():
    """A window that ends at the road's first metre: its other samples came from elsewhere."""
    index = index_of(cells=6)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    strange = window.rsrp_dbm.copy()
    strange[:-1] -= 25.0
    road, prior = index.roads[0], index.offset_prior.at(1.0)
    told = [
        log_likelihoods(ask(index, each), road, OnRoad.of(road, 1, 0.0), 1.0, prior)
        for each in (window, Window(window.cells, window.distance_m, strange))
    ]
    assert told[0] == pytest.approx(told[1])


def test_the_factor_parts_this_road_from_others_and_from_another_city():
    """Same roads, cells and sites, other shadowing: its windows fit, but not as this city's do."""
    index, city = index_of(cells=6), city_of(cells=6)
    abroad = build_city(city.scenario, seed=8)
    here, there = (
        [factor_of(index, one.window) for one in windows(each, 30, length_m=30.0)]
        for each in (city, abroad)
    )
    assert np.quantile(here, 0.1) > 10.0 > -10.0 > np.quantile(there, 0.9)


def factor_of(index: MapIndex, window: Window) -> float:
    """At the best place."""
    return best_fit_of(index, window).factor


def here_of(index: MapIndex, window: Window) -> float:
    """Log likelihood of this road, drifted little, at the best place."""
    query = ask(index, window)
    places = place(index, query).places
    best = int(places.score.argmax())
    number, sign = places.where[:, best].tolist()
    road = index.roads[number]
    at = OnRoad.of(road, sign, float(places.chainage_m[best]))
    prior = query.prior(index)
    cooled = min(prior.temperature, 1.0)
    return log_likelihoods(query, road, at, cooled, prior.at(1.0)).here


def best_fit_of(index: MapIndex, window: Window, own: RoadIndex | None = None) -> Fit:
    query = ask(index, window)
    places = place(index, query).places
    fit = fit_of_place(index, query, places, int(places.score.argmax()), own=own)
    assert fit is not None
    return fit


def test_what_has_drifted_is_still_this_road():
    """
    A cell 3 dB off all along costs less than readings that stray as far, each for itself: by the
    law of this road as the survey's devices read it.
    """
    index = index_of(cells=6)
    rng, gentle, rough = np.random.default_rng(4), [], []
    for one in windows(city_of(cells=6), 20, length_m=30.0):
        window = one.window
        stray = rng.choice([-3.0, 3.0], window.rsrp_dbm.shape)
        for found, by_db in ((gentle, stray[:1]), (rough, stray)):
            found.append(here_of(index, replace(window, rsrp_dbm=window.rsrp_dbm + by_db)))
    assert np.median(gentle) > np.median(rough) + 20.0


def test_areas_that_err_apart_ask_for_the_factor_and_others_do_not():
    """Real streets, whose samples err together, answer as ever."""
    index = index_of(cells=6)
    assert err_apart(index.calibration)
    assert index.calibration.off_map[FACTOR] > 0.0
    together = dataclasses.replace(index.calibration, information_once=0.4, information_each=0.1)
    assert not err_apart(together)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    assert factor_of(index, window) != 0.0
    assert factor_of(index.recalibrated(together), window) == 0.0


def test_older_maps_that_learnt_the_evidence_still_ask_for_it():
    """Seven terms, of before the factor: what they were learnt with is weighed, and only then."""
    index = index_of(cells=6)
    window = next(iter(windows(city_of(cells=6), 1, length_m=30.0))).window
    older = replace(index.calibration, off_map=(0.5, 2.0, 0.0, 0.0, 0.0, 0.4, -0.4))
    assert best_fit_of(index.recalibrated(older), window).elsewhere != 0.0
    assert best_fit_of(index, window).elsewhere == 0.0


def test_a_held_out_window_meets_its_road_without_its_day():
    """Given a road in the map's place, the factor is of that; of another number, of the map's."""
    index, models = index_of(cells=6), models_of(cells=6)
    one = next(iter(windows(city_of(cells=6), 1, length_m=30.0)))
    number = index.road_ids.index(one.truth.road_id)
    turned = replace(models[number], mean_dbm=models[number].mean_dbm[::-1])
    fits = [
        best_fit_of(index, one.window, index.road_with(at, turned)).factor
        for at in (number, (number + 1) % len(models))
    ]
    assert fits[0] < fits[1] - 50.0
    assert fits[1] == factor_of(index, one.window)


def test_strangers_of_another_city_are_told():
    """With the odds that the map has learnt, most are answered off the map, and no window on it."""
    index = index_of(cells=6)
    abroad = build_city(replace(preset("paper"), cells=6), seed=9)
    refused = [
        np.mean([locate(index, one.window).off_map for one in windows(each, 40, length_m=30.0)])
        for each in (city_of(cells=6), abroad)
    ]
    assert refused[0] == 0.0
    assert refused[1] > 0.9
