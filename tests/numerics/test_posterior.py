"""From scores to probabilities, shortlists and radii."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from app.numerics.posterior import CHAINAGE, SCORE, WIDTH, Places, kept_by_mass, masses, radius_m


def places(score, width_m=1.0) -> Places:
    score = np.asarray(score, dtype=float)
    values = np.zeros((5, len(score)))
    values[CHAINAGE], values[WIDTH], values[SCORE] = np.arange(len(score)), width_m, score
    return Places(np.tile([[0], [1]], (1, len(score))), values)


scores = st.lists(st.floats(-200.0, 200.0), min_size=1, max_size=60)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(score=scores, temperature=st.floats(0.05, 20.0), shift=st.floats(-500.0, 500.0))
def test_posteriors_sum_to_one_and_forget_the_level(score, temperature, shift):
    """Masses sum to 1, and adding a constant to every score changes none."""
    found = masses(places(score), temperature)
    assert found.sum() == pytest.approx(1.0, abs=1e-12)
    moved = masses(places(np.array(score) + shift), temperature)
    np.testing.assert_allclose(moved, found, atol=1e-9)


def test_every_metre_is_as_likely_beforehand():
    """A place that stands for twice the road has twice the mass; equal scores are even."""
    np.testing.assert_allclose(masses(places([3.0] * 4), 1.0), 0.25)
    np.testing.assert_allclose(
        masses(places([3.0, 3.0], np.array([2.0, 1.0])), 5.0), [2 / 3, 1 / 3]
    )


@settings(derandomize=True, deadline=None, max_examples=60)
@given(score=st.lists(st.floats(-30.0, 30.0), min_size=2, max_size=30, unique=True))
def test_temperature_flattens(score):
    """The hotter, the less the best place has, down to its even share."""
    best = int(np.argmax(score))
    found = [masses(places(score), t)[best] for t in (0.1, 0.5, 1.0, 3.0, 10.0, 1e6)]
    assert all(a >= b - 1e-12 for a, b in pairwise(found))
    assert found[-1] == pytest.approx(1.0 / len(score), rel=1e-3)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(score=scores, temperature=st.floats(0.1, 10.0), left_out=st.sampled_from([1e-4, 0.01, 0.3]))
def test_the_shortlist_holds_what_it_should(score, temperature, left_out):
    """Places kept hold all but the share left out, and no smaller number of places would."""
    score = np.array(score)
    kept = kept_by_mass(score, temperature, left_out, 1000)
    mass = np.exp((score - score.max()) / temperature)
    mass /= mass.sum()
    assert kept.tolist() == sorted(set(kept.tolist()))
    assert mass[kept].sum() >= 1.0 - left_out - 1e-9
    fewest = int(np.searchsorted(np.cumsum(np.sort(mass)[::-1]), 1.0 - left_out - 1e-12)) + 1
    assert len(kept) <= fewest + 1
    assert mass[kept].min() >= np.delete(mass, kept).max(initial=0.0) - 1e-15


def test_a_shortlist_is_never_longer_than_allowed():
    """Of many alike, only as many as allowed are kept."""
    assert len(kept_by_mass(np.zeros(5000), 1.0, 1e-4, 1000)) == 1000


@settings(derandomize=True, deadline=None, max_examples=60)
@given(seed=st.integers(0, 10_000), sd_m=st.sampled_from([0.0, 1.0, 5.0]))
def test_radius_grows_with_confidence(seed, sd_m):
    """More confidence never has a smaller radius."""
    rng = np.random.default_rng(seed)
    away_m, mass = rng.exponential(10.0, 40), rng.dirichlet(np.full(40, 0.3))
    radii = [
        radius_m(away_m, mass, np.ones(40), c, sd_m) for c in (0.1, 0.5, 0.68, 0.9, 0.95, 0.99)
    ]
    assert all(a <= b + 1e-9 for a, b in pairwise(radii))
    assert radii[0] >= 0.0


@pytest.mark.parametrize("confidence", [0.5, 0.68, 0.95])
@pytest.mark.parametrize("sd_m", [1.0, 4.0])
def test_radius_of_one_place_is_the_normal_quantile(confidence, sd_m):
    """With all mass at the position the radius is that of the surveyed positions' error."""
    found = radius_m(np.zeros(1), np.ones(1), np.full(1, 0.2), confidence, sd_m)
    sd = np.hypot(sd_m, 0.2 / np.sqrt(12.0))
    assert found == pytest.approx(sd * norm.ppf((1.0 + confidence) / 2.0), rel=0.03)


@pytest.mark.parametrize("confidence", [0.5, 0.68, 0.95])
def test_radius_holds_its_share_of_draws(confidence):
    """Of truths drawn from the posterior, the radius contains the share that it says."""
    rng = np.random.default_rng(91)
    away_m = np.abs(np.arange(-40.0, 41.0))
    mass = np.exp(-0.5 * (away_m / 8.0) ** 2)
    mass /= mass.sum()
    found = radius_m(away_m, mass, np.ones(81), confidence, 3.0)
    drawn = rng.choice(np.arange(-40.0, 41.0), 20_000, p=mass) + rng.normal(0.0, 3.0, 20_000)
    drawn += rng.uniform(-0.5, 0.5, 20_000)
    assert np.mean(np.abs(drawn) <= found) == pytest.approx(confidence, abs=0.02)


def test_radius_reaches_the_other_road():
    """Where a place far off holds more than the confidence leaves, the radius spans to it."""
    away_m, mass = np.array([0.0, 150.0]), np.array([0.6, 0.4])
    assert radius_m(away_m, mass, np.ones(2), 0.5, 1.0) < 5.0
    assert radius_m(away_m, mass, np.ones(2), 0.95, 1.0) == pytest.approx(150.0, abs=5.0)


def test_slices_join_to_the_whole():
    """Cut anywhere and joined again, places are the same."""
    whole = places(np.random.default_rng(92).normal(size=12))
    joined = Places.join([whole.slice(0, 5), whole.slice(5, 5), whole.slice(5, 12)])
    np.testing.assert_array_equal(joined.values, whole.values)
    np.testing.assert_array_equal(joined.where, whole.where)
