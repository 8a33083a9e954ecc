"""Sub-segments end where a trend changes: known breaks, lengths kept, no order, no memory."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruptures.detection import BottomUp

from app.numerics import segmentation
from app.numerics.segmentation import GradientVarianceCost, SegmentationParams, cut_road


def roof(break_m: float, length_m: float, step_m: float, cells: int = 1) -> np.ndarray:
    """Levels that rise by 0.3 dB/m to the break and fall by as much beyond it."""
    grid_m = np.arange(0.0, length_m + step_m / 2, step_m)
    return -80.0 - 0.3 * np.abs(grid_m - break_m)[:, None] * np.ones(cells)


def wavy(seed: int, cells: int = 4, grid: int = 301) -> np.ndarray:
    """Curves like fitted ones: random walks of the slope, over 300 m."""
    rng = np.random.default_rng(seed)
    slope = np.cumsum(rng.normal(0, 0.03, (grid, cells)), axis=0)
    return -90.0 + np.cumsum(slope - slope.mean(axis=0), axis=0)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    break_m=st.integers(35, 75),
    step_m=st.sampled_from([0.5, 1.0, 2.0]),
    seed=st.integers(0, 1000),
)
def test_a_break_of_slope_is_found_within_two_steps(break_m, step_m, seed):
    """A cut lies at the only break of slope, under small noise, whatever the grid's step."""
    level_dbm = roof(float(break_m), 110.0, step_m, cells=2)
    level_dbm += np.random.default_rng(seed).normal(0, 0.02, level_dbm.shape)
    params = SegmentationParams(max_length_m=200.0)
    edges_m = cut_road(level_dbm, step_m, 110.0, params)
    assert np.abs(edges_m - break_m).min() <= 2.0 * step_m


def trends(seed: int) -> np.ndarray:
    """Six cells whose slopes change each 30 m of 300 m, on a field far rougher than they are."""
    rng = np.random.default_rng(seed)
    slope = rng.uniform(-0.5, 0.5, (10, 6)).repeat(30, axis=0)
    steps = slope + rng.normal(0.0, 0.8, slope.shape)
    return -90.0 + np.concatenate([np.zeros((1, 6)), np.cumsum(steps, axis=0)])


def test_roughness_within_a_trend_hides_no_trend():
    """On a field as rough as real ones most changes are found, metre by metre next to none."""
    found = {1.0: 0, 5.0: 0}
    for seed in range(12):
        for trend_m in found:
            params = SegmentationParams(max_length_m=300.0, trend_m=trend_m)
            edges_m = cut_road(trends(seed), 1.0, 300.0, params)
            breaks_m = range(30, 300, 30)
            found[trend_m] += sum(np.abs(edges_m - at_m).min() <= 4.0 for at_m in breaks_m)
    assert SegmentationParams().trend_m == 5.0
    assert found[5.0] >= 0.6 * 12 * 9
    assert found[1.0] < 0.5 * found[5.0]


@settings(derandomize=True, deadline=None, max_examples=30)
@given(break_m=st.integers(20, 90), trend_m=st.sampled_from([1.0, 5.0, 9.0]))
def test_a_cut_lies_where_the_curve_breaks(break_m, trend_m):
    """However long a trend is, a clean break is cut at its very metre."""
    params = SegmentationParams(max_length_m=200.0, trend_m=trend_m)
    edges_m = cut_road(roof(float(break_m), 110.0, 1.0), 1.0, 110.0, params)
    np.testing.assert_allclose(edges_m, [0.0, break_m, 110.0])


def test_a_clean_break_is_the_only_cut():
    """Without noise, one break makes two sub-segments."""
    edges_m = cut_road(roof(50.0, 110.0, 1.0), 1.0, 110.0, SegmentationParams(max_length_m=200.0))
    np.testing.assert_allclose(edges_m, [0.0, 50.0, 110.0])


def test_a_break_of_one_cell_among_many_is_found():
    """A singular point is where the gradient of at least one cell changes."""
    level_dbm = np.full((121, 6), -90.0)
    level_dbm[:, 4] = roof(60.0, 120.0, 1.0)[:, 0]
    edges_m = cut_road(level_dbm, 1.0, 120.0, SegmentationParams(max_length_m=200.0))
    assert 60.0 in edges_m


def test_a_straight_road_is_cut_for_length_alone():
    """Where no trend changes, cuts are the even ones of the maximum length."""
    level_dbm = -80.0 - 0.1 * np.arange(201.0)[:, None]
    np.testing.assert_allclose(cut_road(level_dbm, 1.0, 200.0), [0.0, 50.0, 100.0, 150.0, 200.0])


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000), order=st.permutations(range(4)))
def test_permuting_cells_moves_no_boundary(seed, order):
    """Sub-segments are the same for every order of the cells."""
    level_dbm = wavy(seed)
    there = cut_road(level_dbm, 1.0, 300.0)
    np.testing.assert_array_equal(cut_road(level_dbm[:, order], 1.0, 300.0), there)


