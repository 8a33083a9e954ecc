"""
Salient features: the smallest set that tells as much as all of them (Eq. 6).

Information gain never falls when a feature is added, so its maximum is always the full set;
salient therefore means the *smallest* subset whose gain comes within `TOLERANCE_BITS` of the full
set's. Among subsets of that size the one of largest gain wins, then the first in the order of the
features.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from jaxtyping import Float, Int

TOLERANCE_BITS = 0.02
EXHAUSTIVE_FEATURES = 12  # 2^12 subsets are looked at one by one, as in the paper
BRANCH_NODES = 1000  # subsets that branch and bound may weigh before the greedy search takes over


@dataclass(frozen=True, slots=True)
class Selected:
    """Chosen features (increasing column indices), their gain, that of all, and the search."""

    features: tuple[int, ...]
    gain_bits: float
    full_gain_bits: float
    search: str


class GainTable:
    """Information gain of subsets of discrete features about a label, with shared counting."""

    def __init__(
        self, codes: Int[np.ndarray, "rows features"], label: Int[np.ndarray, " rows"]
    ) -> None:
        self.codes = np.stack([_dense(column) for column in codes.T], axis=1)
        self.label = _dense(label)
        self._label_entropy = float(_entropies(self.label[:, None])[0])
        self._sizes = self.codes.max(axis=0, initial=0) + 1

    @cached_property
    def _tails(self) -> list[Int[np.ndarray, " rows"]]:
        """Joint value of each feature and all later ones; the last is that of none."""
        tails = [np.zeros(len(self.label), dtype=np.int64)]
        for column, size in zip(self.codes.T[::-1], self._sizes[::-1].tolist(), strict=True):
            tails.append(_dense(tails[-1] * size + column))
        return tails[::-1]

    @property
    def count(self) -> int:
        """Number of features."""
        return int(self.codes.shape[1])

    def joint(self, features: tuple[int, ...]) -> Int[np.ndarray, " rows"]:
        """One number for each distinct combination of the features' values."""
        key = np.zeros(len(self.label), dtype=np.int64)
        for feature in features:
            key = _dense(key * int(self._sizes[feature]) + self.codes[:, feature])
        return key

    def gain_bits(self, features: tuple[int, ...]) -> float:
        """I(label; features) = H(label) + H(features) - H(label, features), in bits."""
        return float(self._gains(self.joint(features)[:, None])[0])

    def gains_with_each(
        self, features: tuple[int, ...], first: int = 0
    ) -> Float[np.ndarray, " features"]:
        """Gain of the subset with each single feature from ``first`` on added."""
        later = self.codes[:, first:]
        return self._gains(self.joint(features)[:, None] * self._sizes[first:] + later)

    def gain_with_all_from(self, features: tuple[int, ...], first: int) -> float:
        """Gain of the subset with feature ``first`` and all later ones added, in bits."""
        tail = self._tails[first]
        return float(self._gains((self.joint(features) * (int(tail.max()) + 1) + tail)[:, None])[0])

    def _gains(self, keys: Int[np.ndarray, "rows sets"]) -> Float[np.ndarray, " sets"]:
        both = keys * (int(self.label.max()) + 1) + self.label[:, None]
        return self._label_entropy + _entropies(keys) - _entropies(both)


def select(codes: Int[np.ndarray, "rows features"], label: Int[np.ndarray, " rows"]) -> Selected:
    """
    Smallest subset of features that tells the label within `TOLERANCE_BITS` as well as all do.

    Exhaustive up to `EXHAUSTIVE_FEATURES`, branch and bound beyond (both exact), greedy where that
    weighs more than `BRANCH_NODES` subsets; ``search`` says which.

    Args:
        codes: Discretised features, one a column; -1 may stand for "not heard".
        label: What the features should tell.
    """
    table = GainTable(codes - codes.min(initial=0), label)
    full = table.gain_bits(tuple(range(table.count)))
    target = full - TOLERANCE_BITS
    if table.count <= EXHAUSTIVE_FEATURES:
        found, search = exhaustive(table, target), "exhaustive"
    else:
        exact = branch_and_bound(table, target, BRANCH_NODES)
        found = greedy(table, target) if exact is None else exact
        search = "greedy" if exact is None else "branch-and-bound"
    return Selected(found, table.gain_bits(found), full, search)


def exhaustive(table: GainTable, target_bits: float) -> tuple[int, ...]:
    """The definition: every subset, by size."""
    for size in range(table.count + 1):
        best = _best(table, combinations(range(table.count), size), target_bits)
        if best is not None:
            return best
    return tuple(range(table.count))


def branch_and_bound(table: GainTable, target_bits: float, nodes: int) -> tuple[int, ...] | None:
    """
    The same answer as `exhaustive`, skipping what cannot reach the target.

    A partial subset is dropped when even with all later features its gain stays below the target.

    Returns:
        None when more than ``nodes`` subsets would have to be weighed.
    """
    left = nodes
    for size in range(table.count + 1):
        found: list[tuple[int, ...]] = []
        stack: list[tuple[int, ...]] = [()]
        while stack:
            partial = stack.pop()
            left -= 1
            if left < 0:
                return None
            later = range(partial[-1] + 1 if partial else 0, table.count)
            if len(partial) == size:
                found.append(partial)
            elif not later:
                continue
            elif len(partial) + 1 == size:
                gains = table.gains_with_each(partial, later.start)
                enough = np.flatnonzero(gains >= target_bits) + later.start
                found += [(*partial, j) for j in enough.tolist()]
            elif table.gain_with_all_from(partial, later.start) >= target_bits:
                stack += [(*partial, j) for j in later]
        best = _best(table, iter(sorted(found)), target_bits)
        if best is not None:
            return best
    return tuple(range(table.count))


def greedy(table: GainTable, target_bits: float) -> tuple[int, ...]:
    """Add the feature of largest gain until the target is reached; not always the smallest set."""
    chosen: tuple[int, ...] = ()
    while len(chosen) < table.count and table.gain_bits(chosen) < target_bits:
        gains = table.gains_with_each(chosen)
        gains[list(chosen)] = -np.inf
        chosen = (*chosen, int(np.argmax(gains)))
    return tuple(sorted(chosen))


def _best(
    table: GainTable, subsets: Iterator[tuple[int, ...]], target_bits: float
) -> tuple[int, ...] | None:
    best, best_gain = None, target_bits - 1e-12
    for subset in subsets:
        gain = table.gain_bits(subset)
        if gain > best_gain + (1e-12 if best is not None else 0.0):
            best, best_gain = subset, gain
    return best


def _dense(values: Int[np.ndarray, " rows"]) -> Int[np.ndarray, " rows"]:
    return np.unique(values, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _entropies(keys: Int[np.ndarray, "rows sets"]) -> Float[np.ndarray, " sets"]:
    """Entropy in bits of each column's values."""
    rows, sets = keys.shape
    ordered = np.sort(keys, axis=0).T
    starts = np.ones((sets, rows), dtype=bool)
    starts[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    at = np.flatnonzero(starts)
    count = np.diff(np.append(at, sets * rows))
    share = count / rows
    return np.bincount(at // rows, -share * np.log2(share), sets)
