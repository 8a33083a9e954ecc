"""
Evidence for calibration: a road's own windows against curves that have not seen them.

Passes are held out by day; a road with one pass, or one day, has windows drawn from its own curves
and spread instead, which say nothing of devices and days and are marked so. How such a window fits
the rest of the map is asked when a version is calibrated, as that depends on the other roads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.numerics.alignment import align
from app.numerics.evidence_table import HeldOut, pack
from app.numerics.index import road_profile
from app.numerics.newcomers import Columns
from app.numerics.observation import Evidence, Profile
from app.numerics.passes import RoadPass
from app.numerics.posterior import SCORE, Places
from app.numerics.query import Aim, prepare
from app.numerics.refinement import bend_along, between
from app.numerics.tapes import BOTH

WINDOW_LENGTHS_M = (0.0, 30.0, 60.0, 120.0, 200.0, 400.0)  # from one sample to the longest
WINDOWS_PER_ROAD = 72  # enough for a road to have its say, few enough to cost little room
MOST_FOLDS = 8
COVERED_TO_M = 25.0  # farther from any other pass the curves say nothing that could be held out
FINE_M = 6.0  # places nearer the truth than this are drawn as finely as a query's peaks
NEAR_TRUTH_M = 40.0  # and nearer than this kept metre by metre
BLOCK_M = 16.0  # of those farther off, the best of a block stands for it
BLOCK_TEMPERATURE = 6.0  # typical; places of a block differ little at any
HOPELESS = 150.0  # a score this far under the best has no mass at any temperature


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

    def profile(self, cells: tuple[str, ...]) -> Profile:
        """Ready for scoring."""
        return road_profile(cells, self.mean_dbm, self.spread_db, self.heard)


def held_out_evidence(
    passes: Sequence[RoadPass],
    cells: tuple[str, ...],
    surface: Surface,
    refit: Callable[[Sequence[RoadPass]], Surface],
    step_m: float,
) -> Float[np.ndarray, "rows columns"]:
    """
    Windows of the road's passes and where on the road they fit, packed for the store.

    Args:
        passes: All passes of the road as they were driven, since that is what a client will send
            and what its fixes are compared with; their columns are ``cells``.
        surface: Fitted to all of them.
        refit: Fits a surface to some of them, registered among themselves alone.

    Returns:
        See `app.numerics.evidence_table`. Float32.
    """
    folds = _folds(passes)
    found: list[HeldOut] = []
    if len(folds) > 1:
        for held in folds:
            others = [one for one in passes if one not in held]
            along = refit(others).profile(cells)
            for one, first, last in _cut(held, max(WINDOWS_PER_ROAD // len(folds), 6)):
                if _covered(one.chainage_m[[first, last]], others):
                    found += _held_out(one, first, last, cells, (along, step_m), measured=True)
    else:
        along = surface.profile(cells)
        drawn = [_redrawn(one, surface, step_m, seed) for seed, one in enumerate(passes)]
        for one, first, last in _cut(drawn, WINDOWS_PER_ROAD):
            found += _held_out(one, first, last, cells, (along, step_m), measured=False)
    return pack(found)


def _folds(passes: Sequence[RoadPass]) -> list[list[RoadPass]]:
    groups = sorted({one.group for one in passes})
    count = min(MOST_FOLDS, len(groups))
    fold = {group: index % count for index, group in enumerate(groups)}
    return [[one for one in passes if fold[one.group] == index] for index in range(count)]


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
    return RoadPass(one.chainage_m, rsrp, (~np.isnan(rsrp)).astype(float), one.group)


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
    one: RoadPass,
    first: int,
    last: int,
    cells: tuple[str, ...],
    road: tuple[Profile, float],
    *,
    measured: bool,
) -> list[HeldOut]:
    """The window and its places; nothing where it heard no cell."""
    rsrp = one.rsrp_dbm[first : last + 1]
    heard = np.flatnonzero(~np.isnan(rsrp).all(axis=0))
    if len(heard) == 0:
        return []
    travelled_m = one.travelled_m[first : last + 1]
    along, step_m = road
    names = tuple(cells[column] for column in heard)
    query = prepare(names, (), travelled_m, rsrp[:, heard])
    aim = query.aim(Columns.plain(cells), step_m)
    values = np.zeros((SCORE + len(aim.factors), 2, along.columns - 2))
    grid_m = np.arange(along.columns - 2) * step_m
    for way, sign in enumerate(BOTH):
        values[SCORE:, way] = align(along, aim, 1, along.columns - 2, sign)
        values[0, way], values[1, way] = grid_m, step_m
    signs = np.repeat(np.array(BOTH), len(grid_m))
    where = np.stack([np.zeros_like(signs), signs])
    true_m = float(one.chainage_m[last])
    coarser = _thinned(Places(where, values.reshape(len(values), -1)), true_m)
    places = _finer(coarser, along, aim, query.fine, (true_m, step_m))
    return [
        HeldOut(
            travelled_m - travelled_m[-1],
            rsrp[:, heard],
            heard,
            true_m,
            one.sign,
            measured,
            places,
        )
    ]


def _thinned(places: Places, true_m: float) -> Places:
    """Every metre near the truth; farther off, the best place of a block with the block's mass."""
    away_m = np.abs(places.chainage_m - true_m)
    close = away_m <= NEAR_TRUTH_M
    block = np.where(close, 0, 1 + (places.chainage_m / BLOCK_M).astype(int)) * places.sign
    starts = np.flatnonzero(np.concatenate([[True], (block[1:] != block[:-1]) | close[1:]]))
    values = places.values[:, starts].copy()
    ends = np.append(starts[1:], len(places))
    for column, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        best = start + int(np.argmax(places.score[start:end]))
        share = np.exp((places.score[start:end] - places.score[best]) / BLOCK_TEMPERATURE)
        values[:, column] = places.values[:, best]
        values[1, column] = float(share @ places.width_m[start:end])
    kept = values[2] >= values[2].max() - HOPELESS
    return Places(places.where[:, starts], values).take(kept)


def _finer(
    places: Places, along: Profile, aim: Aim, seen: Evidence, metres: tuple[float, float]
) -> Places:
    """The same with the neighbourhood of the truth drawn finer, in both directions."""
    true_m, step_m = metres
    close = np.abs(places.chainage_m - true_m) <= FINE_M
    parts = [places.take(~close)]
    for sign in BOTH:
        row = places.take(close & (places.sign == sign) & (places.chainage_m % step_m < 1e-9))
        if len(row) > 1 and np.allclose(np.diff(row.chainage_m), step_m):
            row = between(row, bend_along(along, aim, seen, row, step_m), 0.0, step_m)
        parts.append(row)
    return Places.join([part for part in parts if len(part)])
