"""What the roads about a place say of cells there: against plain loops, and what it may move."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from app.domain import RoadModel, Window
from app.numerics import surroundings as said
from app.numerics.carriers import NOTHING_KNOWN
from app.numerics.observation import HEARD_FLOOR
from app.numerics.query import ask
from app.numerics.stretches import whole_roads
from tests.factories import line_at
from tests.numerics.tiny import as_laid, gentle_models, map_of, on_days

STEP_M = 1.0


def roads(seed: int, *north_m: float) -> tuple[RoadModel, ...]:
    """Parallel roads of 60 m so far north; cells a to e in turn, with gaps where unmapped."""
    models = gentle_models(seed)
    rng = np.random.default_rng(seed)
    out = []
    for at, (model, north) in enumerate(zip(models, north_m, strict=True)):
        mean_dbm, heard = model.mean_dbm.copy(), rng.uniform(0.05, 0.9, model.heard.shape)
        mean_dbm[: 20 + 5 * at, 0] = np.nan
        heard[np.isnan(mean_dbm)] = 0.05
        line = line_at(north, length_m=60.0)
        heard = heard.astype(np.float32)
        out.append(replace(model, line=line, mean_dbm=mean_dbm, heard=heard))
    return tuple(out)


def plain(models: tuple[RoadModel, ...], north_m: tuple[float, ...], road: int, cell: str, at: int):
    """
    Chance, level and spread of a cell at a station, in plain loops over all others'.

    All cells are of one carrier here, and every station has listened to it.
    """
    heard = tried = close = told = 0.0
    beside = 0.0
    for model, north in zip(models, north_m, strict=True):
        for there in range(0, len(model.mean_dbm), round(said.STATION_M / model.step_m)):
            away_m = math.hypot((there - at) * STEP_M, north - north_m[road])
            if away_m >= said.FARTHEST_M:
                continue
            says = math.exp(-away_m / said.REACH_M)
            tried += says
            if cell not in model.cells:
                continue
            column = model.cells.index(cell)
            level_dbm = float(model.mean_dbm[there, column])
            if math.isnan(level_dbm):
                continue
            chance = float(model.heard[there, column])
            heard += says * chance
            near = says * chance / (1.0 + (away_m / said.CLOSE_M) ** 2)
            close += near
            told += near * level_dbm
            beside += math.exp(-away_m / said.SHARP_M)
    model = models[road]
    mapped = cell in model.cells and not np.isnan(model.mean_dbm[at, model.cells.index(cell)])
    if not mapped and heard <= said.LEAST_HEARD * tried:
        return None
    share = (heard + said.DOUBT * said.USUAL) / (tried + said.DOUBT)
    share = min(max(share, said.SURE), 1.0 - said.SURE)
    pull = said.PULL * (odds(share) - odds(said.USUAL))
    if cell in model.cells:
        alone = float(model.heard[at, model.cells.index(cell)])
    else:
        strange = [
            float(model.heard[at, k])
            for k in range(len(model.cells))
            if np.isnan(model.mean_dbm[at, k])
        ]
        alone = min(max([HEARD_FLOOR, *strange]), NOTHING_KNOWN)
    alone = min(max(alone, HEARD_FLOOR), 1.0 - HEARD_FLOOR)
    chance = 1.0 / (1.0 + math.exp(-odds(alone) - pull))
    if mapped:
        column = model.cells.index(cell)
        return chance, float(model.mean_dbm[at, column]), float(model.spread_db[at, column])
    nearest_m = max(-said.SHARP_M * math.log(beside), 0.0)
    spread_db = min(said.AT_ONCE_DB + said.FARTHER_DB_M * nearest_m, said.FAR_DB)
    return chance, told / close, spread_db


def odds(chance: float) -> float:
    return math.log(chance / (1.0 - chance))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_told_is_the_plain_loops(seed):
    """At every station of every road, each cell of the map: mapped, unmapped, heard next door."""
    north_m = (0.0, 30.0, 110.0)
    models = roads(seed, *north_m)
    laid = as_laid(models)
    told = 0
    for road, model in enumerate(laid):
        for cell in "abcde":
            column = model.cells.index(cell) if cell in model.cells else None
            for at in range(0, len(model.mean_dbm), 8):
                wanted = plain(models, north_m, road, cell, at)
                if wanted is None:
                    assert column is None or np.isnan(model.mean_dbm[at, column])
                    continue
                found = [
                    each[at, column] for each in (model.heard, model.mean_dbm, model.spread_db)
                ]
                np.testing.assert_allclose(found, wanted, rtol=2e-3)
                told += 1
    assert told > 60


def test_a_neighbour_tells_and_a_far_road_does_not():
    """A cell of the road across the corner gets a level and a spread; one far off does not."""
    models = roads(3, 0.0, 20.0, 900.0)
    laid = as_laid(models)
    assert set(laid[0].cells) == {"a", "b", "c", "d"}
    assert set(laid[2].cells) == {"a", "e"}
    spread_db = laid[0].spread_db[:, laid[0].cells.index("d")]
    assert np.nanmin(spread_db) >= said.AT_ONCE_DB
    assert np.nanmax(spread_db) < said.FAR_DB


def test_a_spread_grows_with_the_way_to_the_nearest():
    """Beside a mapped stretch a level is nearly known, farther off less and less."""
    model = roads(4, 0.0, 900.0, 1800.0)[0]
    mean_dbm = model.mean_dbm.copy()
    mean_dbm[30:, 1] = np.nan
    told = as_laid((replace(model, mean_dbm=mean_dbm),))[0]
    grown_db = told.spread_db[30:, 1]
    assert (np.diff(grown_db) >= -1e-6).all()
    assert said.AT_ONCE_DB <= grown_db[0] < grown_db[-1] < said.FAR_DB
    assert told.mean_dbm[30, 1] == pytest.approx(mean_dbm[29, 1], abs=6.0)


def test_what_is_mapped_keeps_its_level():
    """Surroundings move the chance of hearing; curves that were fitted stay as they were."""
    models = roads(5, 0.0, 25.0, 50.0)
    for before, after in zip(models, as_laid(models), strict=True):
        own = len(before.cells)
        mapped = ~np.isnan(before.mean_dbm)
        assert after.cells[:own] == before.cells
        np.testing.assert_array_equal(after.mean_dbm[:, :own][mapped], before.mean_dbm[mapped])
        np.testing.assert_array_equal(after.spread_db[:, :own][mapped], before.spread_db[mapped])
        assert ((after.heard > 0.0) & (after.heard < 1.0)).all()
        assert after.features.shape == (5, len(after.cells))
        assert after.salience.mask.shape == after.features.shape
        assert not after.salience.mask[:, own:].any()


def test_newcomers_are_not_told_of():
    """A cell that is heard next door only on days that the road was not driven on stays neutral."""
    models = on_days(roads(6, 0.0, 25.0, 50.0), "2021-04-21", "2021-04-21", "2021-05-19")
    laid = as_laid(models)
    assert "e" not in laid[0].cells
    assert "d" in laid[0].cells


def test_the_order_of_roads_moves_nothing():
    """A map of the same roads in another order tells each of them the same."""
    models = roads(7, 0.0, 25.0, 50.0)
    there = {one.road_id: one for one in as_laid(models[::-1])}
    for here in as_laid(models):
        other = there[here.road_id]
        assert sorted(other.cells) == sorted(here.cells)
        at = [other.cells.index(cell) for cell in here.cells]
        for name in ("mean_dbm", "spread_db", "heard"):
            mine, its = getattr(here, name), getattr(other, name)[:, at]
            np.testing.assert_allclose(mine, its, rtol=1e-5)


def test_a_road_told_of_itself_lies_as_in_the_map():
    """Laid out with its own model, once told, a road is the index's road; untold it is not."""
    models = roads(8, 0.0, 25.0, 50.0)
    index = map_of(models)
    again = index.road_with(1, index.around.told(1, models[1]))
    np.testing.assert_array_equal(again.along.rows, index.roads[1].along.rows)
    assert again.cells == index.roads[1].cells
    assert index.road_with(1, models[1]).cells == models[1].cells != again.cells


def test_a_street_that_lacks_a_cell_does_not_lose_for_it():
    """What hearing a cell adds to a street that never mapped it, next to one that did."""
    poor, rich, _ = gentle_models(9)
    mean_dbm = poor.mean_dbm.copy()
    mean_dbm[:, 1] = np.nan  # "b", which the street 30 m off has
    models = tuple(
        replace(one, line=line_at(north, length_m=60.0))
        for one, north in ((replace(poor, mean_dbm=mean_dbm), 0.0), (rich, 30.0))
    )
    window = Window(("b",), np.zeros(1), rich.mean_dbm[30:31, :1].astype(float))
    index = map_of(models)
    alone = map_of((models[0], replace(models[1], line=line_at(900.0, length_m=60.0))))
    for one, least, most in ((index, -2.0, 0.0), (alone, -9.0, -2.0)):
        places = whole_roads(one, ask(one, window))
        best = [places.score[places.road == road].max() for road in (0, 1)]
        assert least < best[0] - best[1] < most
