"""
Held-out windows on their own road, as its curves without their day have it.

The road lies among the others as in the map: what it has not mapped without that day, its
surroundings tell. Windows that were drawn from a road's own model are asked of just that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.domain import RoadModel
from app.numerics.alignment import align
from app.numerics.evidence_table import HeldOut, shared_of, unpack
from app.numerics.heldout import nodes_of
from app.numerics.independence import WINDOWS_SDS, pooled
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.observation import Evidence, Profile
from app.numerics.posterior import SCORE, Places
from app.numerics.query import Aim, Query, prepare
from app.numerics.refinement import bend_along, between
from app.numerics.tapes import BOTH

MOST_WINDOWS = 1500  # a city's are thinned to so many: calibration must not grow with the map
FINE_M = 6.0  # places nearer the truth than this are drawn as finely as a query's peaks
NEAR_TRUTH_M = 40.0  # and nearer than this kept metre by metre
BLOCK_M = 16.0  # of those farther off, the best of a block stands for it
BLOCK_TEMPERATURE = 6.0  # typical; places of a block differ little at any
HOPELESS = 150.0  # a score this far under the best has no mass at any temperature


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """
    A held-out window, and where on its own road it fits.

    Attributes:
        road: Number of the road.
        places: Scores do not hold offsets yet; values have a residual and a weight of each group.
        own: That road, as its curves without the window's day have it; None = as the map has it.
    """

    road: int
    truth: HeldOut
    places: Places
    own: RoadIndex | None = None


def held_out_windows(models: Sequence[RoadModel]) -> list[tuple[int, HeldOut]]:
    """
    Number of the road and window, at most `MOST_WINDOWS`, evenly from all roads.

    Drawn windows count where the readings of all roads with one pass may err as drawn ones do: the
    few roads of another map that seem to are chance.
    """
    told = [shared_of(model.evidence) for model in models]
    drawn = pooled([one for one in told if one is not None]).may_be_chance(WINDOWS_SDS)
    every = [
        (number, one)
        for number, model in enumerate(models)
        for one in unpack(model.evidence)
        if one.measured or drawn
    ]
    step = max(1.0, len(every) / MOST_WINDOWS)
    return [every[int(i * step)] for i in range(min(len(every), MOST_WINDOWS))]


def ask_at_home(
    index: MapIndex, models: Sequence[RoadModel], windows: Sequence[tuple[int, HeldOut]]
) -> list[Asked]:
    """
    Every window on its own road.

    Args:
        models: Of all roads, as they are stored.
        windows: Each with the number of its road; those of a road follow each other.
    """
    found, laid = [], None
    for number, truth in windows:
        if laid is None or laid[0] != (number, truth.fold):
            model = models[number]
            if truth.measured:
                model = index.around.told(number, without(model, truth.fold))
            laid = ((number, truth.fold), index.road_with(number, model))
        names = tuple(models[number].cells[column] for column in truth.cells.tolist())
        query = prepare(index, names, (), truth.distance_m, truth.rsrp_dbm)
        own = laid[1] if truth.measured else None
        found.append(Asked(number, truth, _places(laid[1], query, truth), own))
    return found


def without(model: RoadModel, fold: int) -> RoadModel:
    """
    The model as its passes but those of a fold have it: straight between the nodes kept of it, and
    as the nearer one where either is not mapped.
    """
    curves = model.unseen[fold].astype(np.float32)
    grid = np.arange(len(model.mean_dbm))
    nodes = nodes_of(len(grid), curves.shape[1])
    high = np.clip(np.searchsorted(nodes, grid), 1, len(nodes) - 1)
    low = high - 1
    share = ((grid - nodes[low]) / (nodes[high] - nodes[low])).astype(np.float32)[:, None]
    nearest = np.where(share[:, 0] < 0.5, low, high)
    straight = curves[:, low] + share * (curves[:, high] - curves[:, low])
    mapped = ~np.isnan(curves[0])
    same = (mapped[low] & mapped[high]) | ~(mapped[low] | mapped[high])
    mean_dbm, spread_db, heard = np.where(same, straight, curves[:, nearest])
    return replace(model, mean_dbm=mean_dbm, spread_db=spread_db, heard=heard)


def _places(road: RoadIndex, query: Query, truth: HeldOut) -> Places:
    along, step_m = road.along, road.step_m
    aim = query.aim(road.column, step_m)
    values = np.zeros((SCORE + len(aim.factors), 2, road.grid_size))
    grid_m = np.arange(road.grid_size) * step_m
    for way, sign in enumerate(BOTH):
        values[SCORE:, way] = align(along, aim, 1, along.columns - 2, sign)
        values[0, way], values[1, way] = grid_m, step_m
    signs = np.repeat(np.array(BOTH), len(grid_m))
    where = np.stack([np.full_like(signs, road.number), signs])
    coarser = _thinned(Places(where, values.reshape(len(values), -1)), truth.chainage_m)
    return _finer(coarser, along, aim, query.fine, (truth.chainage_m, step_m))


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
