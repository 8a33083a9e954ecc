"""Curves that have not seen a window: kept at nodes, laid out among the others, asked of."""

from __future__ import annotations

import numpy as np
import pytest

from app.domain import Road
from app.evaluation.scenario import survey
from app.numerics import unseen
from app.numerics.evidence_table import unpack
from app.numerics.heldout import nodes_of
from app.numerics.posterior import SCORE, masses
from app.numerics.roadfit import fit_road
from app.numerics.unseen import ask_at_home, held_out_windows, without
from tests.numerics.cities import city_of, models_of
from tests.numerics.tiny import map_of


@pytest.mark.parametrize(("grid", "nodes"), [(2, 2), (60, 60), (60, 21), (61, 16), (1565, 523)])
def test_nodes_reach_both_ends_and_lie_evenly(grid, nodes):
    """As many as were kept, none twice."""
    at = nodes_of(grid, nodes)
    assert (at[0], at[-1], len(at)) == (0, grid - 1, nodes)
    gaps = np.diff(at)
    assert gaps.min() >= 1
    assert gaps.max() - gaps.min() <= 1


def test_curves_between_nodes_are_those_of_a_fit_without_the_passes():
    """Levels to a tenth of a decibel, and mapped where the nearest node is."""
    city = city_of("harsh")
    truth = city.roads[0]
    passes = [one for one in survey(city) if one.road_id == truth.road_id]
    model = fit_road(Road(truth.road_id, line=truth.line), passes)
    folds, _, nodes, cells = model.unseen.shape
    assert (folds, cells) == (len(passes), len(model.cells))
    assert 1 < nodes <= len(model.mean_dbm)
    fitted = fit_road(Road(truth.road_id, line=truth.line), passes[1:])
    # Which fold is which is the folds' own business: one of them is the map without the first pass.
    misses = []
    for fold in range(folds):
        kept = without(model, fold)
        both = ~np.isnan(kept.mean_dbm) & ~np.isnan(fitted.mean_dbm)
        misses.append(float(np.abs(kept.mean_dbm - fitted.mean_dbm)[both].mean()))
        at = nodes_of(len(model.mean_dbm), nodes)
        np.testing.assert_allclose(
            kept.mean_dbm[at], model.unseen[fold, 0].astype(np.float32), rtol=1e-6
        )
    assert min(misses) < 0.5 < max(misses)


def test_a_window_drawn_from_the_map_fits_where_it_was_drawn():
    """At home the places about the truth of windows that the map drew are among the best."""
    models = models_of()
    windows = [pair for pair in held_out_windows(models) if len(pair[1].distance_m) > 20][::7]
    assert len(windows) >= 10
    right = []
    for one in ask_at_home(map_of(models), models, windows):
        best = int(one.places.values[SCORE].argmax())
        near = abs(float(one.places.chainage_m[best]) - one.truth.chainage_m) < 2.0
        right.append(near and int(one.places.sign[best]) == one.truth.sign)
        assert one.places.width_m.sum() <= 2.0 * len(models[one.road].mean_dbm)
    assert np.mean(right) > 0.9


def test_the_best_of_a_block_has_the_mass_of_all_of_it(monkeypatch):
    """Whatever a window's temperature is, the truth is as probable as with every metre kept."""
    models = models_of("harsh", cells=2)
    index, windows = map_of(models), held_out_windows(models)[::7]
    assert len(windows) >= 10
    blocks = ask_at_home(index, models, windows)
    monkeypatch.setattr(unseen, "BLOCK_M", index.roads[0].step_m)
    metres = ask_at_home(index, models, windows)
    assert sum(len(one.places) for one in blocks) < 0.4 * sum(len(one.places) for one in metres)
    for temperature in (0.3, 1.0, 4.0, 20.0):
        for few, all_ in zip(blocks, metres, strict=True):
            shares = [
                masses(one.at(temperature), temperature)[near_truth(one)].sum()
                for one in (few, all_)
            ]
            assert shares[0] == pytest.approx(shares[1], rel=0.02, abs=1e-6)


def near_truth(one):
    return np.abs(one.places.chainage_m - one.truth.chainage_m) < unseen.NEAR_TRUTH_M


def test_every_window_of_a_fold_is_of_a_pass_that_its_curves_lack():
    """Measured windows name a fold that the model has curves of; drawn ones none."""
    for model in models_of():
        assert not any(one.measured for one in unpack(model.evidence))
        assert len(model.unseen) == 0
    for model in models_of("harsh"):
        folds = {one.fold for one in unpack(model.evidence)}
        assert folds <= set(range(len(model.unseen)))
