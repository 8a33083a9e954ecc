"""
Evidence for calibration: windows of a road's passes, and curves that have not seen them.

Passes are held out by day, and one by one where all are of one day. A road with one pass has
windows drawn from its own curves and spread instead, which say nothing of devices and days and are
marked so; none where its readings do not err independently, as these do, for all that one road can
tell. How such a window fits its own road and the rest of the map, and what all roads say of their
readings, is asked when a version is calibrated (`app.numerics.unseen`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float16, Float32, Int

from app.numerics.evidence_table import DRAWN, HeldOut, pack
from app.numerics.independence import WINDOWS_SDS, Shared
from app.numerics.passes import RoadPass

WINDOW_LENGTHS_M = (0.0, 30.0, 60.0, 120.0, 200.0, 400.0)  # from one sample to the longest
WINDOWS_PER_ROAD = 72  # enough for a road to have its say, few enough to cost little room
WINDOW_EACH_M = 25.0  # of roads so long that this is more: one may be all of a map
MOST_FOLDS = 8
NODES_M = 3.0  # between the places where curves without a day are kept
COVERED_TO_M = 25.0  # farther from any other pass the curves say nothing that could be held out


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """
    A road's model on its grid: what a window is aligned with.

    Attributes:
        heard: See `app.domain.RoadModel`.
    """

    mean_dbm: Float[np.ndarray, "grid cells"]
    spread_db: Float[np.ndarray, "grid cells"]
    heard: Float[np.ndarray, "grid cells"]

    @property
    def usually_heard(self) -> Float[np.ndarray, "grid cells"]:
        """Probability of hearing each cell, 0 where it is not mapped."""
        return np.where(np.isnan(self.mean_dbm), 0.0, self.heard)


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """
    What a road holds out.

    Attributes:
        windows: See `app.numerics.evidence_table`.
        unseen: See `app.domain.RoadModel`.
    """

    windows: Float32[np.ndarray, "rows columns"]
    unseen: Float16[np.ndarray, "folds 3 nodes cells"]


def nodes_of(grid: int, nodes: int) -> Int[np.ndarray, " nodes"]:
    """Which grid positions curves are kept at, so many of them."""
    return np.rint(np.linspace(0.0, grid - 1.0, nodes)).astype(np.intp)


def held_out_evidence(
    passes: Sequence[RoadPass],
    cells: tuple[str, ...],
    surface: Surface,
    refit: Callable[[Sequence[RoadPass]], Surface],
    step_m: float,
    *,
    shared: Shared,
) -> Evidence:
    """
    Windows of the road's passes, and the curves that have not seen them.

    Args:
        passes: All passes of the road as they were driven, since that is what a client will send
            and what its fixes are compared with; their columns are ``cells``.
        surface: Fitted to all of them.
        refit: Fits a surface to some of them, registered among themselves alone.
        step_m: Of the grid.
        shared: By the cells of a sample: whether windows drawn reading by reading may be like those
            that are driven.
    """
    grid = len(surface.mean_dbm)
    most = max(WINDOWS_PER_ROAD, int((grid - 1) * step_m / WINDOW_EACH_M))
    apart = max(int(NODES_M / step_m), 1)
    nodes = nodes_of(grid, 1 + -(-(grid - 1) // apart))
    folds = _folds(passes)
    found: list[HeldOut] = []
    unseen: list[Float16[np.ndarray, "3 nodes cells"]] = []
    driven = len(folds) > 1
    if driven:
        for fold, held in enumerate(folds):
            others = [one for one in passes if one not in held]
            unseen.append(_at(nodes, refit(others)))
            for one, first, last in _cut(held, max(most // len(folds), 6)):
                if _covered(one.chainage_m[[first, last]], others):
                    found += _held_out(one, first, last, fold)
    elif shared.may_be_chance(WINDOWS_SDS):
        drawn = [_redrawn(one, surface, step_m, seed) for seed, one in enumerate(passes)]
        rng = np.random.default_rng(len(passes))  # a seed that none of the passes was drawn with
        for one, first, last in _cut(drawn, most):
            missed_m = one.doubt_m * float(rng.standard_normal())
            found += _held_out(one, first, last, DRAWN, missed_m)
    empty = np.zeros((0, 3, len(nodes), len(cells)), dtype=np.float16)
    windows = pack(found, None if driven else shared)
    return Evidence(windows, np.stack(unseen) if unseen else empty)


def _at(nodes: Int[np.ndarray, " nodes"], surface: Surface) -> Float16[np.ndarray, "3 nodes cells"]:
    curves = (surface.mean_dbm, surface.spread_db, surface.heard)
    return np.stack([each[nodes] for each in curves]).astype(np.float16)


def _folds(passes: Sequence[RoadPass]) -> list[list[RoadPass]]:
    days = [one.group for one in passes]
    alone = len(set(days)) == 1  # passes of one day tell little of another, but far more than none
    groups = [str(number) for number in range(len(passes))] if alone else days
    number = {group: at for at, group in enumerate(sorted(set(groups)))}
    count = min(MOST_FOLDS, len(number))
    folds: list[list[RoadPass]] = [[] for _ in range(count)]
    for one, group in zip(passes, groups, strict=True):
        folds[number[group] % count].append(one)
    return folds


def _covered(ends_m: Float[np.ndarray, " ends"], others: Sequence[RoadPass]) -> bool:
    """Whether another pass drove by all of a window: else it is off the map that it is held to."""
    low_m, high_m = float(ends_m.min()) + COVERED_TO_M, float(ends_m.max()) - COVERED_TO_M
    middle_m = 0.5 * (low_m + high_m)
    return any(
        one.chainage_m.min() <= min(low_m, middle_m)
        and one.chainage_m.max() >= max(high_m, middle_m)
        for one in others
    )


def _redrawn(one: RoadPass, surface: Surface, step_m: float, seed: int) -> RoadPass:
    """The same drive with readings drawn from the model; seeded by the pass, so repeatable."""
    rng = np.random.default_rng(seed)
    most = len(surface.mean_dbm) - 1
    at = np.clip(one.chainage_m / step_m, 0.0, most)
    low = np.minimum(at.astype(int), most - 1)
    nearest, share = np.rint(at).astype(int), (at - low)[:, None]
    mean_dbm = (1.0 - share) * surface.mean_dbm[low] + share * surface.mean_dbm[low + 1]
    mean_dbm = np.where(np.isnan(mean_dbm), surface.mean_dbm[nearest], mean_dbm)
    heard = rng.random(mean_dbm.shape) < surface.heard[nearest]
    drawn = mean_dbm + surface.spread_db[nearest] * rng.standard_normal(heard.shape)
    rsrp = np.where(heard, drawn, np.nan)
    return RoadPass(
        one.chainage_m, rsrp, (~np.isnan(rsrp)).astype(float), one.group, None, one.doubt_m
    )


def _cut(passes: Sequence[RoadPass], most: int) -> list[tuple[RoadPass, int, int]]:
    """
    Windows of every length, spread evenly over the metres of these passes.

    Returns:
        Of each window its pass, and the first and last row of it.
    """
    travelled_m = [one.travelled_m for one in passes]
    windows: list[tuple[RoadPass, int, int]] = []
    for number, length_m in enumerate(WINDOW_LENGTHS_M):
        room_m = np.array([max(along[-1] - length_m, 0.0) for along in travelled_m])
        count = most * (number + 1) // len(WINDOW_LENGTHS_M) - most * number // len(
            WINDOW_LENGTHS_M
        )
        begins = np.concatenate([[0.0], np.cumsum(room_m)])
        if begins[-1] <= 0.0:
            continue
        for at_m in (np.arange(count) + (number + 0.5) / len(WINDOW_LENGTHS_M)) / count:
            which = int(np.searchsorted(begins, at_m * begins[-1], side="right")) - 1
            which = min(which, len(passes) - 1)
            along = travelled_m[which]
            end_m = length_m + at_m * begins[-1] - begins[which]
            last = min(int(np.searchsorted(along, end_m)), len(along) - 1)
            first = int(np.searchsorted(along, along[last] - length_m))
            windows.append((passes[which], first, last))
    return windows


def _held_out(
    one: RoadPass, first: int, last: int, fold: int, missed_m: float = 0.0
) -> list[HeldOut]:
    """
    The window; nothing where it heard no cell.

    Args:
        missed_m: How far from its place it was.
    """
    rsrp = one.rsrp_dbm[first : last + 1]
    heard = np.flatnonzero(~np.isnan(rsrp).all(axis=0))
    if len(heard) == 0:
        return []
    travelled_m = one.travelled_m[first : last + 1]
    true_m = np.clip(one.chainage_m[last] + missed_m, one.chainage_m.min(), one.chainage_m.max())
    truth = (float(true_m), one.sign, fold, one.doubt_m)
    return [HeldOut(travelled_m - travelled_m[-1], rsrp[:, heard], heard, *truth)]
