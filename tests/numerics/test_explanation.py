"""Why a window was answered so: the terms add up, and what was planted is what is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, RoadModel, Window
from app.evaluation.scenario import windows
from app.numerics.contributions import Place, contributions
from app.numerics.explanation import Explanation, explain
from app.numerics.features import feature_matrix
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.observation import HEARD_FLOOR
from app.numerics.query import ask
from app.numerics.refinement import refine
from app.numerics.stretches import whole_roads
from app.numerics.wording import sentences
from tests.factories import line_at
from tests.numerics.cities import city_of, index_of, models_of
from tests.numerics.tiny import as_laid, gentle_models, map_of, tiny_models, window_along

CELLS = ("a", "b", "c")


def explained(index: MapIndex, window: Window) -> Explanation:
    return explain(index, window, locate(index, window))


def twin_roads(seed: int, *, cell: int = 1, off_db: float = 0.0) -> tuple[RoadModel, RoadModel]:
    """Two roads with the very same curves, but for one cell, which the second has higher."""
    first, second = gentle_models(seed)[:2]
    level_dbm = first.mean_dbm.copy()
    level_dbm[:, cell] += np.float32(off_db)
    same = replace(
        second, cells=first.cells, mean_dbm=level_dbm, spread_db=first.spread_db, heard=first.heard
    )
    return first, same


def on_curve(model: RoadModel, last: int, samples: int = 30) -> Window:
    """What a device without noise or offset reads over the metres that end at a grid position."""
    rows = np.arange(last - samples + 1, last + 1)
    return Window(model.cells, np.arange(samples) * 1.0, model.mean_dbm[rows].astype(float))


@pytest.mark.parametrize("step_m", [1.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_what_samples_and_cells_add_is_the_score(seed, step_m):
    """At every place, between grid positions too, the terms are the matcher's score, no more."""
    models = tiny_models(seed, step_m=step_m)
    index = map_of(models, Calibration(offset_sd_db=2.5))
    window = window_along(models[seed % 3], seed, sign=1 - 2 * (seed % 2), extra=("zz",))
    query = ask(index, window)
    places = refine(index, query, whole_roads(index, query))
    found = [
        contributions(index, query, Place(road, sign, chainage_m)).score
        for road, sign, chainage_m in zip(
            places.road.tolist(), places.sign.tolist(), places.chainage_m.tolist(), strict=True
        )
    ]
    np.testing.assert_allclose(found, places.score, rtol=0, atol=1e-4)


@pytest.mark.parametrize("cells", [2, 6])
def test_shares_and_offset_add_up_to_the_difference(cells):
    """What every cell adds, and the device offset, is all that parts the two scores."""
    index = index_of(cells=cells)
    for one in windows(city_of(cells=cells), 20):
        told = explained(index, one.window)
        total = sum(share.total for share in told.shares) + told.offset
        apart = told.answer.told.score - told.runner_up.told.score
        assert total == pytest.approx(apart, abs=1e-9)
        assert told.difference == pytest.approx(apart, abs=1e-9)
        assert told.answer.road_id != told.runner_up.road_id
        assert told.temperature > 0


def test_the_answer_beats_every_place_of_other_roads():
    """The runner-up is the best place that the whole map has on another road."""
    index = index_of(cells=2)
    for one in windows(city_of(cells=2), 10):
        told = explained(index, one.window)
        query = ask(index, one.window)
        places = refine(index, query, whole_roads(index, query))
        elsewhere = places.score[places.road != told.answer.place.road].max()
        assert told.runner_up.told.score == pytest.approx(elsewhere, abs=0.5)
        assert told.difference > 0


@pytest.mark.parametrize("seed", range(3))
def test_permuting_cells_moves_nothing(seed):
    """Columns in another order are the same window: numbers and sentences are the same."""
    index = index_of()
    window = next(iter(windows(city_of(), 1 + seed))).window
    order = np.random.default_rng(seed).permutation(len(window.cells))
    turned = Window(
        tuple(window.cells[i] for i in order), window.distance_m, window.rsrp_dbm[:, order].copy()
    )
    here, there = explained(index, window), explained(index, turned)
    assert here.shares == there.shares
    assert here.cells == there.cells
    np.testing.assert_array_equal(here.residual_db, there.residual_db)
    np.testing.assert_array_equal(here.features, there.features)
    assert sentences(here, locate(index, window)) == sentences(there, locate(index, turned))


