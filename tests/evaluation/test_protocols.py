"""Windows of whole drives: in order, abutting or of one length, with the vehicle's own odometer."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest

from app.domain import Direction
from app.evaluation.protocols import PROTOCOLS, SPANS, singular_points_m, tour
from app.evaluation.scenario import build_city, city_drives, preset, windows

SEED = 5


@pytest.fixture(scope="module")
def city():
    return build_city(preset("paper"), SEED)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_windows_of_a_drive_come_in_order(city, protocol):
    """Each window ends after the one before, by the distance it says."""
    asked = list(tour(city_drives(city), 60, protocol=protocol, length_m=30.0, seed=SEED))
    assert len(asked) == 60
    for one, other in pairwise(asked):
        if one.drive != other.drive:
            assert other.since_m is None
        else:
            way_m = abs(other.truth.chainage_m - one.truth.chainage_m)
            assert other.since_m == pytest.approx(way_m, abs=1e-6)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_more_windows_begin_with_the_same_ones(city, protocol):
    """Asking for more shifts nothing."""
    few, many = (
        list(tour(city_drives(city), count, protocol=protocol, length_m=30.0, seed=SEED))
        for count in (12, 30)
    )
    for one, other in zip(few, many, strict=False):
        np.testing.assert_array_equal(one.window.rsrp_dbm, other.window.rsrp_dbm)
        assert one.truth == other.truth


def test_windows_anywhere_have_the_length_asked_for(city):
    """From first to last sample, with a sample a metre."""
    for each in tour(city_drives(city), 40, protocol="anywhere", length_m=30.0, seed=SEED):
        assert each.window.distance_m[-1] == pytest.approx(30.0, abs=1.0 + 1e-6)
        assert each.chainage_m[-1] == pytest.approx(each.truth.chainage_m)


def test_aligned_windows_lie_between_singular_points(city):
    """They abut: together they are the drive."""
    one = next(iter(city_drives(city)))
    edges_m = singular_points_m(one)
    spans = [
        each.window.distance_m[-1]
        for each in tour([one], 99, protocol="aligned", length_m=30.0, seed=SEED)
    ]
    assert edges_m[0] == one.travelled_m[0]
    assert edges_m[-1] == pytest.approx(one.travelled_m[-1], abs=1.0)
    np.testing.assert_allclose(spans, np.diff(edges_m), atol=1.0)
    assert np.diff(edges_m).min() > 10.0


def test_both_directions_and_all_roads_are_driven(city):
    """A tour of eight drives sees every road both ways."""
    seen = {(one.road_id, one.direction) for one in islice(city_drives(city), 8)}
    assert seen == {(truth.road_id, way) for truth in city.roads for way in Direction}


def test_an_odometer_scales_the_way_and_not_the_truth():
    """Its error is one factor a drive; positions stay true."""
    scenario = replace(preset("paper"), odometer_error_sd=0.05)
    wrong = list(islice(city_drives(build_city(scenario, SEED)), 6))
    right = list(islice(city_drives(build_city(preset("paper"), SEED)), 6))
    factors = []
    for one, other in zip(wrong, right, strict=True):
        np.testing.assert_array_equal(one.chainage_m, other.chainage_m)
        ratio = one.travelled_m[1:] / other.travelled_m[1:]
        np.testing.assert_allclose(ratio, ratio[0])
        factors.append(ratio[0])
    assert 0.005 < np.std(factors) < 0.15


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_city_gives_windows_under_both_protocols(city, protocol):
    """The short way to either kind: labelled, reproducible, the fewer are the first of the more."""
    few, many = (windows(city, count, protocol=protocol) for count in (9, 21))
    assert len(many) == 21
    for (one, truth), (other, same) in zip(few, many, strict=False):
        np.testing.assert_array_equal(one.rsrp_dbm, other.rsrp_dbm)
        assert truth == same


def test_aligned_windows_of_a_city_are_those_of_its_drives(city):
    """The short way asks what a tour asks."""
    short = windows(city, 12, protocol="aligned")
    asked = tour(city_drives(city), 12, protocol="aligned", length_m=30.0, seed=SEED)
    assert [truth for _, truth in short] == [each.truth for each in asked]


def test_every_protocol_has_its_spans(city):
    """Spans run forward within the drive; only `anywhere` looks at length and chance."""
    one = next(iter(city_drives(city)))
    assert tuple(SPANS) == PROTOCOLS
    for protocol, spans in SPANS.items():
        found = [spans(one, 30.0, 5, np.random.default_rng(seed)) for seed in (1, 2)]
        assert all(0.0 <= a < b <= one.travelled_m[-1] + 1.0 for a, b in found[0])
        assert (found[0] == found[1]) == (protocol == "aligned")


def test_a_window_without_truth_is_not_asked(city):
    """Where nobody knows where the drive was, nothing can be judged."""
    one = next(iter(city_drives(city)))
    lost = one.chainage_m.copy()
    lost[len(lost) // 2 :] = np.nan
    asked = list(
        tour([replace(one, chainage_m=lost)], 10, protocol="anywhere", length_m=30.0, seed=SEED)
    )
    assert 0 < len(asked) < 10
    assert all(np.isfinite(each.truth.chainage_m) for each in asked)
