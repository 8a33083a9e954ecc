"""Passes on their road: standing cars, both directions, beyond the ends, copies."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from app.domain import Line, Trace
from app.numerics.geodesy import LocalFrame
from app.numerics.passes import END_SLACK_M, REACH_M, all_cells, distinct, lay_on_road
from tests.factories import FRAME, line_at, trace_along

CELLS = ("a", "b")
ROAD = line_at(length_m=200.0)


def fixes(x_m, y_m=0.0, rsrp_dbm=None, *, time_s=None, recorded_at=None) -> Trace:
    """A trace at local metres, its readings of cell ``a`` numbered unless given."""
    x_m = np.asarray(x_m, dtype=float)
    place = FRAME.to_lonlat(x_m, np.broadcast_to(y_m, x_m.shape))
    if rsrp_dbm is None:
        rsrp_dbm = np.column_stack([-100.0 + np.arange(len(x_m)), np.full(len(x_m), np.nan)])
    return Trace(
        cells=CELLS,
        time_s=np.arange(len(x_m), dtype=float) if time_s is None else time_s,
        lon=np.asarray(place.lon),
        lat=np.asarray(place.lat),
        rsrp_dbm=np.asarray(rsrp_dbm, dtype=np.float32),
        recorded_at=recorded_at,
    )


def test_a_standing_car_is_one_row():
    """A hundred readings of one metre are one row: their mean, and the share that heard."""
    rng = np.random.default_rng(31)
    x_m = np.concatenate([np.arange(10.0, 50.0, 5.0), np.full(100, 50.0), np.arange(55.0, 90.0, 5)])
    rsrp_dbm = rng.normal(-90.0, 3.0, (len(x_m), 2))
    rsrp_dbm[8:108:4, 1] = np.nan
    laid = lay_on_road(ROAD, fixes(x_m, 0.0, rsrp_dbm), CELLS, "one")
    assert len(laid.chainage_m) == 8 + 1 + 7
    np.testing.assert_allclose(laid.chainage_m, np.arange(10.0, 90.0, 5.0), atol=0.01)
    stood = rsrp_dbm[8:108].astype(np.float32)
    np.testing.assert_allclose(laid.rsrp_dbm[8], np.nanmean(stood, axis=0), rtol=1e-5)
    np.testing.assert_allclose(laid.heard[8], [1.0, 0.75])


@pytest.mark.parametrize("backward", [False, True])
def test_rows_stay_in_driving_order(backward):
    """A pass against the line has falling chainages, sign -1 and a growing travelled way."""
    x_m = np.arange(20.0, 180.0, 4.0)
    laid = lay_on_road(ROAD, fixes(x_m[::-1] if backward else x_m), CELLS, "one")
    assert laid.sign == (-1 if backward else 1)
    np.testing.assert_allclose(laid.chainage_m, x_m[::-1] if backward else x_m, atol=0.01)
    np.testing.assert_allclose(laid.travelled_m, x_m - x_m[0], atol=0.01)
    np.testing.assert_allclose(laid.rsrp_dbm[:, 0], -100.0 + np.arange(len(x_m)))


def test_driving_through_twice_keeps_both_visits():
    """A metre that is met again later is another row."""
    there_and_back = np.concatenate([np.arange(50.0, 100.0, 2.0), np.arange(100.0, 50.0, -2.0)])
    laid = lay_on_road(ROAD, fixes(there_and_back), CELLS, "one")
    assert len(laid.chainage_m) == len(there_and_back)
    assert laid.travelled_m[-1] == pytest.approx(98.0, abs=0.05)


def test_beyond_an_end_only_jitter_is_kept():
    """Fixes past either end count up to the slack, as readings of that end."""
    x_m = np.array([-25.0, -END_SLACK_M + 1.0, 5.0, 100.0, 196.0, 200.0 + END_SLACK_M - 1.0, 230.0])
    laid = lay_on_road(ROAD, fixes(x_m), CELLS, "one")
    np.testing.assert_allclose(laid.chainage_m, [0.0, 5.0, 100.0, 196.0, 200.0], atol=0.01)
    np.testing.assert_allclose(laid.rsrp_dbm[:, 0], [-99.0, -98.0, -97.0, -96.0, -95.0])


def test_beside_the_road_only_its_width_is_kept():
    """Fixes farther from the line than a wide street were taken elsewhere."""
    y_m = np.array([0.0, REACH_M - 1.0, REACH_M + 1.0, -REACH_M + 1.0, -REACH_M - 1.0, 0.0])
    laid = lay_on_road(ROAD, fixes(np.arange(10.0, 70.0, 10.0), y_m), CELLS, "one")
    np.testing.assert_allclose(laid.chainage_m, [10.0, 20.0, 40.0, 60.0], atol=0.01)


def test_a_pass_elsewhere_is_none():
    """Fewer than two rows on the road are no pass."""
    assert lay_on_road(ROAD, fixes(np.arange(10.0, 90.0), 500.0), CELLS, "one") is None
    assert lay_on_road(ROAD, fixes(np.full(30, 80.0)), CELLS, "one") is None
    assert lay_on_road(ROAD, fixes([10.0, 900.0, 950.0]), CELLS, "one") is None


def test_columns_are_the_cells_asked_for():
    """Columns follow the cells wanted, and a cell that the trace lacks is NaN throughout."""
    trace = fixes(np.arange(10.0, 90.0, 5.0))
    laid = lay_on_road(ROAD, trace, ("x", "b", "a"), "one")
    assert np.isnan(laid.rsrp_dbm[:, 0]).all()
    np.testing.assert_array_equal(laid.heard[:, 0], 0.0)
    np.testing.assert_allclose(laid.rsrp_dbm[:, 2], trace.rsrp_dbm[:, 0])


def test_passes_of_a_day_are_one_group():
    """The date groups passes; a trace without one is a group of its own."""
    drives = np.arange(10.0, 90.0, 5.0)
    day = datetime(2021, 5, 8, 10, tzinfo=UTC)
    dated = [
        lay_on_road(ROAD, fixes(drives, recorded_at=when), CELLS, "pass-7")
        for when in (day, day.replace(hour=15), day.replace(day=9), None)
    ]
    groups = [laid.group for laid in dated]
    assert groups == ["2021-05-08", "2021-05-08", "2021-05-09", "pass-7"]


def test_copies_are_one_measurement():
    """The same samples again are dropped, whatever the order of their cells, device and date."""
    one, other = trace_along(ROAD, seed=1), trace_along(ROAD, seed=2)
    turned = replace(
        one,
        cells=one.cells[::-1],
        rsrp_dbm=one.rsrp_dbm[:, ::-1].copy(),
        device="pixel5a",
        recorded_at=datetime(2022, 1, 1, tzinfo=UTC),
    )
    kept = distinct([turned, one, other, one])
    assert len(kept) == 2
    assert {trace.device for trace in kept} == {"pixel4a"}  # the earlier one stays


def test_nearly_the_same_is_another_measurement():
    """Another level, another place, another time or another name each make another pass."""
    one = trace_along(ROAD, seed=1)
    level = one.rsrp_dbm.copy()
    level[3, 0] = -77.0
    others = [
        replace(one, rsrp_dbm=level),
        replace(one, lat=one.lat + 1e-6),
        replace(one, time_s=one.time_s * 1.5),
        replace(one, cells=("x", *one.cells[1:])),
    ]
    assert len(distinct([one, *others])) == 5


def test_order_of_passes_moves_no_order():
    """Passes come out in an order of their own; two phones in one car are no exception."""
    one = trace_along(ROAD, seed=1)
    beside = replace(one, rsrp_dbm=one.rsrp_dbm - 3.0)
    many = [one, beside, trace_along(ROAD, seed=2), trace_along(ROAD, seed=3)]
    first = distinct(many)
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(len(many))
        assert [id(trace) for trace in distinct([many[i] for i in order])] == [
            id(trace) for trace in first
        ]


def test_all_cells_are_sorted_and_named_once():
    """The cells of several passes are their union, sorted."""
    one = trace_along(ROAD, seed=1, cells=("c", "a"))
    other = trace_along(ROAD, seed=2, cells=("b", "a"))
    assert all_cells([one, other]) == ("a", "b", "c")


def test_bends_are_followed():
    """On a bent road the chainage of a pass is the way along the bend."""
    bend = LocalFrame(11.5, 48.1).to_lonlat([0.0, 100.0, 100.0], [0.0, 0.0, 100.0])
    line = Line(bend.lon, bend.lat)
    trace = trace_along(line, seed=5, cells=CELLS, step_m=4.0)
    laid = lay_on_road(line, trace, CELLS, "one")
    np.testing.assert_allclose(laid.chainage_m[:50], np.arange(0.0, 200.0, 4.0), atol=0.05)
