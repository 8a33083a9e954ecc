"""Laws of coverage: who drove what, and what a window that ends there can tell."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from app.domain import Calibration
from app.numerics.advice import Ground, advise, gain_m, summarise
from app.numerics.coverage import cover
from app.numerics.expectation import (
    FARTHEST_M,
    expected_error_m,
    expected_sd_m,
    road_right,
)
from tests.factories import line_at, model_of, trace_along

LINE = line_at(length_m=400.0)


def model(line=LINE, **changed):
    """A road of four segments whose three cells fall by 0.1 dB/m, spread 2 dB, always heard."""
    plain = model_of("r", seed=1, line=line, segment_count=4)
    grid = np.arange(len(plain.mean_dbm)) * plain.step_m
    ramp = np.tile(-80.0 - 0.1 * grid[:, None], (1, 3)).astype(np.float32)
    ones = np.ones_like(ramp)
    return replace(plain, **{"mean_dbm": ramp, "spread_db": 2.0 * ones, "heard": ones, **changed})


def passes(count: int, **changed):
    found = [trace_along(LINE, seed=seed) for seed in range(count)]
    return [replace(one, **changed) for one in found]


def information(found):
    return np.array(
        [[s.place_information, s.mixed_information, s.offset_information] for s in found]
    )


def test_passes_days_devices_and_directions_are_counted():
    """Dates, not moments; unnamed devices are one; backward is against the line."""
    first, second, third = passes(3)
    second = replace(second, recorded_at=datetime(2021, 5, 8, 23, tzinfo=UTC), device=None)
    third = replace(third, recorded_at=datetime(2021, 5, 9, 1, tzinfo=UTC), device=None,
                    lon=third.lon[::-1], lat=third.lat[::-1])  # fmt: skip
    for one in cover(model(), [first, second, third]):
        assert (one.passes, one.forward, one.backward) == (3, 2, 1)
        assert (one.days, one.devices, one.cells) == (2, 2, 3)
        assert one.last_surveyed_at == third.recorded_at
        assert one.spread_db == pytest.approx(2.0)
        assert one.cells_heard == pytest.approx(3.0)


def test_the_order_of_passes_and_copies_of_them_move_nothing():
    """The same samples twice are one pass."""
    every = passes(3)
    assert cover(model(), every) == cover(model(), [*every[::-1], every[1]])


def test_a_pass_counts_where_it_drove_half_of_a_segment():
    """And nowhere else; a drive elsewhere counts nowhere."""
    short = trace_along(line_at(length_m=260.0), seed=1)
    elsewhere = trace_along(line_at(500.0), seed=2)
    assert [one.passes for one in cover(model(), [short, elsewhere])] == [1, 1, 1, 0]


def test_no_passes_leave_zeros():
    """A model stays readable when nobody is known to have driven it."""
    found = cover(model(), [])
    assert {(one.passes, one.days, one.devices, one.last_surveyed_at) for one in found} == {
        (0, 0, 0, None)
    }


def test_a_ramp_has_the_information_that_the_formula_says():
    """Three cells, 20 samples, 0.1 dB/m and 2 dB: I_ss = 3 * 20 * (0.1 / 2)^2, and so on."""
    middle = information(cover(model(line_at(length_m=1000.0)), passes(1)))[1:3]
    place, mixed, offset = middle.mean(axis=0)
    assert offset == pytest.approx(3 * 20 / 4.0, rel=0.02)
    assert place == pytest.approx(0.01 * offset, rel=0.02)
    assert mixed == pytest.approx(-0.1 * offset, rel=0.02)


def test_the_error_is_the_cramer_rao_bound_where_nothing_else_is_known():
    """Independent samples, no offset, many passes: 1 / sqrt(I_ss)."""
    certain = Calibration(information_once=0.0, information_each=1.0, offset_sd_db=1e-6)
    sd_m = expected_sd_m(np.array([[0.04, 0.1, 9.0]]), np.array([10**9]), certain)
    assert sd_m[0] == pytest.approx(5.0, rel=1e-3)


def test_a_free_offset_leaves_a_lone_ramp_without_a_place():
    """Any level may then be anywhere; the window's own length is the limit."""
    free = Calibration(offset_sd_db=1e6)
    sd_m = expected_sd_m(np.array([[0.09, -0.9, 9.0]]), np.array([5]), free)
    assert sd_m[0] == FARTHEST_M


