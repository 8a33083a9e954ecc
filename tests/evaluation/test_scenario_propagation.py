"""Path loss against values worked out by hand from the Recommendation's tables."""

from __future__ import annotations

import numpy as np
import pytest

from app.evaluation.scenario.layout import Site
from app.evaluation.scenario.propagation import (
    ABOVE_ROOFTOP,
    BELOW_ROOFTOP,
    blended_loss_db,
    free_space_loss_db,
    median_loss_db,
)
from app.evaluation.scenario.sight import seen_share, sees

HIGH_RISE = np.array([[10.0, 10.0, 20.0, 20.0]])


@pytest.mark.parametrize(
    ("line", "distance_m", "frequency_ghz", "expected_db"),
    [
        # 21.2 * 2 + 29.2 + 21.1 * log10(2.6) = 42.4 + 29.2 + 8.7559
        (BELOW_ROOFTOP.los, 100.0, 2.6, 80.3559),
        # 40 * 2 + 10.2 + 23.6 * log10(2.6) = 80 + 10.2 + 9.7934
        (BELOW_ROOFTOP.nlos, 100.0, 2.6, 99.9934),
        # 22.9 * 2 + 28.6 + 19.6 * log10(3.5) = 45.8 + 28.6 + 10.6637
        (ABOVE_ROOFTOP.los, 100.0, 3.5, 85.0637),
        # 43.9 * 3 - 6.27 + 23.0 * log10(2.6) = 131.7 - 6.27 + 9.5444
        (ABOVE_ROOFTOP.nlos, 1000.0, 2.6, 134.9744),
    ],
)
def test_median_loss_is_the_tables_equation(line, distance_m, frequency_ghz, expected_db):
    """Equation (1) with the published coefficients, at four decimals."""
    loss_db = median_loss_db(np.array([distance_m]), frequency_ghz, line)
    assert loss_db[0] == pytest.approx(expected_db, abs=1e-4)


def test_free_space_loss_at_one_kilometre():
    """92.45 dB at 1 km and 1 GHz, the constant of P.525."""
    assert free_space_loss_db(np.array([1000.0]), 1.0)[0] == pytest.approx(92.448, abs=1e-3)


def test_no_path_beats_free_space():
    """Short of the regression's range the loss is that of free space."""
    near_m = np.array([1.0, 3.0, 10.0])
    loss_db = median_loss_db(near_m, 2.6, ABOVE_ROOFTOP.nlos)
    np.testing.assert_array_equal(loss_db, free_space_loss_db(near_m, 2.6))


def test_blend_runs_from_hidden_to_seen():
    """A share of 0 is the table's NLoS line, 1 its LoS line, a half lies midway."""
    away_m = np.full(3, 200.0)
    loss_db = blended_loss_db(away_m, np.array([0.0, 0.5, 1.0]), 2.6, BELOW_ROOFTOP)
    hidden_db = median_loss_db(away_m, 2.6, BELOW_ROOFTOP.nlos)[0]
    seen_db = median_loss_db(away_m, 2.6, BELOW_ROOFTOP.los)[0]
    np.testing.assert_allclose(loss_db, [hidden_db, (hidden_db + seen_db) / 2, seen_db])


@pytest.mark.parametrize(
    ("x_m", "y_m", "seen"),
    [
        (30.0, 15.0, False),  # straight behind the building
        (30.0, 0.0, True),  # the path passes below it
        (5.0, 30.0, True),  # the same side as the site
        (9.0, 15.0, True),  # before the wall
        (30.0, 29.0, False),  # through a corner
        (0.0, 0.0, True),  # along an axis
        (15.0, 15.0, False),  # inside
    ],
)
def test_a_building_hides_what_lies_behind_it(x_m, y_m, seen):
    """Line of sight from a site at (0, 15) past a square building."""
    site = Site("1:1", 0.0, 15.0, macro=False)
    assert sees(np.array([x_m]), np.array([y_m]), site, HIGH_RISE)[0] == seen


def test_a_corner_is_softened_evenly():
    """A step becomes a ramp of twice the reach about it; far from it nothing changes."""
    share = seen_share(np.arange(40) >= 20, reach=2)
    np.testing.assert_allclose(share[17:23], [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert share[:17].max() == 0.0
    assert share[23:].min() == 1.0
