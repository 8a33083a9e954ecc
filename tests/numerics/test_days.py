"""What the days of a map's surveys say of cells that came on the air, and of cells that went."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, RoadModel, Window
from app.numerics import coarse, native
from app.numerics.contributions import Place, contributions
from app.numerics.corners import every_corner, way_of
from app.numerics.days import Days
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.newcomers import Newcomers
from app.numerics.posterior import Places
from app.numerics.query import ask
from app.numerics.stretches import whole_roads
from app.numerics.ways import places_along
from tests.numerics import plain
from tests.numerics.cities import models_of
from tests.numerics.test_corners import corners_of
from tests.numerics.tiny import as_laid, gentle_models, map_of, on_days, tiny_models, window_along

DAYS = ("2021-05-08", "2021-05-17", "2021-05-19")
SHARED = ("2021-05-08",) * 3


def newcomers_of(models) -> list[set[str]]:
    """To each road."""
    found = Newcomers.of(Days.of(models))
    return [
        {cell for cell, at in found.number.items() if found.to[at, road]}
        for road in range(len(models))
    ]


def scores(index: MapIndex, window: Window, road: int) -> np.ndarray:
    places: Places = whole_roads(index, ask(index, window))
    return places.score[places.road == road]


def test_a_cell_heard_only_on_days_without_the_road_is_a_newcomer_to_it():
    """Roads 0 to 2 know a, b, c and b, c, d and a, e; what a road knows itself is no newcomer."""
    models = tiny_models(900)
    assert newcomers_of(on_days(models, *DAYS)) == [{"d", "e"}, {"a", "e"}, {"b", "c", "d"}]
    assert newcomers_of(on_days(models, *SHARED)) == [set(), set(), set()]
    assert newcomers_of(on_days(models, DAYS[0], DAYS[1], DAYS[1])) == [{"d", "e"}, set(), set()]


def test_what_has_no_date_may_be_of_any_day():
    """A cell or a road without a day, and a model that does not know its days, has no newcomers."""
    models = tiny_models(900)
    assert newcomers_of(on_days(models, DAYS[0], DAYS[1], "")) == [{"d"}, set(), set()]
    assert newcomers_of((*on_days(models[:2], *DAYS[:2]), models[2])) == [{"d"}, set(), set()]
    assert newcomers_of(models) == [set(), set(), set()]


def test_other_carriers_days_make_no_newcomers():
    """A road that never heard a carrier knows nothing of its cells, as ever."""
    models = list(tiny_models(900))
    models[1] = replace(models[1], cells=("850:1", "850:2", "850:3"))
    assert newcomers_of(on_days(tuple(models), *DAYS))[0] == {"e"}


def test_a_newcomer_says_nothing_of_the_road():
    """With or without readings of it every place of the road scores alike; others do not."""
    index = map_of(on_days(gentle_models(910), *DAYS))
    window = window_along(gentle_models(910)[0], 3, extra=("e",))
    silent = replace(window, rsrp_dbm=window.rsrp_dbm.copy())
    silent.rsrp_dbm[:, window.cells.index("e")] = np.nan
    whole = ~np.isnan(silent.rsrp_dbm).all(axis=1)  # samples that heard the carrier anyway
    heard = replace(window, distance_m=window.distance_m[whole], rsrp_dbm=window.rsrp_dbm[whole])
    silent = replace(silent, distance_m=window.distance_m[whole], rsrp_dbm=silent.rsrp_dbm[whole])
    for road, same in ((0, True), (1, True), (2, False)):
        with_it, without = scores(index, heard, road), scores(index, silent, road)
        if same:
            inside = slice(30, -30)  # beyond an end, any reading is as unlikely
            np.testing.assert_allclose(with_it[inside], without[inside], atol=1e-4)
        else:
            assert np.abs(with_it - without).max() > 1.0


@pytest.mark.parametrize("seed", range(6))
def test_scores_are_the_literal_log_likelihood(seed):
    """At every place of every road, newcomers among the cells heard, on a day a road or two."""
    models = tiny_models(10 * seed)
    models = on_days(models, *(DAYS if seed % 2 else (DAYS[0], DAYS[0], DAYS[1])))
    window = window_along(models[seed % 3], seed, sign=1 if seed % 2 else -1, extra=("d", "e"))
    window = replace(window, cells=_distinct(window.cells))
    index = map_of(models)
    found = plain.readings(window, set(index.cells), as_laid(models))
    places = whole_roads(index, ask(index, window))
    sd_db = index.calibration.offset_sd_db
    laid = as_laid(models)
    expected = [
        plain.marginal(
            laid[road], found, place, sign, sd_db, new=plain.newcomers(models, models[road])
        )[0]
        for road, along in enumerate(index.roads)
        for sign in (1, -1)
        for place in range(along.grid_size)
    ]
    np.testing.assert_allclose(places.score, expected, atol=2e-3, rtol=2e-5)


def _distinct(cells: tuple[str, ...]) -> tuple[str, ...]:
    """The window's columns with those named twice under a name that no map knows."""
    return tuple(f"{c}?" if c in cells[:at] else c for at, c in enumerate(cells))


