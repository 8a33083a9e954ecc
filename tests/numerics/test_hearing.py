"""How probably a sample hears a cell: shares, gaps and doubt."""

from __future__ import annotations

import numpy as np
import pytest

from app.numerics import hearing
from app.numerics.carriers import NOTHING_KNOWN
from app.numerics.hearing import (
    BANDWIDTH_M,
    DOUBT_PASSES,
    MAPPED_FROM,
    for_another_pass,
    listened,
    stranger_chance,
)

CHAINAGE_M = np.repeat(np.arange(0.0, 300.0), 10)  # ten passes, a row a metre


def heard_probability(chainage_m, heard, size, step_m):
    """Of cells on a carrier that every sample hears by another cell."""
    always = np.concatenate([heard, np.ones((len(heard), 1))], axis=1)
    carrier = np.zeros(always.shape[1], dtype=np.intp)
    return hearing.heard_probability(chainage_m, always, size, step_m, carrier)[:, :-1]


def test_a_steady_share_is_found():
    """A cell heard in a known share of many samples has that probability, away from the ends."""
    rng = np.random.default_rng(61)
    share = np.array([0.1, 0.5, 0.9])
    heard = (rng.random((len(CHAINAGE_M), 3)) < share).astype(float)
    found = heard_probability(CHAINAGE_M, heard, 300, 1.0)
    np.testing.assert_allclose(found[40:260].mean(axis=0), share, atol=0.02)
    np.testing.assert_allclose(found[40:260], np.tile(share, (220, 1)), atol=0.15)


def test_probabilities_are_probabilities():
    """Always and never heard stay within 0 and 1, and doubt keeps "always" below 1."""
    heard = np.column_stack([np.ones(len(CHAINAGE_M)), np.zeros(len(CHAINAGE_M))])
    found = heard_probability(CHAINAGE_M, heard, 300, 1.0)
    assert found[:, 0].max() < 1.0
    assert found[:, 0].min() > 0.95
    np.testing.assert_array_equal(found[:, 1], 0.0)


def test_hearing_ends_where_it_ends():
    """A cell heard on the first half only falls from sure to unmapped within a few houses."""
    heard = (CHAINAGE_M < 150.0).astype(float)[:, None]
    found = heard_probability(CHAINAGE_M, heard, 300, 1.0)[:, 0]
    assert found[150] == pytest.approx(0.5, abs=0.05)
    assert np.all(np.diff(found[100:200]) <= 1e-12)
    assert found[150 - int(3 * BANDWIDTH_M)] > 0.95
    assert found[150 + int(3 * BANDWIDTH_M) + 1] < MAPPED_FROM


def test_one_pass_is_doubted_more_than_ten():
    """The same share from fewer samples is further from certain."""
    once = np.arange(0.0, 300.0)
    few = heard_probability(once, np.ones((300, 1)), 300, 1.0)
    many = heard_probability(CHAINAGE_M, np.ones((len(CHAINAGE_M), 1)), 300, 1.0)
    assert np.all(few < many)


def test_where_nobody_drove_nothing_is_mapped():
    """Far from any sample the probability is 0, whatever is heard elsewhere."""
    found = heard_probability(np.arange(0.0, 100.0), np.ones((100, 1)), 300, 1.0)
    np.testing.assert_array_equal(found[140:], 0.0)


@pytest.mark.parametrize("step_m", [0.5, 1.0, 2.0])
def test_the_grids_step_changes_little(step_m):
    """Hearing is a matter of metres: the same place has the same probability on any grid."""
    rng = np.random.default_rng(62)
    heard = (rng.random((len(CHAINAGE_M), 1)) < 0.6).astype(float)
    fine = heard_probability(CHAINAGE_M, heard, 300, 1.0)[40:260:2, 0]
    other = heard_probability(CHAINAGE_M, heard, int(300 / step_m), step_m)[:, 0]
    np.testing.assert_allclose(other[:: int(2 / step_m)][20:130], fine, atol=0.02)


def test_repeating_every_sample_moves_certainty_not_shares():
    """Twice the samples leave the share where it is, and trust it a little more."""
    rng = np.random.default_rng(63)
    heard = (rng.random((len(CHAINAGE_M), 1)) < 0.5).astype(float)
    once = heard_probability(CHAINAGE_M, heard, 300, 1.0)
    twice = heard_probability(np.tile(CHAINAGE_M, 2), np.tile(heard, (2, 1)), 300, 1.0)
    np.testing.assert_allclose(twice, once, atol=0.01)
    assert np.all(twice >= once)


def test_another_pass_is_doubted_until_passes_agree():
    """One pass moves towards the road's usual share, ten hardly, and where none drove all does."""
    share = np.array([[0.9, 0.1], [0.9, 0.1], [0.0, 0.0]])
    passes = np.array([[1.0, 1.0], [1.0, 1.0], [0.0, 0.0]])
    one, ten = (for_another_pass(share, n * passes) for n in (1.0, 10.0))
    weight = 1.0 / (1.0 + DOUBT_PASSES)
    np.testing.assert_allclose(one[0], weight * share[0] + (1.0 - weight) * 0.5)
    assert np.all(np.abs(ten[:2] - share[:2]) < 0.05)
    np.testing.assert_allclose(one[2], 0.5)


def test_cells_that_are_always_heard_stay_sure():
    """Where every sample of every pass hears every cell, one pass is as sure as ten."""
    np.testing.assert_allclose(for_another_pass(np.full((9, 3), 0.97), np.ones((9, 3))), 0.97)


def test_samples_that_listened_to_other_carriers_say_nothing():
    """A cell heard by half the samples, but by all that heard its carrier, is as good as sure."""
    rng = np.random.default_rng(64)
    on_air = rng.random(len(CHAINAGE_M)) < 0.5
    heard = np.column_stack([on_air, on_air & (rng.random(len(on_air)) < 0.5), ~on_air])
    carrier = np.array([0, 0, 1])
    found = hearing.heard_probability(CHAINAGE_M, heard.astype(float), 300, 1.0, carrier)
    np.testing.assert_allclose(found[40:260].mean(axis=0), [1.0, 0.5, 1.0], atol=0.03)


def test_a_pass_listened_where_it_heard_any_cell_of_the_carrier():
    """Within reach of a reading, all cells of its carrier were listened to, no others."""
    heard = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    grid_m, carrier = np.arange(100.0), np.array([0, 0, 1])
    found = listened(np.array([50.0, 90.0]), heard, grid_m, 20.0, carrier)
    np.testing.assert_array_equal(found[:, 0], found[:, 1])
    assert np.flatnonzero(found[:, 0]).tolist() == list(range(31, 71))
    assert not found[:, 2].any()


def test_a_cell_that_nobody_listened_for_may_well_be_there():
    """Unknown without a pass, rarer with each one that did not hear it."""
    chance = stranger_chance(np.array([[0.0], [1.0], [2.0], [6.0]]))[:, 0]
    assert chance[0] == NOTHING_KNOWN
    assert np.all(np.diff(chance) < 0.0)
    assert chance[1] == pytest.approx(0.05, abs=0.01)