@pytest.mark.parametrize("more", [{"passes": 8}, {"position_sd_m": 0.0}, {"place": 2.0}])
def test_more_passes_better_positions_and_steeper_signals_lower_the_error(more):
    """Each alone."""
    calibration = Calibration(position_sd_m=4.0, information_each=0.1)
    about = np.array([[0.05, 0.0, 9.0]])
    before = expected_sd_m(about, np.array([1]), calibration)
    after = expected_sd_m(
        about * [more.get("place", 1.0), 1.0, 1.0],
        np.array([more.get("passes", 1)]),
        replace(calibration, position_sd_m=more.get("position_sd_m", 4.0)),
    )
    assert after[0] < before[0]


def test_wrong_roads_stretch_the_median_and_half_of_them_leave_none():
    """All right: the median of |N|; fewer right: more; half or less: not a number."""
    sd_m = np.full(4, 10.0)
    found = expected_error_m(sd_m, np.array([1.0, 0.8, 0.5, 0.0]))
    assert found[0] == pytest.approx(6.745, rel=1e-3)
    assert found[1] > found[0]
    assert np.isnan(found[2:]).all()


def test_more_passes_never_find_fewer_roads():
    """The table is sorted, from none at all."""
    right = road_right(np.arange(20))
    assert right[0] == 0.0
    assert (np.diff(right) >= 0).all()


def ground(**changed):
    """Six stretches of two roads; all driven eight times on four days, both ways."""
    plain = Ground(
        road_id=["a", "a", "a", "b", "b", "b"],
        start_m=np.array([0.0, 50.0, 100.0] * 2),
        end_m=np.array([50.0, 100.0, 150.0] * 2),
        passes=np.full(6, 8),
        forward=np.full(6, 4),
        days=np.full(6, 4),
        expected_error_m=np.full(6, 6.0),
    )
    return replace(plain, **{name: np.array(value) for name, value in changed.items()})


def test_what_is_driven_enough_is_not_worth_a_drive():
    """Eight passes, four days, both ways: no advice; nor where nothing is known."""
    assert advise(ground()) == []
    assert advise(ground(passes=[-1] * 6)) == []
    assert (gain_m(ground(passes=[-1] * 6)) == 0.0).all()


def test_neighbours_of_one_kind_are_one_advice():
    """Never driven, driven once and backward, joined along the road and not across roads."""
    found = advise(
        ground(
            passes=[0, 0, 1, 1, 8, 8],
            forward=[0, 0, 0, 0, 4, 4],
            days=[0, 0, 1, 1, 4, 4],
            expected_error_m=[np.nan, np.nan, 9.0, 9.0, 6.0, 6.0],
        )
    )
    places = [(one.road_id, one.start_m, one.end_m) for one in found]
    assert places == [("a", 0.0, 100.0), ("a", 100.0, 150.0), ("b", 0.0, 50.0)]
    assert found[0].reason == "never driven: no window can be located here"
    assert found[0].expected_error_m is None
    assert found[1].reason.startswith("driven once, only backward; 78%")


def test_one_day_and_one_way_are_named():
    """However often it was driven there."""
    (found,) = advise(ground(days=[4, 1, 4, 4, 4, 4]))
    assert found.reason == "driven 8 times, all on one day"
    (found,) = advise(ground(forward=[8, 4, 4, 4, 4, 4]))
    assert found.reason == "driven 8 times, only forward"


def test_the_longest_of_equals_comes_first():
    """Worth is what a drive takes off, times the length."""
    found = advise(ground(passes=[0, 8, 8, 0, 0, 8]))
    assert [(one.road_id, one.end_m) for one in found] == [("b", 100.0), ("a", 50.0)]


def test_the_summary_weighs_lengths():
    """Lengths add up, shares are of what was driven, percentiles are of the length."""
    found = summarise(
        ground(
            passes=[0, 1, 2, 3, 4, -1],
            forward=[0, 1, 1, 3, 2, 0],
            days=[0, 1, 2, 1, 2, 0],
            expected_error_m=[np.nan, 10.0, 20.0, 30.0, 40.0, np.nan],
        )
    )
    assert found.by_passes_m == {"unknown": 50.0, "0": 50.0, "1": 50.0, "2": 50.0, "3+": 100.0}
    assert (found.both_directions, found.several_days) == (0.5, 0.5)
    assert found.error_m["p50"] == pytest.approx(25.0)


def test_nothing_has_a_summary_too():
    """An empty town."""
    none = np.zeros(0)
    empty = Ground([], none, none, none.astype(int), none.astype(int), none.astype(int), none)
    found = summarise(empty)
    assert (found.length_m, found.both_directions, found.error_m) == (0.0, None, {})
    assert advise(empty) == []
