"""Laws of fitting that hold for any passes: what may not move a model, and what moves with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Line, Road, RoadModel, Trace
from app.numerics.roadfit import fit_road
from tests.factories import line_at, trace_along

ROAD = Road("r", line=line_at(length_m=90.0))
laws = settings(derandomize=True, deadline=None, max_examples=8)


@st.composite
def any_passes(draw) -> list[Trace]:
    """One to three passes along 90 m, at different steps, with and without position noise."""
    seed = draw(st.integers(0, 100_000))
    return [
        trace_along(
            ROAD.line,
            seed=seed + number,
            step_m=draw(st.sampled_from([1.0, 3.0])),
            noise_m=draw(st.sampled_from([0.0, 2.0])),
            cells=("a", "b"),
        )
        for number in range(draw(st.integers(1, 3)))
    ]


def grids(model: RoadModel) -> list[np.ndarray]:
    edges_m = np.array([segment.start_m for segment in model.segments])
    return [model.mean_dbm, model.spread_db, model.heard, model.features, edges_m, model.evidence]


@laws
@given(passes=any_passes(), seed=st.integers(0, 1000))
def test_repeats_and_order_move_no_fit(passes, seed):
    """Passes repeated and shuffled make the same model, bit by bit."""
    order = np.random.default_rng(seed).permutation(2 * len(passes))
    shuffled = [(passes + passes)[i] for i in order]
    for mine, theirs in zip(
        grids(fit_road(ROAD, passes)), grids(fit_road(ROAD, shuffled)), strict=True
    ):
        np.testing.assert_array_equal(mine, theirs)


@laws
@given(passes=any_passes(), offset_db=st.sampled_from([-8.0, 4.0]))
def test_another_device_moves_levels_alone(passes, offset_db):
    """Surveys 4 dB louder make curves 4 dB higher, and the same spread and hearing."""
    louder = [replace(one, rsrp_dbm=one.rsrp_dbm + np.float32(offset_db)) for one in passes]
    here, there = fit_road(ROAD, passes), fit_road(ROAD, louder)
    np.testing.assert_allclose(there.mean_dbm, here.mean_dbm + offset_db, atol=2e-3)
    np.testing.assert_allclose(there.spread_db, here.spread_db, atol=2e-3)
    np.testing.assert_array_equal(there.heard, here.heard)


@laws
@given(passes=any_passes())
def test_reversing_the_road_mirrors_the_chainage(passes):
    """A road drawn from its other end has the same curves, mirrored, within the grid's step."""
    line = ROAD.line
    turned = Road("r", line=Line(line.lon[::-1].copy(), line.lat[::-1].copy()))
    here, there = fit_road(ROAD, passes), fit_road(turned, passes)
    assert there.length_m == pytest.approx(here.length_m, abs=1e-6)
    at_m = np.linspace(10.0, here.length_m - 10.0, 40)
    grid_m = np.arange(len(here.mean_dbm)) * here.step_m
    for cell in range(2):
        forward = np.interp(at_m, grid_m, here.mean_dbm[:, cell])
        mirrored = np.interp(here.length_m - at_m, grid_m, there.mean_dbm[:, cell])
        # Knots lie elsewhere, counted from the other end; the curve is the same but for that.
        assert np.sqrt(np.mean((forward - mirrored) ** 2)) < 0.7


@laws
@given(passes=any_passes())
def test_a_model_is_whole(passes):
    """Whatever the passes, a model's sub-segments tile the road and its numbers are finite."""
    model = fit_road(ROAD, passes)
    edges_m = [segment.start_m for segment in model.segments] + [model.segments[-1].end_m]
    assert edges_m[0] == 0.0
    assert edges_m[-1] == model.length_m
    assert np.all(np.diff(edges_m) > 0.0)
    assert np.isfinite(model.evidence).all()
    mapped = ~np.isnan(model.mean_dbm)
    assert np.isfinite(model.spread_db[mapped]).all()
    assert np.all(model.spread_db[mapped] > 0.0)
