"""The kernels in C give what the numpy code gives that defines them, and refuse everything else."""

from __future__ import annotations

import dataclasses
import shutil
import sysconfig
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from app.domain import Calibration, RoadModel, Window
from app.numerics import coarse, native, native_chosen, observation, posterior, stretches
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, locate, shortlist
from app.numerics.odometer import under_other_factors
from app.numerics.query import ask
from app.numerics.refinement import refine
from app.numerics.summary import summarise
from app.numerics.tapes import COARSE_STEPS_M, GAP
from tests.numerics.tiny import gentle_models, map_of, tiny_models, window_along

built = pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
SEEDS = st.integers(0, 10_000)
# Scores are sums of float32 in another order: within 1e-5 of what is added up, here some thousands.
SCORES = {"rtol": 1e-5, "atol": 0.02}


def test_the_kernels_are_built_where_they_can_be():
    """With a compiler and Python's headers, nobody is left with the slow half unawares."""
    if shutil.which("cc") is None or not Path(sysconfig.get_path("include"), "Python.h").exists():
        pytest.skip("no C compiler or no Python.h")
    assert native.BUILT


@cache
def gentle(seed: int) -> tuple[RoadModel, ...]:
    return gentle_models(seed)


@cache
def index_of(seed: int) -> MapIndex:
    return map_of(gentle(seed))


def a_window(seed: int, extra: tuple[str, ...] = ()) -> Window:
    samples = int(np.random.default_rng(seed).integers(1, 40))
    road, sign = gentle(seed % 5)[seed % 3], 1 if seed % 2 else -1
    return window_along(road, seed, samples=samples, sign=sign, extra=extra)


@built
@settings(max_examples=60, deadline=None)
@given(SEEDS, st.integers(1, 30), st.integers(0, 4), st.sampled_from([0.3, 1.0, 4.0]))
def test_evidence_is_the_same(seed, samples, cells, step_m):
    """Readings missing, cars standing, columns in any order."""
    rng = np.random.default_rng(seed)
    distance_m = np.sort(rng.choice([0.0, 0.1, 2.0, 2.4, 3.0, 11.0], samples) * rng.uniform(1, 2))
    rsrp_dbm = rng.uniform(-120.0, -70.0, (samples, cells + 1))
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.4] = np.nan
    columns = rng.permutation(cells + 1)[:cells].tolist()
    carrier = rng.integers(0, 3, cells)
    group = list(range(cells))
    told, seen = native.evidence(distance_m, rsrp_dbm, columns, step_m, carrier.tolist(), group)
    assert told.group == group
    wanted = observation.evidence(distance_m, rsrp_dbm[:, columns], step_m, carrier)
    for field in dataclasses.fields(wanted):
        np.testing.assert_allclose(
            getattr(seen, field.name), getattr(wanted, field.name), rtol=1e-12, atol=1e-12
        )
    heard = [i for i in range(cells + 1) if not np.isnan(rsrp_dbm[:, i]).all()]
    assert native.heard_columns(rsrp_dbm) == heard


@built
@settings(max_examples=25, deadline=None)
@given(SEEDS, st.sampled_from([1.0, 4.0, 12.0]), st.sampled_from([(), ("b", "e"), ("x",)]))
def test_tapes_are_scored_the_same(seed, stretched, extra):
    """Both directions, at every step, with cells that the tape lacks."""
    window = a_window(seed, tuple(one for one in extra if one not in "abc"))
    window = dataclasses.replace(window, distance_m=window.distance_m * stretched)
    index = map_of(tiny_models(seed % 7)) if seed % 2 else index_of(seed % 5)
    fast, plain = ask(index, window, in_c=True), ask(index, window)
    size = next(i for i, step in enumerate(COARSE_STEPS_M) if plain.length_m <= step * (GAP - 1))
    for tape in index.tapes:
        level = tape.levels[size]
        ours, wanted = np.empty((2, len(level.places)), dtype=np.float32)
        coarse._score_tape(index, fast, tape.column, level, None, ours)
        coarse._score_tape(index, plain, tape.column, level, None, wanted)
        np.testing.assert_allclose(ours, wanted, **SCORES)


@built
@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.integers(-80, 0), min_size=1, max_size=300),
    st.floats(0.05, 5.0),
    st.sampled_from([1e-4, 0.01, 0.5]),
    st.integers(1, 40),
)
def test_the_same_places_are_kept(levels, temperature, left_out, most):
    """Ties, of which whole numbers make many, fall to the earlier places."""
    score = np.array(levels, dtype=np.float32)
    kept = native_chosen.kept_by_mass(score, temperature, left_out, most)
    wanted = posterior.kept_by_mass(score.astype(np.float64), temperature, left_out, most)
    # Where the mass reaches the bound to the last bit, one place more or less is right.
    weight = np.exp((score.astype(np.float64) - score.max()) / temperature)
    gained = np.sort(weight)[::-1].cumsum() / weight.sum()
    if np.abs(gained - (1.0 - left_out)).min() > 1e-9:
        assert kept.tolist() == wanted.tolist()
    else:
        assert abs(len(kept) - len(wanted)) <= 1


