"""From passes to a model: complete, near the truth, and a function of the measurements alone."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.interpolate import BSpline

from app.domain import Road, RoadModel, Trace
from app.errors import NoCells, NotEnoughSamples, RoadTooShort
from app.evaluation.scenario import build_city, preset, survey
from app.numerics.features import feature_matrix
from app.numerics.roadfit import fit_road
from tests.factories import line_at, trace_along

ROAD = Road("r", line=line_at(length_m=160.0))
CITY = build_city(replace(preset("paper"), survey_passes=2), 9)
TRUTH = CITY.roads[1]
PASSES = [one for one in survey(CITY) if one.road_id == TRUTH.road_id]


def some_passes() -> list[Trace]:
    """Four passes on two days, one of them backward."""
    passes = [trace_along(ROAD.line, seed=i, step_m=3.0, cells=("a", "b", "c")) for i in range(4)]
    back = passes[3]
    turned = replace(
        back,
        lon=back.lon[::-1].copy(),
        lat=back.lat[::-1].copy(),
        rsrp_dbm=back.rsrp_dbm[::-1].copy(),
    )
    later = datetime(2021, 6, 1, tzinfo=UTC)
    return [passes[0], passes[1], replace(passes[2], recorded_at=later), turned]


@pytest.fixture(scope="module")
def fitted() -> RoadModel:
    return fit_road(TRUTH.road, PASSES)


@pytest.fixture(scope="module")
def small() -> RoadModel:
    return fit_road(ROAD, some_passes())


def assert_same(one: RoadModel, other: RoadModel) -> None:
    """All that a model says is the same, bit by bit."""
    assert one.cells == other.cells
    for name in ("mean_dbm", "spread_db", "heard", "features", "evidence"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.salience.mask, other.salience.mask)
    assert sorted(one.heard_on) == sorted(other.heard_on)
    for day, heard in one.heard_on.items():
        np.testing.assert_array_equal(heard, other.heard_on[day])
    assert (one.pass_count, one.sample_count) == (other.pass_count, other.sample_count)
    assert [s.start_m for s in one.segments] == [s.start_m for s in other.segments]
    for mine, theirs in zip(one.segments, other.segments, strict=True):
        np.testing.assert_array_equal(mine.features, theirs.features)
        np.testing.assert_array_equal(mine.salience.mask, theirs.salience.mask)
        assert len(mine.curves) == len(theirs.curves)
        for curve, twin in zip(mine.curves, theirs.curves, strict=True):
            np.testing.assert_array_equal(curve.coefficients_dbm, twin.coefficients_dbm)
            assert (curve.cell, curve.residual_db) == (twin.cell, twin.residual_db)


def test_repeating_every_pass_twice_moves_no_fit(small):
    """The same measurements posted again change nothing."""
    passes = some_passes()
    assert_same(fit_road(ROAD, passes + passes), small)


@pytest.mark.parametrize("seed", [1, 2])
def test_order_of_passes_moves_nothing(small, seed):
    """Passes in any order make the same model, bit by bit."""
    passes = some_passes()
    order = np.random.default_rng(seed).permutation(len(passes))
    assert_same(fit_road(ROAD, [passes[i] for i in order]), small)


def test_order_of_cells_moves_nothing(small):
    """Columns of a survey in any order make the same model, bit by bit."""
    turned = [
        replace(
            one,
            cells=tuple(one.cells[i] for i in (2, 0, 1)),
            rsrp_dbm=one.rsrp_dbm[:, [2, 0, 1]].copy(),
        )
        for one in some_passes()
    ]
    assert_same(fit_road(ROAD, turned), small)


def test_a_cell_never_heard_moves_nothing(small):
    """A column of NaN in a survey leaves no trace in the model."""
    silent = [
        replace(
            one,
            cells=(*one.cells, "zz"),
            rsrp_dbm=np.column_stack(
                [one.rsrp_dbm, np.full(len(one.lon), np.nan, dtype=np.float32)]
            ),
        )
        for one in some_passes()
    ]
    assert_same(fit_road(ROAD, silent), small)


def test_a_model_remembers_what_each_day_heard():
    """A day a date, one for all passes without; a cell that came later was not heard before."""
    first, second, third, _ = some_passes()
    first = replace(first, cells=("a", "b", "z"), rsrp_dbm=first.rsrp_dbm[:, [0, 1, 1]])
    passes = [first, second, third, replace(second, recorded_at=None, lat=second.lat + 1e-6)]
    model = fit_road(ROAD, [replace(one, rsrp_dbm=one.rsrp_dbm.copy()) for one in passes])
    told = {
        day: {cell for cell, there in zip(model.cells, heard, strict=True) if there}
        for day, heard in model.heard_on.items()
    }
    later = {"a", "b", "c"}
    assert told == {"": later, "2021-05-08": later | {"z"}, "2021-06-01": later}


def test_curves_lie_near_the_truth(fitted):
    """Two passes of 2 dB noise give curves within 1.4 dB of the true mean."""
    grid_m = np.minimum(np.arange(len(fitted.mean_dbm)) * fitted.step_m, TRUTH.length_m)
    columns = [TRUTH.cells.index(cell) for cell in fitted.cells]
    true_dbm = TRUTH.mean_dbm(grid_m)[:, columns]
    certain = fitted.heard > 0.95
    assert np.sqrt(np.mean((fitted.mean_dbm - true_dbm)[certain] ** 2)) < 1.4


def test_the_grid_covers_the_road(fitted):
    """Grid arrays reach from 0 to the road's end, NaN exactly where a cell is not mapped."""
    last_m = (len(fitted.mean_dbm) - 1) * fitted.step_m
    assert fitted.length_m <= last_m < fitted.length_m + fitted.step_m
    unmapped = np.isnan(fitted.mean_dbm)
    np.testing.assert_array_equal(np.isnan(fitted.spread_db), unmapped)
    assert np.all((fitted.heard >= 0.0) & (fitted.heard <= 1.0))
    assert np.all(fitted.heard[unmapped] < 0.02)
    assert np.nanmin(fitted.spread_db) > 0.5


