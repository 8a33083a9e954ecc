"""Salient features: exact searches against the definition, gains against scipy's entropies."""

from __future__ import annotations

from itertools import chain, combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import entropy

from app.numerics import native
from app.numerics.selection import (
    EXHAUSTIVE_FEATURES,
    TOLERANCE_BITS,
    GainTable,
    branch_and_bound,
    exhaustive,
    greedy,
    select,
)


def subsets(count: int):
    return chain.from_iterable(combinations(range(count), size) for size in range(count + 1))


def entropy_bits(*columns: np.ndarray) -> float:
    """Entropy of the columns together, by scipy."""
    _, counts = np.unique(np.stack(columns, axis=1), axis=0, return_counts=True)
    return float(entropy(counts, base=2))


def conditional_entropy_bits(label: np.ndarray, given_: np.ndarray) -> float:
    """H(label | features) as the mean entropy of the label within each value of the features."""
    values, inverse = np.unique(given_, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    parts = [label[inverse == value] for value in range(len(values))]
    return sum(len(part) / len(label) * entropy_bits(part) for part in parts)


@st.composite
def tables(draw, most_features=7):
    """Codes with many equal, constant and repeated columns, so that ties are common."""
    features = draw(st.integers(1, most_features))
    rows = draw(st.integers(2, 24))
    seed = draw(st.integers(0, 100_000))
    rng = np.random.default_rng(seed)
    codes = rng.integers(-1, draw(st.integers(1, 3)), (rows, features))
    if features > 2:
        codes[:, draw(st.integers(0, features - 1))] = codes[:, 0]
    return codes, rng.integers(0, draw(st.integers(1, 6)), rows)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(table=tables(most_features=6))
def test_gain_is_what_the_features_take_from_the_entropy(table):
    """Eq. (6): gain is H(label) - H(label | features), and H(label) + H(f) - H(label, f)."""
    codes, label = table
    gains = GainTable(codes - codes.min(), label)
    for subset in subsets(codes.shape[1]):
        if not subset:
            assert gains.gain_bits(()) == pytest.approx(0.0, abs=1e-12)
            continue
        chosen = codes[:, list(subset)]
        by_condition = entropy_bits(label) - conditional_entropy_bits(label, chosen)
        by_joint = entropy_bits(label) + entropy_bits(*chosen.T) - entropy_bits(label, *chosen.T)
        assert gains.gain_bits(subset) == pytest.approx(by_condition, abs=1e-9)
        assert gains.gain_bits(subset) == pytest.approx(by_joint, abs=1e-9)


@pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
@settings(deadline=None, max_examples=60)
@given(table=tables(), seed=st.integers(0, 1000))
def test_the_kernels_count_the_same(table, seed):
    """Gains counted in C are those of the definition, for any subset and what is added to it."""
    plain, in_c = GainTable(*table), GainTable(*table, in_c=True)
    rng = np.random.default_rng(seed)
    subset = tuple(np.flatnonzero(rng.random(plain.count) < 0.4).tolist())
    first = int(rng.integers(plain.count))
    assert in_c.gain_bits(subset) == pytest.approx(plain.gain_bits(subset), abs=1e-12)
    np.testing.assert_allclose(
        in_c.gains_with_each(subset, first), plain.gains_with_each(subset, first), atol=1e-12
    )
    assert in_c.gain_with_all_from(subset, first) == pytest.approx(
        plain.gain_with_all_from(subset, first), abs=1e-12
    )
    values = np.unique(np.stack([plain.joint(subset), in_c.joint(subset)]), axis=1)
    assert values.shape[1] == len(set(plain.joint(subset).tolist()))


@settings(derandomize=True, deadline=None, max_examples=25)
@given(table=tables(most_features=6))
def test_gain_never_falls_when_a_feature_is_added(table):
    """Gain grows from 0 to that of all features, never beyond the label's entropy."""
    codes, label = table
    gains = GainTable(codes - codes.min(), label)
    for subset in subsets(codes.shape[1]):
        bits = gains.gain_bits(subset)
        assert -1e-9 <= bits <= entropy_bits(label) + 1e-9
        for feature in set(range(codes.shape[1])) - set(subset):
            assert gains.gain_bits(tuple(sorted((*subset, feature)))) >= bits - 1e-9


@settings(derandomize=True, deadline=None, max_examples=60)
@given(table=tables())
def test_gains_with_each_are_gains(table):
    """The gains of adding each feature are those of the larger subsets."""
    codes, label = table
    gains = GainTable(codes - codes.min(), label)
    together = gains.gains_with_each((0,))
    alone = [gains.gain_bits((0, feature)) for feature in range(gains.count)]
    np.testing.assert_allclose(together, alone, atol=1e-12)


@settings(derandomize=True, deadline=None, max_examples=80)
@given(table=tables())
def test_exhaustive_is_the_definition(table):
    """Of all 2^n subsets, the smallest that reach the target; of them the best, then the first."""
    codes, label = table
    gains = GainTable(codes - codes.min(), label)
    target = gains.gain_bits(tuple(range(gains.count))) - TOLERANCE_BITS
    reaching = [subset for subset in subsets(gains.count) if gains.gain_bits(subset) >= target]
    smallest = [s for s in reaching if len(s) == min(map(len, reaching))]
    largest = max(gains.gain_bits(subset) for subset in smallest)
    first = next(s for s in smallest if gains.gain_bits(s) >= largest - 1e-12)
    assert exhaustive(gains, target) == first


@settings(derandomize=True, deadline=None, max_examples=80)
@given(table=tables(most_features=8), share=st.sampled_from([0.3, 0.7, 0.95, 1.0]))
def test_branch_and_bound_is_exhaustive(table, share):
    """The skipping search returns the very subset of the definition, ties included."""
    codes, label = table
    gains = GainTable(codes - codes.min(), label)
    full = gains.gain_bits(tuple(range(gains.count)))
    for target in (share * full, full - TOLERANCE_BITS):
        assert branch_and_bound(gains, target, 10**6) == exhaustive(gains, target)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(table=tables(most_features=8))
def test_greedy_reaches_the_target_and_is_never_smaller(table):
    """The greedy set reaches the target with no fewer features than the smallest that does."""
    codes, label = table
    gains = GainTable(codes - codes.min(), label)
    target = gains.gain_bits(tuple(range(gains.count))) - TOLERANCE_BITS
    found = greedy(gains, target)
    assert found == tuple(sorted(set(found)))
    assert gains.gain_bits(found) >= target
    assert len(found) >= len(exhaustive(gains, target))


def test_greedy_may_be_larger_than_the_smallest():
    """A feature that is best alone can be useless: greedy takes it, the exact search does not."""
    label = np.tile(np.arange(4), 12)
    best_alone = label.copy()
    best_alone[:4] ^= 1  # once in twelve it takes a place for its neighbour of either kind
    best_alone[4:8] ^= 2
    gains = GainTable(np.stack([best_alone, label // 2, label % 2], axis=1), label)
    assert greedy(gains, 1.99) == (0, 1, 2)
    assert exhaustive(gains, 1.99) == (1, 2)


def test_select_says_how_it_searched():
    """Few features are searched exhaustively, more by branch and bound, the hopeless greedily."""
    rng = np.random.default_rng(20)
    label = rng.integers(0, 5, 60)
    few = select(rng.integers(0, 3, (60, EXHAUSTIVE_FEATURES)), label)
    telling = rng.integers(0, 2, (60, 40))
    telling[:, 17] = label
    many = select(telling, label)
    hopeless = select((rng.random((60, 60)) < 0.04).astype(int), label)
    assert few.search == "exhaustive"
    assert (many.search, many.features) == ("branch-and-bound", (17,))
    assert hopeless.search == "greedy"
    for found in (few, many, hopeless):
        assert found.gain_bits >= found.full_gain_bits - TOLERANCE_BITS
        assert found.full_gain_bits <= entropy_bits(label) + 1e-9


def test_both_exact_searches_agree_where_they_meet():
    """At 12 features select is exhaustive, and branch and bound returns the same set."""
    rng = np.random.default_rng(24)
    codes, label = rng.integers(-1, 3, (40, EXHAUSTIVE_FEATURES)), rng.integers(0, 4, 40)
    found = select(codes, label)
    target = found.full_gain_bits - TOLERANCE_BITS
    assert branch_and_bound(GainTable(codes + 1, label), target, 10**6) == found.features


def test_names_of_values_do_not_matter():
    """Codes renamed one to one select the same features with the same gain."""
    rng = np.random.default_rng(21)
    codes, label = rng.integers(0, 4, (50, 8)), rng.integers(0, 5, 50)
    renamed = np.array([7, -1, 900, 33])[codes]
    assert select(renamed, label) == select(codes, label)


def test_repeating_every_row_moves_nothing():
    """Every row twice has the same entropies, so the same features and gain."""
    rng = np.random.default_rng(22)
    codes, label = rng.integers(0, 4, (50, 8)), rng.integers(0, 5, 50)
    once, twice = select(codes, label), select(np.tile(codes, (2, 1)), np.tile(label, 2))
    assert twice.features == once.features
    assert twice.gain_bits == pytest.approx(once.gain_bits, abs=1e-12)


def test_one_label_needs_no_feature():
    """Where there is nothing to tell, the empty set tells it."""
    found = select(np.arange(20)[:, None] % 4, np.zeros(20, dtype=int))
    assert found.features == ()
    assert found.gain_bits == pytest.approx(0.0, abs=1e-12)


def test_branch_and_bound_gives_up_as_agreed():
    """Beyond its number of subsets it returns None rather than an answer that is not exact."""
    rng = np.random.default_rng(23)
    gains = GainTable((rng.random((60, 60)) < 0.04).astype(int), rng.integers(0, 5, 60))
    target = gains.gain_bits(tuple(range(60))) - TOLERANCE_BITS
    assert branch_and_bound(gains, target, 100) is None
