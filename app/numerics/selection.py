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

from app.numerics import native, native_gains

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
    """
    Information gain of subsets of discrete features about a label, with shared counting.

    Args:
        codes: One feature a column.
        in_c: Let the kernels in C count.
    """

    def __init__(
        self,
        codes: Int[np.ndarray, "rows features"],
        label: Int[np.ndarray, " rows"],
        *,
        in_c: bool = False,
    ) -> None:
        self.codes = np.stack([_dense(column) for column in codes.T])
        self.label = _dense(label)
        self._in_c = in_c

    @cached_property
    def _tails(self) -> list[Int[np.ndarray, " rows"]]:
        """Joint value of each feature and all later ones; the last is that of none."""
        tails = [np.zeros(len(self.label), dtype=np.int64)]
        for code in self.codes[::-1]:
            tails.append(self._joined(tails[-1], code))
        return tails[::-1]

    @property
    def count(self) -> int:
        """Number of features."""
        return len(self.codes)

    def joint(self, features: tuple[int, ...]) -> Int[np.ndarray, " rows"]:
        """One number for each distinct combination of the features' values."""
        key = np.zeros(len(self.label), dtype=np.int64)
        for feature in features:
            key = self._joined(key, self.codes[feature])
        return key

    def gain_bits(self, features: tuple[int, ...]) -> float:
        """I(label; features) = H(label) + H(features) - H(label, features), in bits."""
        joint = self.joint(features)
        return float(self._gains(np.zeros_like(joint), joint[None])[0])

    def gains_with_each(
        self, features: tuple[int, ...], first: int = 0
    ) -> Float[np.ndarray, " features"]:
        """Gain of the subset with each single feature from ``first`` on added."""
        return self._gains(self.joint(features), self.codes[first:])

    def gain_with_all_from(self, features: tuple[int, ...], first: int) -> float:
        """Gain of the subset with feature ``first`` and all later ones added, in bits."""
        return float(self._gains(self.joint(features), self._tails[first][None])[0])

    def _joined(
        self, key: Int[np.ndarray, " rows"], code: Int[np.ndarray, " rows"]
    ) -> Int[np.ndarray, " rows"]:
        if self._in_c:
            return native_gains.joined(key, code)
        return _dense(key * (code.max(initial=0) + 1) + code)

    def _gains(
        self, joint: Int[np.ndarray, " rows"], codes: Int[np.ndarray, "sets rows"]
    ) -> Float[np.ndarray, " sets"]:
        """Gain of a joint value together with each code."""
        if self._in_c:
            return native_gains.gains(joint, codes, self.label)
        keys = joint * (codes.max(axis=1, initial=0)[:, None] + 1) + codes
        both = keys * (self.label.max(initial=0) + 1) + self.label
        return _entropies(self.label[None]) + _entropies(keys) - _entropies(both)


def select(codes: Int[np.ndarray, "rows features"], label: Int[np.ndarray, " rows"]) -> Selected:
    """
    Smallest subset of features that tells the label within `TOLERANCE_BITS` as well as all do.

    Exhaustive up to `EXHAUSTIVE_FEATURES`, branch and bound beyond (both exact), greedy where that
    weighs more than `BRANCH_NODES` subsets; ``search`` says which.

    Args:
        codes: Discretised features, one a column; -1 may stand for "not heard".
        label: What the features should tell.
    """
    table = GainTable(codes, label, in_c=native.BUILT)
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


def _entropies(keys: Int[np.ndarray, "sets rows"]) -> Float[np.ndarray, " sets"]:
    """Entropy in bits of each row's values."""
    sets, rows = keys.shape
    ordered = np.sort(keys, axis=1)
    starts = np.ones((sets, rows), dtype=bool)
    starts[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    at = np.flatnonzero(starts)
    count = np.diff(np.append(at, sets * rows))
    share = count / rows
    return np.bincount(at // rows, -share * np.log2(share), sets)