@pytest.mark.parametrize("seed", [1, 939, 1276, 1348])
def test_permuting_cells_moves_no_boundary_at_ties(seed):
    """The same where many cuts cost alike, and the last bit of a sum would choose."""
    rng = np.random.default_rng(seed)
    slope = rng.choice([-0.3, -0.1, 0.0, 0.1, 0.3], (20, 7)).repeat(6, axis=0)
    level_dbm = -90.0 + np.cumsum(slope, axis=0)
    turned = level_dbm[:, rng.permutation(7)]
    for params in (SegmentationParams(), SegmentationParams(2.0, 4.0, 500.0)):
        there = cut_road(level_dbm, 1.0, 119.0, params)
        np.testing.assert_array_equal(cut_road(turned, 1.0, 119.0, params), there)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000), least=st.sampled_from([4.0, 16.0, 30.0]))
def test_lengths_keep_their_bounds(seed, least):
    """Boundaries grow from 0 to the road's end, no piece is longer or shorter than allowed."""
    params = SegmentationParams(min_length_m=least, max_length_m=60.0)
    edges_m = cut_road(wavy(seed), 1.0, 299.6, params)
    assert edges_m[0] == 0.0
    assert edges_m[-1] == 299.6
    lengths_m = np.diff(edges_m)
    assert lengths_m.max() <= 60.0 + 1e-9
    assert lengths_m.min() >= least - 1.0  # the last piece of grid may be cut by the road's end


def test_a_higher_price_never_makes_more_cuts():
    """The number of sub-segments falls as a cut gets dearer."""
    level_dbm = wavy(3)
    counts = [
        len(cut_road(level_dbm, 1.0, 300.0, SegmentationParams(price_m, 2.0, 1000.0)))
        for price_m in (0.5, 2.0, 6.0, 20.0, 100.0, 400.0)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 5
    assert counts[-1] == 2


def test_an_unmapped_cell_is_no_trend():
    """A cell that is mapped nowhere moves no boundary."""
    level_dbm = wavy(4)
    silent = np.column_stack([level_dbm, np.full(len(level_dbm), np.nan)])
    np.testing.assert_array_equal(cut_road(silent, 1.0, 300.0), cut_road(level_dbm, 1.0, 300.0))


def test_a_level_offset_moves_no_boundary():
    """Cuts follow gradients: another device moves none."""
    level_dbm = np.round(wavy(5) * 64) / 64  # exact in binary, so that differences are the same
    np.testing.assert_array_equal(
        cut_road(level_dbm + 8.0, 1.0, 300.0), cut_road(level_dbm, 1.0, 300.0)
    )


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_the_shortest_roads_are_one_piece(rows):
    """A road of one or two grid steps is one sub-segment."""
    length_m = float(max(rows - 1, 1))
    np.testing.assert_array_equal(
        cut_road(np.full((rows, 2), -90.0), 1.0, length_m), [0.0, length_m]
    )


@settings(derandomize=True, deadline=None, max_examples=60)
@given(seed=st.integers(0, 1000), start=st.integers(0, 57), size=st.integers(1, 60))
def test_cost_is_the_definition(seed, start, size):
    """The cost is Eq. (5)'s numerator: squared gradients about their mean, summed over cells."""
    gradient = np.random.default_rng(seed).normal(0.2, 0.3, (60, 5))
    part = gradient[start : start + size]
    naive = sum(
        (row[cell] - part[:, cell].mean()) ** 2 for row in part for cell in range(part.shape[1])
    )
    cost = GradientVarianceCost().fit(gradient)
    assert cost.error(start, start + len(part)) == pytest.approx(naive, rel=1e-9, abs=1e-9)


def test_every_position_may_be_a_cut():
    """The search looks at each position: ruptures' own grid of five would miss 23 and 41."""
    level_dbm = np.concatenate([np.arange(24.0), 23.0 - 3.0 * np.arange(1, 19.0), [-31.0] * 30])
    edges_m = cut_road(level_dbm[:, None], 1.0, 71.0, SegmentationParams(max_length_m=200.0))
    assert {23.0, 41.0} <= set(edges_m.tolist())


def test_no_road_is_remembered(monkeypatch):
    """After a cut nothing keeps the road's gradients alive, and ruptures' cache is empty."""
    fitted = []

    class Watched(GradientVarianceCost):
        def fit(self, signal):
            fitted.append(weakref.ref(self))
            return super().fit(signal)

    monkeypatch.setattr(segmentation, "GradientVarianceCost", Watched)
    cut_road(wavy(6), 1.0, 300.0)
    gc.collect()
    assert fitted
    assert all(cost() is None for cost in fitted)
    assert BottomUp.merge.cache_info().currsize == 0
