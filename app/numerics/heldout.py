"""
Evidence for calibration: a road's own windows against curves that have not seen them.

Passes are held out by day; a road with one pass, or one day, has windows drawn from its own curves
and spread instead, which say nothing of devices and days and are marked so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Calibration
from app.numerics.alignment import align
from app.numerics.evidence_table import COLUMNS, POSITION_SDS_M, TEMPERATURES
from app.numerics.geodesy import Floats
from app.numerics.index import road_profile
from app.numerics.observation import OffsetPrior, Profile, offset_gain
from app.numerics.offmap import fit_per_reading
from app.numerics.passes import RoadPass
from app.numerics.query import prepare

WINDOW_LENGTHS_M = (30.0, 60.0, 120.0, 200.0)
WINDOWS_PER_ROAD = 240  # enough for a road to have its say, few enough to cost it little
WINDOWS_PER_LENGTH = (3, 12)  # of a pass, at least and at most
NEAR_TRUTH_M = 20.0  # of the same sub-segment; survey positions themselves err by metres
SMALLEST_DENSITY = 1e-6  # one window in the wrong place must not decide alone
MOST_FOLDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A road's model on its grid: what a window is aligned with."""

    mean_dbm: Float[np.ndarray, "grid cells"]
    spread_db: Float[np.ndarray, "grid cells"]
    heard: Float[np.ndarray, "grid cells"]

    def profile(self) -> Profile:
        """Ready for scoring."""
        return road_profile(self.mean_dbm, self.spread_db, self.heard)


def held_out_evidence(
    passes: Sequence[RoadPass],
    cells: tuple[str, ...],
    surface: Surface,
    refit: Callable[[Sequence[RoadPass]], Surface],
    step_m: float,
) -> Float[np.ndarray, "windows columns"]:
    """
    One row a window, columns as in `app.numerics.evidence_table.COLUMNS`.

    Args:
        passes: All passes of the road; their columns are ``cells``.
        surface: Fitted to all of them.
        refit: Fits a surface to some of them.
    """
    rows: list[list[float]] = []
    folds = _folds(passes)
    fewest, most = WINDOWS_PER_LENGTH
    count = min(max(WINDOWS_PER_ROAD // (len(passes) * len(WINDOW_LENGTHS_M)), fewest), most)
    if len(folds) > 1:
        for held in folds:
            others = [p for p in passes if p not in held]
            along = refit(others).profile()
            for one in held:
                rows += _windows(one, cells, along, step_m, count, measured=True)
    else:
        along = surface.profile()
        for number, one in enumerate(passes[:MOST_FOLDS]):
            drawn = _redrawn(one, surface, step_m, seed=number)
            rows += _windows(drawn, cells, along, step_m, count, measured=False)
    return np.array(rows, dtype=np.float32).reshape(-1, len(COLUMNS))


def _folds(passes: Sequence[RoadPass]) -> list[list[RoadPass]]:
    groups = sorted({one.group for one in passes})
    count = min(MOST_FOLDS, len(groups))
    fold = {group: index % count for index, group in enumerate(groups)}
    return [[one for one in passes if fold[one.group] == index] for index in range(count)]


def _redrawn(one: RoadPass, surface: Surface, step_m: float, seed: int) -> RoadPass:
    """The same drive with readings drawn from the model; seeded by the pass, so repeatable."""
    rng = np.random.default_rng(seed)
    at = np.clip(np.rint(one.chainage_m / step_m).astype(int), 0, len(surface.mean_dbm) - 1)
    heard = rng.random((len(at), surface.mean_dbm.shape[1])) < surface.heard[at]
    drawn = surface.mean_dbm[at] + surface.spread_db[at] * rng.standard_normal(heard.shape)
    rsrp = np.where(heard, drawn, np.nan)
    return RoadPass(one.chainage_m, rsrp, (~np.isnan(rsrp)).astype(float), one.group)


def _windows(
    one: RoadPass,
    cells: tuple[str, ...],
    along: Profile,
    step_m: float,
    count: int,
    *,
    measured: bool,
) -> list[list[float]]:
    travelled_m = one.travelled_m
    rows = []
    for length in WINDOW_LENGTHS_M:
        if travelled_m[-1] < length:
            continue
        for end_m in np.linspace(length, travelled_m[-1], count + 1)[1:]:
            last = min(int(np.searchsorted(travelled_m, end_m)), len(travelled_m) - 1)
            first = int(np.searchsorted(travelled_m, travelled_m[last] - length))
            row = _one_window(one, first, last, cells, along, step_m)
            if row is not None:
                row[COLUMNS.index("measured")] = float(measured)
                rows.append(row)
    return rows


def _one_window(
    one: RoadPass, first: int, last: int, cells: tuple[str, ...], along: Profile, step_m: float
) -> list[float] | None:
    rsrp = one.rsrp_dbm[first : last + 1]
    heard = np.flatnonzero(~np.isnan(rsrp).all(axis=0))
    if len(heard) == 0:
        return None
    names = tuple(cells[column] for column in heard)
    query = prepare(names, (), one.travelled_m[first : last + 1], rsrp[:, heard])
    aim = query.aim({cell: index for index, cell in enumerate(cells)}, step_m)
    size = along.columns - 2
    grid, prior = np.arange(size), OffsetPrior.learnt(Calibration().offset_sd_db)
    channels = [align(along, aim, 1, size, sign) for sign in (one.sign, -one.sign)]
    score = np.concatenate([c[0] + offset_gain(c[1], c[2], prior) for c in channels])
    near = np.concatenate([np.abs(grid * step_m - one.chainage_m[last]) <= NEAR_TRUTH_M, grid < 0])
    truth = int(np.argmax(np.where(near, score, -np.inf)))
    weight = float(channels[0][2, truth])
    peak = int(np.argmax(score))
    residual_there, weight_there = np.concatenate([c[1:] for c in channels], axis=1)[:, peak]
    return [
        fit_per_reading(
            float(score[peak]), float(residual_there), float(weight_there), prior, query.fine
        ),
        float(channels[0][1, truth]) / max(weight, 1e-6),
        1.0 / max(weight, 1e-6),
        0.0,
        *_log_densities(score, grid * step_m - one.chainage_m[last], step_m),
    ]


def _log_densities(
    score: Float[np.ndarray, " positions"], miss_m: Floats, step_m: float
) -> list[float]:
    """
    Log of the posterior per metre at the truth, for every one of `CHOICES`.

    Args:
        score: Of all grid positions, in the driven direction first.
        miss_m: Chainage of the grid positions less the true one.
    """
    above = score - score.max()
    posterior = np.exp(above[None, :] / np.array(TEMPERATURES)[:, None])
    posterior /= posterior.sum(axis=1, keepdims=True) * step_m
    driven = posterior[:, : len(miss_m)]
    near = np.stack([_nearness(miss_m, sd_m, step_m) for sd_m in POSITION_SDS_M], axis=1)
    return [float(x) for x in np.log(np.maximum(driven @ near, SMALLEST_DENSITY)).ravel()]


def _nearness(miss_m: Floats, sd_m: float, step_m: float) -> Floats:
    """Chance that a place missed by so much is the truth, when the truth errs by ``sd_m``."""
    if sd_m == 0.0:
        return (np.abs(miss_m) <= step_m / 2.0).astype(float)
    return np.asarray(
        np.exp(-0.5 * (miss_m / sd_m) ** 2) * (step_m / (sd_m * np.sqrt(2.0 * np.pi)))
    )