@pytest.mark.parametrize("in_c", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_two_scales_and_their_twins_agree(seed, in_c):
    """The fast answer is the definition's where roads share a tape and have other newcomers."""
    models = on_days(gentle_models(100 + 10 * seed), *DAYS)
    index = map_of(models, Calibration(information_each=1.0 / 3.0, offset_sd_db=2.0))
    window = window_along(models[seed % 3], seed, extra=("d", "e"))
    window = replace(window, cells=_distinct(window.cells))
    if in_c:
        pytest.importorskip("app.numerics._native")
    fix, wanted = locate(index, window, in_c=in_c), locate_exhaustively(index, window)
    assert fix.road_id == wanted.road_id
    assert fix.road_posterior == pytest.approx(wanted.road_posterior, abs=0.02)
    assert fix.chainage_m == pytest.approx(wanted.chainage_m, abs=1.0)


def test_tapes_hold_what_the_roads_hold():
    """Where a coarse column is one metre place, both scales say the same of cells heard there."""
    models = on_days(gentle_models(920), *DAYS)
    index = map_of(models)
    window = Window(("b", "e", "d"), np.zeros(1), np.array([[-90.0, -91.0, -92.0]]))
    query = ask(index, window)
    near = coarse.score_roads(index, query, list(range(len(index.tapes))), None)
    fine = whole_roads(index, query)
    for road in range(3):
        places = near.every.road == road
        level = [fine.score[fine.road == road].mean(), near.score[places].mean()]
        assert level[1] == pytest.approx(level[0], abs=0.6)


@pytest.mark.parametrize("seed", range(3))
def test_what_samples_and_cells_add_is_the_score(seed):
    """Explained, newcomers add nothing on their roads and the sum is the matcher's score."""
    index = map_of(on_days(gentle_models(930 + seed), *DAYS), Calibration(offset_sd_db=2.5))
    window = window_along(gentle_models(930 + seed)[0], seed, extra=("d", "e"))
    query, places = ask(index, window), whole_roads(index, ask(index, window))
    new = [query.cells.index(cell) for cell in ("d", "e")]
    for at in range(0, len(places.score), 7):
        road, sign, chainage_m = int(places.road[at]), int(places.sign[at]), places.chainage_m[at]
        told = contributions(index, query, Place(road, sign, float(chainage_m)))
        assert told.score == pytest.approx(float(places.score[at]), abs=1e-4)
        if road == 0 and 30.0 < chainage_m < 50.0 and sign > 0:
            np.testing.assert_array_equal(told.hearing[:, new], 0.0)


def lacking(model: RoadModel, cell: int, day: str) -> RoadModel:
    """A fitted road without one of its cells, surveyed on a day of its own."""
    kept = np.arange(len(model.cells)) != cell

    def salience(one):
        return replace(one, mask=one.mask[:, kept])

    return replace(
        model,
        cells=tuple(name for name, keep in zip(model.cells, kept, strict=True) if keep),
        mean_dbm=model.mean_dbm[:, kept],
        spread_db=model.spread_db[:, kept],
        heard=model.heard[:, kept],
        features=model.features[:, kept],
        salience=salience(model.salience),
        segments=tuple(replace(one, salience=salience(one.salience)) for one in model.segments),
        heard_on={day: np.ones(kept.sum(), dtype=bool)},
    )


def test_round_corners_newcomers_say_nothing_either():
    """Each road of a way has its own: in C, in numpy, at both scales, and explained."""
    models = [lacking(one, at % 2, DAYS[at % 2]) for at, one in enumerate(models_of())]
    index = map_of(tuple(models))
    assert any(newcomers_of(models))
    for window, *_ in corners_of(6, 4):
        slow = locate_exhaustively(index, window, turns=True)
        for in_c in {False, native.BUILT}:
            fast = locate(index, window, in_c=in_c)
            assert fast.road_posterior == pytest.approx(slow.road_posterior, abs=2e-3)
        query = ask(index, window)
        for one in every_corner(index, query)[:3]:
            way, first = way_of(index, one.turn), one.first_m
            places = places_along(index, query, way, (first, first))
            place = Place(way.road, way.sign, float(places.chainage_m[0]), way)
            told = contributions(index, query, place)
            assert told.score == pytest.approx(float(places.score[0]), abs=1e-3)


def test_a_cell_gone_elsewhere_is_less_expected():
    """On a road not driven since, as much as if it had been; not where it was only out of reach."""
    first, second, _ = gentle_models(940)
    second = replace(second, cells=("b", "c", "z"))
    there, gone = np.array([True, True, True]), np.array([False, True, True])
    driven = replace(second, heard_on={DAYS[0]: there, DAYS[1]: gone, DAYS[2]: gone})
    models = (replace(first, heard_on={DAYS[0]: there}), driven)
    tempered = Days.of(models).tempered(0, models[0])
    np.testing.assert_allclose(tempered.heard[:, 1], first.heard[:, 1] / 3.0, rtol=1e-6)
    np.testing.assert_array_equal(tempered.heard[:, [0, 2]], first.heard[:, [0, 2]])
    assert Days.of(models).tempered(1, driven) is driven  # it heard the silence itself
    rare = replace(driven, heard=np.full_like(driven.heard, 0.05))
    assert Days.of((models[0], rare)).tempered(0, models[0]) is models[0]
    again = replace(first, cells=("b", "x", "y"), heard_on={DAYS[1]: there, DAYS[2]: there})
    assert Days.of((*models, again)).tempered(0, models[0]) is models[0]