@built
@settings(max_examples=25, deadline=None)
@given(SEEDS, st.sampled_from([1.0, 30.0, 90.0]), st.data())
def test_stretches_are_scored_the_same(seed, stretched, data):
    """Within a road, off its ends, with cells that it lacks; far longer windows than roads."""
    window = a_window(seed, ("e", "x"))
    window = dataclasses.replace(window, distance_m=window.distance_m * (stretched / 25.0))
    index = index_of(seed % 5)
    fast, plain = ask(index, window, in_c=True), ask(index, window)
    places, wanted = [], []
    for road in index.roads:
        first = data.draw(st.integers(0, road.grid_size - 1))
        last = data.draw(st.integers(first, road.grid_size - 1))
        sign = data.draw(st.sampled_from([1, -1]))
        places.append((road.number, sign, first, last))
        wanted.append(stretches.along(index, plain, *places[-1]))
    ours = stretches.lay(index, fast, places)
    joined = posterior.Places.join(wanted)
    assert (ours.where == joined.where).all()
    np.testing.assert_allclose(ours.values, joined.values, **SCORES)


@built
@settings(max_examples=25, deadline=None)
@given(SEEDS, st.floats(0.2, 3.0), st.floats(0.05, 0.99), st.sampled_from([0.0, 2.0]))
def test_refinement_and_summary_are_the_same(seed, temperature, confidence, position_sd_m):
    """From the same places: the finer ones, then road, position, radius and rivals in order."""
    window = a_window(seed, ("e",))
    calibration = Calibration(
        information_each=1.0 / temperature,
        position_sd_m=position_sd_m,
        segment_sd_m=2.0 * position_sd_m,
    )
    index = map_of(gentle(seed % 5), calibration)
    fast, plain = ask(index, window, in_c=True), ask(index, window)
    places = fine_places(index, fast, shortlist(index, fast))
    ours, wanted = refine(index, fast, places), refine(index, plain, places)
    assert (ours.where == wanted.where).all()
    np.testing.assert_allclose(ours.values, wanted.values, rtol=1e-9, atol=1e-9)
    told = summarise(index, ours, temperature, confidence, in_c=True)
    known = summarise(index, ours, temperature, confidence, in_c=False)
    assert (told.road, told.peak) == (known.road, known.peak)
    for field in ("road_mass", "chainage_m", "lon", "lat", "heading_deg"):
        assert getattr(told, field) == pytest.approx(getattr(known, field), rel=1e-9, abs=1e-9)
    assert told.radius_m == pytest.approx(known.radius_m, abs=1e-4)
    assert told.rivals == sorted(told.rivals, key=lambda one: (-one[3], one[0], one[1], -one[2]))
    # Nearly equal masses are ordered by their last bits.
    for rival, other in zip(sorted(told.rivals), sorted(known.rivals), strict=True):
        assert rival == pytest.approx(other, rel=1e-9, abs=1e-12)


@built
@settings(max_examples=25, deadline=None)
@given(SEEDS, st.sampled_from([(), ("x",), ("e", "d2")]), st.floats(0.1, 0.95))
def test_fixes_are_the_same(seed, extra, confidence):
    """From request to answer, whatever the kernels' sums differ by."""
    window = a_window(seed, extra)
    assume(len(window.distance_m) > 1)  # one sample fits both directions alike: last bits choose
    index = index_of(seed % 5)
    fast = locate(index, window, confidence=confidence, in_c=True)
    plain = locate(index, window, confidence=confidence, in_c=False)
    for field in dataclasses.fields(fast):
        ours, wanted = getattr(fast, field.name), getattr(plain, field.name)
        if isinstance(wanted, float):
            assert ours == pytest.approx(wanted, rel=1e-4, abs=1e-3), field.name
        elif field.name != "candidates":
            assert ours == wanted, field.name
    assert sum(one.posterior for one in fast.candidates) == pytest.approx(
        1.0 - fast.off_map_posterior
    )


@pytest.mark.parametrize("in_c", [pytest.param(True, marks=built), False])
def test_a_posterior_spread_thin_has_a_radius(in_c):
    """Of 20,000 places with the same mass, none is negligible."""
    index = index_of(3)
    count = 20_000
    values = np.zeros((posterior.VALUES, count))
    values[posterior.CHAINAGE] = np.linspace(0.0, 50.0, count)
    values[posterior.WIDTH] = 1.0
    places = posterior.Places(np.tile([[0], [1]], count), values)
    assert 10.0 < summarise(index, places, 1.0, 0.68, in_c=in_c).radius_m < 30.0


@built
@settings(max_examples=60, deadline=None)
@given(SEEDS, st.sampled_from([0.5, 1.0, 20.0]))
def test_other_factors_are_the_same(seed, temperature):
    """Stretches about the places that carry mass, laid under every factor and drawn anew."""
    calibration = Calibration(information_each=1.0 / temperature)
    index, window = map_of(gentle(seed % 5), calibration), a_window(seed)
    plain, fast = ask(index, window), ask(index, window, in_c=True)
    straight = refine(index, plain, fine_places(index, plain, shortlist(index, plain)))
    others = straight.slice(0, 2).take(np.array([1, 0]))
    before = posterior.Places.join((straight, others))
    slow, quick = (under_other_factors(index, one, straight, before) for one in (plain, fast))
    assert (slow is None) == (quick is None)
    if slow is None or quick is None:
        return
    np.testing.assert_array_equal(quick.known.log_prior, slow.known.log_prior)
    np.testing.assert_array_equal(quick.known.factor, slow.known.factor)
    assert quick.together == pytest.approx(slow.together, abs=1e-12)
    np.testing.assert_array_equal(quick.places.where, slow.places.where)
    np.testing.assert_allclose(quick.places.values, slow.places.values, **SCORES)
