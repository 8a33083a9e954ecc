"""
Held-out windows on their own road, as its curves without their day have it.

The road lies among the others as in the map: what it has not mapped without that day, its
surroundings tell. Windows that were drawn from a road's own model are asked of just that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from app.domain import RoadModel
from app.numerics.alignment import align
from app.numerics.evidence_table import HeldOut, shared_of, unpack
from app.numerics.heldout import nodes_of
from app.numerics.independence import WINDOWS_SDS, pooled
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.observation import Evidence, Profile
from app.numerics.posterior import CHAINAGE, SCORE, WIDTH, Places
from app.numerics.query import Aim, Query, prepare
from app.numerics.refinement import bend_along, between
from app.numerics.tapes import BOTH

MOST_WINDOWS = 1500  # a city's are thinned to so many: calibration must not grow with the map
FINE_M = 6.0  # places nearer the truth than this are drawn as finely as a query's peaks
NEAR_TRUTH_M = 40.0  # and nearer than this kept metre by metre
BLOCK_M = 16.0  # of those farther off, the best of a block stands for it
BLOCK_TEMPERATURES = np.geomspace(0.125, 32.0, 9)  # at which it stands for so much road
HOPELESS = 150.0  # a score this far under the best has no mass at any temperature


Widths = Float[np.ndarray, "temperatures places"]


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """
    A held-out window, and where on its own road it fits.

    Attributes:
        road: Number of the road.
        places: Scores do not hold offsets yet; values have a residual and a weight of each group.
            Far from the truth the best place of a block stands for all of it.
        own: That road, as its curves without the window's day have it; None = as the map has it.
        width_m: Length of road that each place stands for at each of `BLOCK_TEMPERATURES`, so that
            the block has its mass; None = as the places have it, at any.
    """

    road: int
    truth: HeldOut
    places: Places
    own: RoadIndex | None = None
    width_m: Widths | None = None

    def at(self, temperature: float) -> Places:
        """The places of a window of this temperature."""
        if self.width_m is None:
            return self.places
        values = self.places.values.copy()
        values[WIDTH] = _between_temperatures(self.width_m, temperature)
        return Places(self.places.where, values)


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
        places, width_m = _places(laid[1], query, truth)
        found.append(Asked(number, truth, places, own, width_m))
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


def _places(road: RoadIndex, query: Query, truth: HeldOut) -> tuple[Places, Widths]:
    along, step_m = road.along, road.step_m
    aim = query.aim(road.column, step_m)
    values = np.zeros((SCORE + len(aim.factors), 2, road.grid_size))
    grid_m = np.arange(road.grid_size) * step_m
    for way, sign in enumerate(BOTH):
        values[SCORE:, way] = align(along, aim, 1, along.columns - 2, sign)
        values[CHAINAGE, way], values[WIDTH, way] = grid_m, step_m
    signs = np.repeat(np.array(BOTH), len(grid_m))
    where = np.stack([np.full_like(signs, road.number), signs])
    every = Places(where, values.reshape(len(values), -1))
    coarser, width_m = _thinned(every, truth.chainage_m)
    close = np.abs(coarser.chainage_m - truth.chainage_m) <= FINE_M
    finer = _finer(coarser.take(close), along, aim, query.fine, step_m)
    finer_m = np.tile(finer.width_m, (len(width_m), 1))
    far = Places.join([coarser.take(~close), finer]) if len(finer) else coarser.take(~close)
    return far, np.concatenate((width_m[:, ~close], finer_m), axis=1)


def _thinned(places: Places, true_m: float) -> tuple[Places, Widths]:
    """
    Every metre near the truth; farther off, the best place of a block, and at each of
    `BLOCK_TEMPERATURES` as much road as gives it the block's mass.
    """
    away_m = np.abs(places.chainage_m - true_m)
    close = away_m <= NEAR_TRUTH_M
    block = np.where(close, 0, 1 + (places.chainage_m / BLOCK_M).astype(int)) * places.sign
    starts = np.flatnonzero(np.concatenate([[True], (block[1:] != block[:-1]) | close[1:]]))
    highest = np.maximum.reduceat(places.score, starts)
    of_block = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(places))))
    below = places.score - highest[of_block]
    best = np.flatnonzero(below == 0.0)
    best = best[np.unique(of_block[best], return_index=True)[1]]
    mass = np.exp(below / BLOCK_TEMPERATURES[:, None]) * places.width_m
    width_m = np.add.reduceat(mass, starts, axis=1)
    kept = highest >= highest.max() - HOPELESS
    return places.take(best[kept]), width_m[:, kept]


def _between_temperatures(width_m: Widths, temperature: float) -> Float[np.ndarray, " places"]:
    """Straight in the logarithm of either, and as the outermost beyond them."""
    known = np.log(BLOCK_TEMPERATURES)
    at = float(np.interp(math.log(temperature), known, np.arange(len(known))))
    low = min(int(at), len(known) - 2)
    share = at - low
    return np.asarray(width_m[low] ** (1.0 - share) * width_m[low + 1] ** share)


def _finer(close: Places, along: Profile, aim: Aim, seen: Evidence, step_m: float) -> Places:
    """Places near the truth drawn finer, in both directions."""
    parts = []
    for sign in BOTH:
        row = close.take((close.sign == sign) & (close.chainage_m % step_m < 1e-9))
        if len(row) > 1 and np.allclose(np.diff(row.chainage_m), step_m):
            row = between(row, bend_along(along, aim, seen, row, step_m), 0.0, step_m)
        parts.append(row)
    return Places.join(parts)