@pytest.mark.parametrize("seed", range(3))
def test_a_window_on_the_curve_has_no_residuals(seed):
    """Readings of the map's own levels differ from the fit by next to nothing, anywhere."""
    models = gentle_models(seed)
    told = explained(map_of(models), on_curve(models[0], 50))
    assert told.answer.road_id == models[0].road_id
    assert told.answer.place.chainage_m == pytest.approx(50.0, abs=0.5)
    np.testing.assert_allclose(told.residual_db, 0.0, atol=0.5)
    expected = told.answer.expected
    np.testing.assert_allclose(expected.spread_db, 2.0, rtol=1e-5)
    chance = np.minimum(as_laid(models)[0].heard[50 - 29 : 51, :3], 1.0 - HEARD_FLOOR)
    np.testing.assert_allclose(expected.hearing, chance, rtol=1e-3)


@pytest.mark.parametrize("off_db", [-5.0, 5.0])
@pytest.mark.parametrize("cell", range(3))
def test_the_planted_deviation_is_the_one_named(cell, off_db):
    """Of two roads alike but for one cell, that cell is said to part them, by so many dB."""
    models = twin_roads(5, cell=cell, off_db=off_db)
    index, window = map_of(models), on_curve(models[0], 50)
    fix = locate(index, window)
    told = explain(index, window, fix)
    assert told.answer.road_id == models[0].road_id
    assert told.shares[0].cell == models[0].cells[cell]
    assert told.shares[0].level > abs(told.shares[0].hearing)
    said = sentences(told, fix)
    assert said[0].startswith(f"{models[1].road_id} at ")
    word = "weak" if off_db > 0 else "strong"
    assert said[1].startswith(f"Cell {models[0].cells[cell]} is ")
    assert f"dB too {word} there over the last " in said[1]
    assert float(said[1].split(" is ")[1].split(" dB")[0]) == pytest.approx(5.0, abs=1.2)


def test_a_cell_missing_there_is_named():
    """A road where the window's cell is not mapped loses by hearing, and is said to."""
    first, second = twin_roads(6)
    level_dbm, heard = second.mean_dbm.copy(), second.heard.copy()
    level_dbm[:, 2], heard[:, 2] = np.nan, 0.0
    index = map_of((first, replace(second, mean_dbm=level_dbm, heard=heard)))
    window = on_curve(first, 50)
    fix = locate(index, window)
    told = explain(index, window, fix)
    share = next(one for one in told.shares if one.cell == first.cells[2])
    assert share.hearing > 0
    assert any(f"Cell {first.cells[2]}" in one for one in sentences(told, fix))
    assert told.missing == {}


def test_a_silent_cell_is_missing_at_the_answer():
    """A cell that the place nearly always hears, and the window never did, is listed."""
    models = gentle_models(7)
    window = on_curve(models[0], 50)
    silent = window.rsrp_dbm.copy()
    silent[:, 1] = np.nan
    told = explained(map_of(models), Window(window.cells, window.distance_m, silent))
    assert told.cells == ("a", "c")
    chance = np.minimum(as_laid(models)[0].heard[50 - 29 : 51, 1], 1.0 - HEARD_FLOOR)
    assert told.missing == {"b": pytest.approx(float(chance.mean()), abs=1e-4)}
    assert told.answer.told.silent["b"] < 0


def test_samples_not_heard_or_not_mapped_have_no_residual():
    """NaN where the window did not hear, and where the place has no level."""
    near, other, last = gentle_models(8)
    models = (near, other, replace(last, line=line_at(900.0, length_m=60.0)))  # "e" is far away
    window = on_curve(models[0], 50)
    readings = np.column_stack([window.rsrp_dbm, np.full(30, -80.0)])
    readings[4, 0] = np.nan
    told = explained(map_of(models), Window((*models[0].cells, "e"), window.distance_m, readings))
    assert told.cells == ("a", "b", "c", "e")
    assert np.isnan(told.residual_db[4, 0])
    assert np.isnan(told.residual_db[:, 3]).all()
    assert (told.answer.expected.hearing[:, 3] == 0.0).all()
    assert np.isfinite(np.delete(told.residual_db[:, :3], 4, axis=0)).all()


