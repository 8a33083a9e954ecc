"""What a device does not list counts as silence only where it lists as many cells as surveys do."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import RadioMap, Window
from app.evaluation.scenario import survey, windows
from app.numerics import native, native_readings
from app.numerics.calibration import calibrate
from app.numerics.index import MapIndex
from app.numerics.listing import (
    FEW,
    LEAST,
    USUAL,
    as_listed,
    silence_counts,
    strongest,
    times_usual,
    usual_numbers,
)
from app.numerics.matching import locate
from app.numerics.observation import evidence
from app.numerics.query import ask
from app.numerics.roadfit import fit_road
from tests.numerics.cities import city_of, index_of, models_of
from tests.numerics.test_native import a_window, built
from tests.numerics.test_native import index_of as gentle_index


def heard_by(counts: list[int], cells: int) -> Window:
    """Samples 10 m apart, each of the first cells of one carrier."""
    rsrp_dbm = np.full((len(counts), cells), np.nan)
    for row, count in enumerate(counts):
        rsrp_dbm[row, :count] = -90.0
    names = tuple(f"100:{number}" for number in range(cells))
    return Window(names, np.arange(len(counts)) * 10.0, rsrp_dbm)


def times_of(window: Window, usual: float) -> float:
    """How many times the usual cells it lists."""
    count = len(window.cells)
    seen = evidence(window.distance_m, window.rsrp_dbm, 1.0, np.zeros(count, dtype=np.intp))
    return times_usual(seen, np.full(count, usual))


def test_silence_counts_in_full_where_as_many_are_listed_as_usual():
    """Less below seven tenths of that, never nothing."""
    for counts, usual, wanted in (
        ([5, 5, 5], 5.0, 1.0),
        ([8, 8, 8], 5.0, 1.0),
        ([4, 3, 4], 5.0, 1.0),
        ([9, 9], 9.0 / (0.5 * (FEW + USUAL)), 0.5),
        ([1, 1, 1], 8.0, LEAST),
    ):
        times = times_of(heard_by(counts, 9), usual)
        assert times == pytest.approx(np.mean(counts) / usual)
        assert silence_counts(times) == pytest.approx(wanted)


@built
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 30.0))
def test_the_kernel_says_the_same(seed, usual):
    """In place, beside all else that a window says."""
    index, window = gentle_index(seed % 5), a_window(seed)
    query = ask(index, window)
    told, seen = native.evidence(
        window.distance_m,
        window.rsrp_dbm,
        [window.cells.index(cell) for cell in query.cells],
        1.0,
        [0] * len(query.cells),
        query.group.tolist(),
    )
    each = usual * np.random.default_rng(seed).uniform(0.5, 1.5, len(query.cells))
    wanted, times = as_listed(dataclasses.replace(seen, share=seen.share.copy()), each)
    readings = float((seen.weight @ seen.heard).sum())
    assert native_readings.listen(told, each) == pytest.approx((times, readings), rel=1e-12)
    for field in dataclasses.fields(wanted):
        ours = getattr(seen, field.name)
        np.testing.assert_allclose(ours, getattr(wanted, field.name), rtol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 12), st.integers(1, 6))
def test_the_strongest_are_those_that_no_other_of_the_carrier_is_above(seed, samples, cells):
    """As many as usual, one at least, of every sample and carrier by itself; ties to the first."""
    rng = np.random.default_rng(seed)
    rsrp_dbm = rng.integers(-110, -100, (samples, cells)).astype(float)
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.3] = np.nan
    carrier, usual = rng.integers(0, 2, cells), rng.uniform(0.2, 4.0, cells)
    kept_dbm = strongest(rsrp_dbm, carrier, usual)
    for row in range(samples):
        for number in range(2):
            own = [c for c in np.flatnonzero(carrier == number) if not np.isnan(rsrp_dbm[row, c])]
            most = max(round(float(np.mean(usual[own]))), 1) if own else 0
            loudest = sorted(own, key=lambda c: -rsrp_dbm[row, c])[:most]
            kept = [c for c in own if not np.isnan(kept_dbm[row, c])]
            assert sorted(loudest) == kept
    same = ~np.isnan(kept_dbm)
    np.testing.assert_array_equal(kept_dbm[same], rsrp_dbm[same])


@pytest.mark.parametrize("in_c", [True, False])
def test_a_window_of_a_map_of_serving_cells_is_heard_as_its_phone_would(in_c):
    """Surveyed by phones that list one cell, asked by one that lists six: the strongest counts."""
    index = map_of_serving_cells()
    asked = list(windows(city_of(cells=6), 20, length_m=30.0))
    right = 0
    for one in asked:
        query = ask(index, one.window, in_c=in_c and native.BUILT)
        heard = ~np.isnan(query.rsrp_dbm)
        assert heard.sum(axis=1).max() <= 2
        assert heard.any(axis=1).all()
        right += locate(index, one.window, in_c=in_c and native.BUILT).road_id == one.truth.road_id
    assert right >= 18


@cache
def map_of_serving_cells() -> MapIndex:
    city = city_of(cells=6)
    passes = []
    for one in survey(city):
        rank = np.argsort(np.argsort(-np.nan_to_num(one.rsrp_dbm, nan=-200.0), axis=1), axis=1)
        served = np.where(rank < 1, one.rsrp_dbm, np.nan).astype(np.float32)
        passes.append(dataclasses.replace(one, rsrp_dbm=served))
    models = [
        fit_road(truth.road, [one for one in passes if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    return MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))


def test_usual_numbers_are_what_the_survey_heard():
    """Six cells that are always heard: six, but for what a survey leaves in doubt."""
    usual = usual_numbers(models_of(cells=6))
    assert len(usual) == 6
    assert 5.0 < min(usual.values()) <= max(usual.values()) <= 6.0


def test_usual_numbers_are_of_the_places_that_know_the_cell():
    """A road elsewhere that hears one cell alone changes nothing of the others."""
    model = models_of(cells=6)[0]
    quiet = dataclasses.replace(model, cells=tuple(f"elsewhere-{cell}" for cell in model.cells))
    alone, together = usual_numbers([model]), usual_numbers([model, quiet])
    assert {cell: together[cell] for cell in model.cells} == alone


def test_a_phone_of_one_cell_a_sample_is_not_sent_to_a_quiet_road():
    """Of six cells the strongest alone: silence counts a tenth, and the road is still found."""
    index = index_of(cells=6)
    shares = []
    for keep in (1, 6):
        road = models_of(cells=6)[0]
        rows = slice(100, 130)
        rsrp_dbm = road.mean_dbm[rows].astype(float)
        strongest = np.argsort(-rsrp_dbm, axis=1)
        for row, order in enumerate(strongest):
            rsrp_dbm[row, order[keep:]] = np.nan
        window = Window(road.cells, np.arange(30.0), rsrp_dbm)
        heard = np.isfinite(rsrp_dbm).any(axis=0)
        cells = tuple(cell for cell, there in zip(road.cells, heard, strict=True) if there)
        window = Window(cells, window.distance_m, rsrp_dbm[:, heard])
        shares.append(float(ask(index, window).fine.share.sum(axis=1).max()))
        assert locate(index, window).road_id == road.road_id
    assert shares == pytest.approx([LEAST, 1.0])
