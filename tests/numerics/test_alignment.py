"""A window laid along a profile: samples at columns, and between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.scenario import windows
from app.numerics import native
from app.numerics.alignment import align
from app.numerics.query import ON_COLUMN, ask, columns_behind
from app.numerics.stretches import lay
from tests.numerics.cities import city_of, index_of


def test_columns_are_whole_ones_and_a_share_of_the_way_to_the_next():
    """Not where a sample lies at one, or is taken to the nearest."""
    behind_m = np.array([3.25, 2.0, 2.0 - 0.2 * ON_COLUMN, 0.6, 0.0])
    whole, share = columns_behind(behind_m, 1.0)
    np.testing.assert_array_equal(whole, [3, 2, 2, 0, 0])
    np.testing.assert_allclose(share, [0.25, 0.0, 0.0, 0.6, 0.0])
    whole, share = columns_behind(behind_m, 1.0, nearest=True)
    np.testing.assert_array_equal(whole, [3, 2, 2, 1, 0])
    np.testing.assert_array_equal(share, 0.0)
    whole, share = columns_behind(behind_m, 0.5)
    np.testing.assert_array_equal(whole, [6, 4, 4, 1, 0])
    np.testing.assert_allclose(share, [0.5, 0.0, 0.0, 0.2, 0.0])


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("share", [0.25, 0.5])
def test_samples_between_columns_have_a_share_of_either_ones_terms(sign, share):
    """Along all of a road, its ends included; whole columns are as ever."""
    index = index_of()
    road = index.roads[0]
    window, _ = windows(city_of(), 1, length_m=20.0)[0]
    told = []
    for by_m in (0.0, share, 1.0):
        query = ask(index, window)
        behind_m = query.fine.behind_m + by_m * (query.fine.behind_m > 0.0)
        aim = replace(query, fine=replace(query.fine, behind_m=behind_m)).aim_at(index, 0)
        told.append(align(road.along, aim, 1, road.along.columns - 2, sign))
    near, between, far = told
    np.testing.assert_allclose(between, (1.0 - share) * near + share * far, rtol=1e-9, atol=1e-9)
    assert not np.allclose(near, far)


@pytest.mark.skipif(not native.BUILT, reason="no compiler")
@pytest.mark.parametrize("factor", [1.0, 0.9731, 1.0417])
def test_the_kernel_lays_them_alike(factor):
    """Every metre of every road, both ways, from one end to the other."""
    index = index_of()
    for window, _ in windows(city_of(), 3, length_m=25.0):
        asked = replace(window, distance_m=window.distance_m * factor)
        every = [
            (number, sign, 0, road.grid_size - 1)
            for number, road in enumerate(index.roads)
            for sign in (1, -1)
        ]
        plain, fast = (lay(index, ask(index, asked, in_c=in_c), every) for in_c in (False, True))
        np.testing.assert_array_equal(plain.where, fast.where)
        np.testing.assert_allclose(plain.values, fast.values, rtol=1e-6, atol=1e-5)