def test_a_map_of_one_road_has_a_runner_up():
    """Elsewhere on the road or the other way, never beside the answer itself."""
    model = gentle_models(9)[0]
    told = explained(map_of((model,)), on_curve(model, 50))
    here, there = told.answer, told.runner_up
    assert here.road_id == there.road_id
    assert (here.segment, here.direction) != (there.segment, there.direction)
    assert told.difference > 0


def test_off_the_map_the_cell_astray_is_named():
    """A window that fits nowhere is told by how little it says, and by what keeps it out."""
    index, window = index_of(), windows(city_of(), 4)[3].window
    here = locate(index, window)
    strange = window.rsrp_dbm.copy()
    strange[:, 1] += np.where(np.arange(len(strange)) % 2, 25.0, -25.0)
    window = Window(window.cells, window.distance_m, strange)
    fix = locate(index, window)
    assert fix.off_map
    said = sentences(explain(index, window, fix), fix)
    assert said[0].startswith("The window fits no road")
    told = explain(index, window, fix)
    assert f"its levels have {told.any_road:.2f} on any road" in said[0]
    assert told.this_road < 0.0
    assert f"{told.this_road:+.1f} nats in all for this road" in said[0]
    together = index.recalibrated(replace(index.calibration, information_each=0.1))
    told = explain(together, window, fix)
    assert told.this_road is None
    assert "what readings share" not in sentences(told, fix)[0]
    # Held against the place where it was driven, whatever else it was held against.
    told = explain(index, window, replace(here, off_map=True))
    said = sentences(told, replace(here, off_map=True))
    assert said[1].startswith(f"Cell {window.cells[1]} is 2")
    assert "dB astray (root mean square) there over the last " in said[1]


def test_a_window_of_unknown_cells_says_so():
    """Nothing to compare: no shares of cells that were heard, one sentence, no fit."""
    index = map_of(gentle_models(11))
    window = Window(("zz",), np.arange(3.0), np.full((3, 1), -90.0))
    fix = locate(index, window)
    told = explain(index, window, fix)
    assert fix.off_map
    assert told.cells == ()
    assert told.fit is None
    assert told.any_road is None
    assert told.this_road is None
    assert told.residual_db.shape == (3, 0)
    assert told.features.shape == (5, 0)
    assert sentences(told, fix)[0].startswith("None of the window's cells is on the map")


def test_features_are_the_windows_and_the_curves():
    """The window's own five kinds, the predicted ones near them, masks from the models."""
    index, models = index_of(), models_of()
    one = next(iter(windows(city_of(), 3)))
    told = explained(index, one.window)
    column = [one.window.cells.index(cell) for cell in told.cells]
    assert told.reference in told.cells
    own = feature_matrix(
        one.window.rsrp_dbm[:, column], one.window.distance_m, told.cells.index(told.reference)
    )
    np.testing.assert_allclose(told.features, own, atol=1e-9)
    near = np.abs(told.answer.features - own)
    far = np.abs(told.runner_up.features - own)
    assert np.nanmean(near[1]) < 2.0 < np.nanmean(far[1])
    model = next(each for each in models if each.road_id == told.answer.road_id)
    order = [model.cells.index(cell) for cell in told.cells]
    mask = model.segments[told.answer.segment].salience.mask[:, order]
    np.testing.assert_array_equal(told.answer.segment_mask, mask)
    np.testing.assert_array_equal(told.answer.road_mask, model.salience.mask[:, order])


def test_numpy_and_c_explain_alike():
    """The runner-up that the kernels in C find is the one that numpy finds."""
    index = index_of(cells=2)
    for one in windows(city_of(cells=2), 5):
        fix = locate(index, one.window)
        plain = explain(index, one.window, fix, in_c=False)
        fast = explain(index, one.window, fix, in_c=True)
        assert plain.runner_up.place.road == fast.runner_up.place.road
        assert plain.difference == pytest.approx(fast.difference, abs=1e-6)


def test_a_window_longer_than_is_used_is_explained_by_its_end():
    """Samples farther back than the matcher reads are no part of the explanation."""
    model = gentle_models(12)[0]
    far = Window(model.cells, np.array([0.0, 5000.0, 5001.0]), np.full((3, 3), -90.0))
    told = explained(map_of((model,)), far)
    assert told.behind_m.tolist() == [1.0, 0.0]
    assert told.residual_db.shape == (2, 3)
