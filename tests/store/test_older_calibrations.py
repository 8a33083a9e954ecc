"""Calibrations as older versions of the code stored them."""

from __future__ import annotations

import pytest

from app.domain import Calibration
from app.numerics.offmap import Fit, off_map_probability
from app.store.versions import USUALLY_VARIED, _calibration

STORED = {
    "information_once": 0.45,
    "information_each": 0.1,
    "offset_sd_db": 2.0,
    "position_sd_m": 6.0,
    "segment_sd_m": 4.5,
    "off_map": [3.3, 1.4, 0.8, 0.0, -0.1, 0.01, -0.002],
    "window_count": 300,
}


def test_todays_come_back_whole():
    """Seven terms, and every number as it was."""
    found = _calibration(STORED)
    assert found == Calibration(**{**STORED, "off_map": tuple(STORED["off_map"])})


@pytest.mark.parametrize("terms", [4, 5])
def test_fewer_terms_are_kept(terms):
    """What older maps have learnt is what they answer with."""
    assert _calibration({**STORED, "off_map": STORED["off_map"][:terms]}).off_map == tuple(
        STORED["off_map"][:terms]
    )


def test_of_six_terms_the_last_is_what_it_usually_is():
    """How much levels vary along a window is asked no more: the constant holds its mean."""
    found = _calibration({**STORED, "off_map": [-1.0, 2.0, 0.5, 1.0, -0.2, 0.8]})
    assert found.off_map == (-1.0 + 0.8 * USUALLY_VARIED, 2.0, 0.5, 1.0, -0.2)
    assert 0.0 < off_map_probability(found, Fit(1.0, 0.0), 4.0) < 0.5


def test_one_temperature_for_all_and_one_position_error():
    """The oldest form: a line for the log odds, the same error for radii and boundaries."""
    old = {key: STORED[key] for key in ("information_once", "offset_sd_db", "window_count")}
    old |= {"temperature": 8.0, "off_map_intercept": 4.0, "off_map_slope": 2.0}
    found = _calibration({**old, "position_sd_m": 6.0})
    assert found.information_each == 0.125
    assert found.off_map == (4.0, 2.0, 0.0, 0.0)
    assert found.segment_sd_m == found.position_sd_m == 6.0
