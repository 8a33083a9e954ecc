"""Laws that every compared method keeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Window
from app.evaluation.methods import METHODS, Confident, Previous
from app.evaluation.protocols import tour
from app.evaluation.scenario import city_drives
from app.numerics import exhaustive, matching
from app.numerics.geodesy import distance_m

SEED = 7


@pytest.fixture(scope="module")
def models(paper_survey):
    return {name: method.fit(paper_survey, SEED) for name, method in METHODS.items()}


@pytest.fixture(scope="module")
def asked(paper_city):
    return list(tour(city_drives(paper_city), 20, protocol="anywhere", length_m=30.0, seed=SEED))


def places(model, windows):
    return np.array([(fix.lon, fix.lat) for fix in (model.locate(w, None) for w in windows)])


@pytest.mark.parametrize("name", METHODS)
def test_the_order_of_cells_moves_nothing(models, asked, name):
    """A window names its cells: their order is the phone's whim."""
    windows = [each.window for each in asked[:6]]
    turned = [
        Window(w.cells[::-1], w.distance_m, np.ascontiguousarray(w.rsrp_dbm[:, ::-1]))
        for w in windows
    ]
    np.testing.assert_allclose(
        places(models[name], turned), places(models[name], windows), atol=1e-12
    )


@pytest.mark.parametrize("name", METHODS)
def test_an_unknown_cell_moves_nothing(models, asked, name):
    """No method can use a cell that no survey heard."""
    windows = [each.window for each in asked[:6]]
    more = [
        Window(
            (*w.cells, "9:9"),
            w.distance_m,
            np.column_stack([w.rsrp_dbm, np.full(len(w.distance_m), -80.0)]),
        )
        for w in windows
    ]
    np.testing.assert_allclose(
        places(models[name], more), places(models[name], windows), atol=1e-12
    )


@pytest.mark.parametrize("name", METHODS)
def test_the_origin_of_the_odometer_moves_nothing(models, asked, name):
    """Only differences of travelled distance count."""
    windows = [each.window for each in asked[:6]]
    later = [replace(w, distance_m=w.distance_m + 512.0) for w in windows]
    # Method cf-els looks for the least of many nearly equal sums; the others move by rounding.
    np.testing.assert_allclose(
        places(models[name], later), places(models[name], windows), atol=1e-9
    )


@pytest.mark.parametrize("name", METHODS)
def test_the_same_question_has_the_same_answer(models, asked, name):
    """Nothing is remembered but what the caller hands back."""
    model = models[name]
    first = model.locate(asked[0].window, None)
    second = model.locate(asked[1].window, Previous(first, asked[1].since_m))
    model.locate(asked[7].window, None)
    again = model.locate(asked[1].window, Previous(first, asked[1].since_m))
    assert (again.road_id, again.chainage_m) == (second.road_id, second.chainage_m)


@pytest.mark.parametrize("name", METHODS)
def test_chainage_and_position_are_the_same_place(models, asked, paper_survey, name):
    """A fix names its place twice; both must agree."""
    from app.numerics.lines import point_at

    for each in asked[:6]:
        fix = models[name].locate(each.window, None)
        place = point_at(paper_survey.line(fix.road_id), fix.chainage_m)
        assert float(distance_m(fix.lon, fix.lat, place.lon, place.lat)) < 30.0


def test_roadprint_is_the_code_of_the_service(models):
    """Not a copy: the very functions, on one and the same index."""
    assert models["roadprint"].ask is matching.locate
    assert models["exhaustive"].ask is exhaustive.locate_exhaustively
    assert models["roadprint"].index is models["exhaustive"].index


def test_two_scales_return_what_the_definition_returns(models, asked):
    """The candidates lose nothing: both searches place every window alike."""
    windows = [each.window for each in asked]
    fast, slow = (places(models[name], windows) for name in ("roadprint", "exhaustive"))
    away_m = distance_m(*fast.T, *slow.T)
    assert away_m.max() < 0.01


def test_only_roadprint_reports_a_radius(models):
    """A radius is the service's promise; the rivals make none."""
    assert [name for name, model in models.items() if isinstance(model, Confident)] == ["roadprint"]


def test_radii_grow_with_the_confidence(models, asked):
    """The 95 % radius is no smaller than the 68 % one."""
    for each in asked[:5]:
        model = models["roadprint"]
        assert model.radius_m(each.window, 0.95) >= model.radius_m(each.window, 0.68) > 0
