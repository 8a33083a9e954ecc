"""Offsets of carriers: integrals against sums, numpy against C, and what they may move."""

from __future__ import annotations

import dataclasses
from copy import copy
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Calibration, RoadModel, Window
from app.numerics import carriers, coarse, native, stretches
from app.numerics.corners import lay, score_turns
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.offsets import OffsetPrior, take_offsets
from app.numerics.posterior import RESIDUAL
from app.numerics.query import ask
from app.numerics.unseen import ask_at_home, held_out_windows
from tests.numerics import plain
from tests.numerics.cities import models_of
from tests.numerics.tiny import as_laid, gentle_models, map_of, tiny_models, window_along

built = pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
SEEDS = st.integers(0, 10_000)
CARRIERS = {"a": "x", "b": "y", "c": "x", "d": "z", "e": "y"}


def on_carriers(models: tuple[RoadModel, ...]) -> tuple[RoadModel, ...]:
    """The same roads, their cells on three carriers."""
    return tuple(
        dataclasses.replace(one, cells=tuple(f"{CARRIERS[cell]}:{cell}" for cell in one.cells))
        for one in models
    )


@cache
def roads(seed: int) -> tuple[RoadModel, ...]:
    return on_carriers(tiny_models(seed))


@cache
def gentle(seed: int) -> MapIndex:
    return map_of(on_carriers(gentle_models(seed)), Calibration(information_each=0.4))


def window(model: RoadModel, seed: int, samples: int = 9) -> Window:
    return window_along(model, seed, samples=samples, sign=1 if seed % 2 else -1)


@pytest.mark.parametrize(("seed", "temperature"), [(1, 1.0), (2, 5.0), (3, 0.4)])
def test_scores_are_the_integral_over_all_offsets(seed, temperature):
    """The device's, and each carrier's about it, by numerical quadrature; readings tempered."""
    models = roads(10 * seed)
    asked = window(models[seed % 2], seed)
    weight = float(ask(map_of(models), asked).weight)
    index = map_of(models, Calibration(information_each=1.0 / temperature))
    assert ask(index, asked).temperature(index.calibration) == pytest.approx(
        max(temperature, weight / 9)
    )
    places = stretches.whole_roads(index, ask(index, asked))
    found = plain.readings(asked, set(index.cells), as_laid(models))
    sd_db = index.calibration.offset_sd_db
    laid = as_laid(models)
    warm = ask(index, asked).temperature(index.calibration)
    for at in range(0, len(places), 7):
        road, sign = places.where[:, at].tolist()
        place = round(float(places.chainage_m[at] / models[road].step_m))
        wanted, _ = plain.marginal(laid[road], found, place, sign, sd_db, warm, carriers=True)
        assert places.score[at] == pytest.approx(wanted, abs=5e-3, rel=2e-5)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(SEEDS, st.floats(0.2, 20.0))
