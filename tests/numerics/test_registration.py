"""Lag and level of passes: found where they are, exactly nothing where they are not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.domain import Trace
from app.evaluation.scenario import RoadTruth, build_city, preset, survey
from app.numerics.lines import length_m
from app.numerics.passes import RoadPass, all_cells, lay_on_road
from app.numerics.registration import Registration, register

SPACING_M, STRENGTH = {"paper": 2.0, "harsh": 6.0}, 3.0
LATE_S = 1.5


@cache
def driven(name: str = "paper", count: int = 3, seed: int = 31) -> tuple[RoadTruth, list[Trace]]:
    """One road's passes, of alternating directions, a day each."""
    city = build_city(replace(preset(name), survey_passes=count, cells=3), seed)
    truth = city.roads[1]
    return truth, [one for one in survey(city) if one.road_id == truth.road_id]


def late(trace: Trace, lag_s: float) -> Trace:
    """The pass with every reading stamped ``lag_s`` later than it was taken."""
    count = round(abs(lag_s) / float(trace.time_s[1] - trace.time_s[0]))
    if count == 0:
        return trace
    behind, ahead = slice(None, -count), slice(count, None)
    fixes, readings = (ahead, behind) if lag_s > 0 else (behind, ahead)
    return replace(
        trace,
        time_s=trace.time_s[fixes],
        lon=trace.lon[fixes],
        lat=trace.lat[fixes],
        rsrp_dbm=trace.rsrp_dbm[readings],
    )


def louder(trace: Trace, level_db: float) -> Trace:
    return replace(trace, rsrp_dbm=trace.rsrp_dbm + np.float32(level_db))


def laid(truth: RoadTruth, traces: list[Trace]) -> list[RoadPass]:
    cells = all_cells(traces)
    passes = [lay_on_road(truth.line, one, cells, f"pass-{i}") for i, one in enumerate(traces)]
    return [one for one in passes if one is not None]


def registered(truth: RoadTruth, traces: list[Trace], name: str = "paper") -> Registration:
    return register(laid(truth, traces), length_m(truth.line), SPACING_M[name], STRENGTH)


@pytest.mark.parametrize("lag_s", [-2.0, -LATE_S, 0.7, LATE_S])
def test_a_late_pass_is_put_back(lag_s):
    """One of three passes lags: it is found within 0.2 s, and the others stay where they are."""
    truth, (first, second, third) = driven()
    found = registered(truth, [first, late(second, lag_s), third])
    assert found.lag_s[1] == pytest.approx(lag_s, abs=0.2)
    np.testing.assert_array_equal(found.lag_s[[0, 2]], 0.0)


def test_both_directions_late_alike_are_put_back():
    """Two passes of opposite ways that lag alike lie apart, which tells the lag of both."""
    truth, passes = driven()
    found = registered(truth, [late(one, LATE_S) for one in passes[:2]])
    np.testing.assert_allclose(found.lag_s, LATE_S, atol=0.2)


def test_put_back_is_where_it_was():
    """Corrected by its lag, a late pass reads at each place what the pass in time reads there."""
    truth, (first, second, _) = driven()
    mine, other = laid(truth, [late(first, LATE_S), second])
    right = laid(truth, [first, second])[0]
    lag_s = float(late(first, LATE_S).time_s[0] - first.time_s[0])
    back = mine.corrected(lag_s, 0.0)
    where_m = np.arange(20.0, 300.0)
    for cell in range(back.rsrp_dbm.shape[1]):
        curves = [np.interp(where_m, p.chainage_m, p.rsrp_dbm[:, cell]) for p in (back, right)]
        np.testing.assert_allclose(*curves, atol=0.6)
    assert other.corrected(0.0, 0.0) is other


@pytest.mark.parametrize("name", ["paper", "harsh"])
@pytest.mark.parametrize("seed", [31, 32, 33])
def test_passes_without_lag_stay_exactly_as_they_are(name, seed):
    """Without evidence nothing moves: the corrected passes are the passes themselves."""
    truth, traces = driven(name, 4, seed)
    for count in (1, 2, 4):
        passes = laid(truth, traces[:count])
        found = register(passes, length_m(truth.line), SPACING_M[name], STRENGTH)
        for before, after in zip(passes, found.correct(passes), strict=True):
            assert after is before


@pytest.mark.parametrize("level_db", [-4.0, 6.0])
def test_a_louder_pass_is_levelled(level_db):
    """Differences of level are taken out, and the passes together stay as loud as they were."""
    truth, (first, second, third) = driven()
    traces = [first, louder(second, level_db), third]
    found = registered(truth, traces)
    others_db = found.level_db[[0, 2]].mean()
    assert found.level_db[1] - others_db == pytest.approx(level_db, abs=0.15 * abs(level_db))
    readings = [int((~np.isnan(one.rsrp_dbm)).sum()) for one in laid(truth, traces)]
    assert float(found.level_db @ readings) == pytest.approx(0.0, abs=1e-6 * sum(readings))
    np.testing.assert_array_equal(found.lag_s, 0.0)


def test_lag_and_level_come_apart():
    """A pass that is late and louder is told both."""
    truth, (first, second, third) = driven()
    found = registered(truth, [first, louder(late(second, -LATE_S), 4.0), third])
    assert found.lag_s[1] == pytest.approx(-LATE_S, abs=0.2)
    assert found.level_db[1] - found.level_db[[0, 2]].mean() == pytest.approx(4.0, abs=0.8)


def test_order_of_cells_moves_no_registration():
    """Columns in another order give the same lags and levels, to rounding."""
    truth, (first, second, third) = driven()
    traces = [first, louder(late(second, LATE_S), 3.0), third]
    passes, cells = laid(truth, traces), all_cells(traces)[::-1]
    turned = [one for t in traces if (one := lay_on_road(truth.line, t, cells, "pass-x"))]
    turned = [replace(one, group=same.group) for one, same in zip(turned, passes, strict=True)]
    found = register(passes, length_m(truth.line), 2.0, STRENGTH)
    other = register(turned, length_m(truth.line), 2.0, STRENGTH)
    np.testing.assert_allclose(found.lag_s, other.lag_s, atol=1e-6)
    np.testing.assert_allclose(found.level_db, other.level_db, atol=1e-6)


def test_readings_without_times_have_no_lag():
    """Where all times are equal nobody knows when a reading was taken; levels are still told."""
    truth, (first, second, third) = driven()
    timeless = replace(late(second, LATE_S), time_s=np.zeros(len(late(second, LATE_S).time_s)))
    found = registered(truth, [first, louder(timeless, 6.0), third])
    assert found.lag_s[1] == 0.0
    assert found.level_db[1] > 2.0


def test_a_standing_car_does_not_move():
    """While it stands, where it was a second before is where it is."""
    truth, (first, _, _) = driven()
    stood = np.concatenate([np.arange(200), np.full(200, 200), np.arange(201, 400)])
    trace = replace(
        first,
        time_s=np.arange(len(stood)) * 0.12,
        lon=first.lon[stood],
        lat=first.lat[stood],
        rsrp_dbm=first.rsrp_dbm[stood],
    )
    samples = laid(truth, [trace])[0].samples
    moved_m = samples.behind_m(1.2)
    np.testing.assert_allclose(moved_m[215:395], samples.chainage_m[200], atol=1e-9)
    np.testing.assert_allclose(moved_m[100], samples.chainage_m[90], atol=1e-9)
    assert moved_m[0] < samples.chainage_m[0]
