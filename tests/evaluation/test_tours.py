"""Windows of whole drives: in order, abutting or of one length, with the vehicle's own odometer."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest

from app.domain import Direction
from app.evaluation.scenario import build_city, preset
from app.evaluation.tours import PROTOCOLS, city_drives, singular_points_m, tour

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