def test_segments_tile_the_road(fitted):
    """Sub-segments follow each other from 0 to the road's end, numbered, of the lengths allowed."""
    starts = [segment.start_m for segment in fitted.segments]
    ends = [segment.end_m for segment in fitted.segments]
    assert starts[0] == 0.0
    assert ends[-1] == fitted.length_m
    assert starts[1:] == ends[:-1]
    assert [segment.index for segment in fitted.segments] == list(range(len(starts)))
    assert all(15.0 <= end - start <= 60.001 for start, end in zip(starts, ends, strict=True))


def test_segment_curves_are_the_roads_curves(fitted):
    """Each sub-segment's spline, by scipy, is the grid curve of its cell within the sub-segment."""
    for segment in fitted.segments:
        assert {curve.cell for curve in segment.curves} <= set(fitted.cells)
        grid = np.arange(np.ceil(segment.start_m), min(segment.end_m, fitted.length_m - 1e-6))
        for curve in segment.curves:
            spline = BSpline(curve.knots_m, curve.coefficients_dbm, curve.degree, extrapolate=False)
            assert len(curve.knots_m) == len(curve.coefficients_dbm) + curve.degree + 1
            on_grid = fitted.mean_dbm[grid.astype(int), fitted.cells.index(curve.cell)]
            values = spline(grid)
            assert np.isfinite(values).all()
            mapped = ~np.isnan(on_grid)
            np.testing.assert_allclose(values[mapped], on_grid[mapped], atol=2e-4)
            assert 0.2 < curve.residual_db < 6.0
            assert 1 <= curve.pass_count <= 2


def test_features_are_those_of_the_curves(fitted):
    """Road and sub-segment features are Eq. (3) of the curves on the stretch."""
    grid_m = np.arange(len(fitted.mean_dbm)) * fitted.step_m
    reference = fitted.cells.index(PASSES[0].reference_cell)
    expected = feature_matrix(fitted.mean_dbm, grid_m, reference)
    np.testing.assert_allclose(fitted.features, expected, rtol=1e-5)
    for segment in fitted.segments:
        inside = (grid_m >= segment.start_m) & (grid_m <= segment.end_m)
        part = feature_matrix(fitted.mean_dbm[inside], grid_m[inside], reference)
        np.testing.assert_allclose(segment.features, part, rtol=1e-5, atol=1e-9)
        assert segment.salience.mask.shape == (5, len(fitted.cells))


def test_salience_says_what_it_reached(fitted):
    """Every mask reaches the full gain within tolerance, by a search that is named."""
    for salience in (fitted.salience, *(segment.salience for segment in fitted.segments)):
        assert salience.full_gain_bits - 0.02 - 1e-9 <= salience.gain_bits
        assert salience.gain_bits <= salience.full_gain_bits + 1e-9
        assert salience.search in {"exhaustive", "branch-and-bound", "greedy"}
        assert salience.mask.any()


def test_the_reference_is_the_surveys():
    """The macro cell that surveys name is the reference: its difference to itself is 0."""
    named = [replace(one, reference_cell="b") for one in some_passes()]
    model = fit_road(ROAD, named)
    assert model.features[3, model.cells.index("b")] == 0.0
    assert model.features[3, model.cells.index("a")] != 0.0


def test_a_road_without_a_line_is_drawn_by_its_passes():
    """Passes alone make the same length of road, within metres."""
    drawn = fit_road(Road("r"), some_passes())
    assert drawn.length_m == pytest.approx(160.0, abs=8.0)
    assert drawn.pass_count == 4


def test_a_backward_pass_is_no_other_road(small):
    """A pass driven the other way fits the same curve: spreads do not grow."""
    forward = fit_road(ROAD, some_passes()[:3])
    assert small.pass_count == forward.pass_count + 1
    assert np.nanmean(small.spread_db) < 1.2 * np.nanmean(forward.spread_db)


@pytest.mark.parametrize(
    ("road", "passes", "refused"),
    [
        (ROAD, [], NotEnoughSamples),
        (ROAD, [trace_along(line_at(900.0), seed=1)], NotEnoughSamples),
        (Road("s", line=line_at(length_m=9.0)), some_passes(), RoadTooShort),
        (
            ROAD,
            [replace(one, rsrp_dbm=np.full_like(one.rsrp_dbm, np.nan)) for one in some_passes()],
            NoCells,
        ),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_numbers(road, passes, refused):
    """Too few samples, too short a road and silence each have their error, with a number in it."""
    with pytest.raises(refused, match=r"\d"):
        fit_road(road, passes)


def test_a_rare_cell_has_no_curve():
    """A cell read a few times only is not mapped, and the others are."""
    rare = []
    for number, one in enumerate(some_passes()):
        rsrp_dbm = one.rsrp_dbm.copy()
        rsrp_dbm[5 if number == 0 else 0 :, 2] = np.nan  # five readings, in one pass
        rare.append(replace(one, rsrp_dbm=rsrp_dbm))
    assert fit_road(ROAD, rare).cells == ("a", "b")