def test_twice_the_readings_at_twice_the_temperature_say_twice_as_much(seed, temperature):
    """What offsets add keeps step with scores, which are divided by the temperature."""
    rng = np.random.default_rng(seed)
    sums = np.stack([rng.normal(0, 9, 5), rng.uniform(0, 4, 5)] * 3)
    prior = OffsetPrior.learnt(1.5, carriers=3)
    once = take_offsets(sums, prior.at(temperature))
    twice = take_offsets(2.0 * sums, prior.at(2.0 * temperature))
    np.testing.assert_allclose(twice.gain, 2.0 * once.gain, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(twice.residual, 2.0 * once.residual, rtol=1e-9, atol=1e-9)


def test_groups_are_carriers_or_cells():
    """Several carriers always have their own offsets, cells of a single one may have."""
    several, single = map_of(roads(5)), map_of(tiny_models(5))
    assert several.offset_prior.apart == 1.0
    assert several.groups(("x:a", "y:b", "x:c")).tolist() == [0, 1, 0]
    assert 0.0 < single.offset_prior.apart < 0.5
    assert single.groups(("a", "b", "c")).tolist() == [0, 1, 2]


def test_a_louder_carrier_moves_less_than_without_offsets_of_carriers():
    """A vehicle that reads one carrier 4 dB louder is placed nearer to where it would have been."""
    index = gentle(7)
    rigid = copy(index)
    rigid.offset_prior = index.offset_prior._replace(group_db2=0.0)
    moved_m = {True: 0.0, False: 0.0}
    for seed in range(16):
        asked = window(on_carriers(gentle_models(7))[1], seed, samples=20)
        loud = np.array([4.0 if cell.startswith("y:") else 0.0 for cell in asked.cells])
        louder = dataclasses.replace(asked, rsrp_dbm=asked.rsrp_dbm + loud)
        for own, there in ((True, index), (False, rigid)):
            here, moved = (locate(there, one) for one in (asked, louder))
            far = here.road_id != moved.road_id or here.direction != moved.direction
            moved_m[own] += 60.0 if far else abs(here.chainage_m - moved.chainage_m)
    assert moved_m[True] < 0.75 * moved_m[False]


def test_changed_cells_move_little_where_each_may_have_changed():
    """Six cells of one carrier by 5 dB up or down, each for itself."""
    index, models = map_of(models_of("paper")), models_of("paper")
    rigid = copy(index)
    rigid.offset_prior = index.offset_prior._replace(apart=1e-12)
    moved_m: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(12):
        rng = np.random.default_rng(seed)
        asked = window(models[seed % 4], seed, samples=30)
        changed = dataclasses.replace(
            asked, rsrp_dbm=asked.rsrp_dbm + 5.0 * rng.choice([-1.0, 1.0], len(asked.cells))
        )
        for may, there in ((True, index), (False, rigid)):
            here, moved = (locate(there, one) for one in (asked, changed))
            far = here.road_id != moved.road_id or here.direction != moved.direction
            moved_m[may].append(100.0 if far else abs(here.chainage_m - moved.chainage_m))
    assert np.mean(moved_m[True]) < 0.5 * np.mean(moved_m[False])


@pytest.mark.parametrize("apart", [0.05, 0.2, 0.7])
def test_both_hypotheses_share_the_score_by_their_prior(apart):
    """Between all groups together and all apart; the probability of apart is Bayes' rule."""
    rng = np.random.default_rng(4)
    sums = np.stack([rng.normal(0, 9, 50), rng.uniform(0, 4, 50)] * 3)
    known = OffsetPrior.learnt(1.5, carriers=3).at(2.0)
    joined = np.stack([sums[::2].sum(axis=0), sums[1::2].sum(axis=0)])
    together = take_offsets(joined, known._replace(group_db2=0.0)).gain / 2.0
    alone = take_offsets(sums, known).gain / 2.0
    mixed = take_offsets(sums, known._replace(apart=apart))
    wanted = np.log((1.0 - apart) * np.exp(together) + apart * np.exp(alone))
    np.testing.assert_allclose(mixed.gain / 2.0, wanted, rtol=1e-9)
    np.testing.assert_allclose(mixed.apart, apart * np.exp(alone - wanted), rtol=1e-9)
    np.testing.assert_allclose(mixed.residual, joined[0], rtol=1e-12)


@built
@settings(max_examples=30, deadline=None)
@given(SEEDS, st.sampled_from([1.0, 4.0, 12.0]))
def test_carriers_are_taken_alike_in_c(seed, stretched):
    """Tapes and stretches, windows of one to three carriers."""
    index = gentle(seed % 5)
    model = on_carriers(gentle_models(seed % 5))[seed % 3]
    asked = window(model, seed, samples=1 + seed % 30)
    asked = dataclasses.replace(asked, distance_m=asked.distance_m * stretched)
    fast, slow = ask(index, asked, in_c=True), ask(index, asked)
    size = coarse.size_of(slow)
    for tape in index.tapes:
        level = tape.levels[size]
        ours, wanted = np.empty((2, len(level.places)), dtype=np.float32)
        coarse._score_tape(index, fast, tape.column, level, None, ours)
        coarse._score_tape(index, slow, tape.column, level, None, wanted)
        np.testing.assert_allclose(ours, wanted, rtol=1e-5, atol=0.02)
    every: list[stretches.Stretch] = [
        (road.number, way, 0, road.grid_size - 1) for road in index.roads for way in (1, -1)
    ]
    np.testing.assert_allclose(
        stretches.lay(index, fast, every).values,
        stretches.lay(index, slow, every).values,
        rtol=1e-9,
        atol=1e-7,
    )


@cache
def crossing() -> MapIndex:
    """A simulated town whose cells are on three carriers."""
    models = models_of("paper")
    renamed = [
        dataclasses.replace(one, cells=tuple(f"{ord(c[-1]) % 3}:{c}" for c in one.cells))
        for one in models
    ]
    return map_of(tuple(renamed), Calibration(information_each=0.5))


@built
@pytest.mark.parametrize("seed", range(4))
def test_carriers_round_corners_are_taken_alike_in_c(seed):
    """Both halves of a window share a carrier's offset."""
    index = crossing()
    model = max(index.roads, key=lambda road: road.length_m)
    rng = np.random.default_rng(seed)
    cells = tuple(model.cells)
    distance_m = np.arange(0.0, 130.0, 9.0)
    asked = Window(cells, distance_m, rng.uniform(-100, -80, (len(distance_m), len(cells))))
    scores = []
    for in_c in (True, False):
        query = ask(index, asked, in_c=in_c)
        tapes = coarse.tapes_of(index, query)
        laid = lay(index, query, coarse.size_of(query), tapes)
        coarse.score_roads(index, query, tapes, laid)
        scores.append(score_turns(index, query, laid))
    assert np.isfinite(scores[0]).any()
    np.testing.assert_allclose(*scores, rtol=1e-5, atol=0.05)


def test_held_out_windows_have_the_sums_of_every_carrier():
    """Asked on their own road, a residual and a weight of each that the window heard."""
    models = models_of("harsh")[:2]
    names = {cell: f"{number % 3}:{cell}" for number, cell in enumerate(models[0].cells)}
    models = tuple(
        dataclasses.replace(one, cells=tuple(names[cell] for cell in one.cells)) for one in models
    )
    index, windows = map_of(models), held_out_windows(models)[::9]
    for one in ask_at_home(index, models, windows):
        heard = {carriers.carrier_of(models[one.road].cells[at]) for at in one.truth.cells}
        assert len(one.places.values) == RESIDUAL + 2 * len(heard)
        assert (one.places.road == one.road).all()
        assert (one.places.values[RESIDUAL + 1 :: 2] >= 0.0).all()
