"""What a map says of its own reliability: learnt from held-out windows, honest on fresh ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.domain import Calibration, RadioMap, Road
from app.evaluation.scenario import survey, windows
from app.numerics.calibration import (
    MIN_WINDOWS,
    UNTRIED,
    _most_probable,
    _offset_sd_db,
    calibrate,
)
from app.numerics.evidence_table import COLUMNS, pack, shared_of, unpack
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.posterior import Places
from app.numerics.query import ask
from app.numerics.roadfit import fit_road
from app.numerics.unseen import Asked
from tests.numerics.cities import city_of, error_m, index_of, models_of
from tests.numerics.trials import PRIOR, trial


def test_information_is_what_the_truths_say():
    """Windows whose truths scatter as if 0.5 + w/10 samples had been independent show just that."""
    rng = np.random.default_rng(5)
    trials = [
        trial(rng, samples, 0.5 + 0.1 * samples)
        for samples in rng.choice([1, 4, 10, 40], 1200).tolist()
    ]
    told = [Asked(0, one.truth, one.places) for one in trials]
    sizes = np.array([(one.weight, one.samples) for one in trials])
    once, each, position_sd_m = _most_probable(told, sizes, PRIOR, np.array([400.0]))
    for samples in (4, 10, 40):
        assert once + each * samples == pytest.approx(0.5 + 0.1 * samples, rel=0.25)
    assert position_sd_m <= 11.0


def test_no_window_tells_more_than_its_samples():
    """However much each sample seems to say, a window of few counts as few."""
    sure = Calibration(information_once=1.0, information_each=50.0)
    assert sure.temperature(1.0, 1) == 1.0
    assert sure.temperature(3.0, 30) == pytest.approx(0.1)
    assert Calibration(0.5, 0.1).temperature(10.0, 100) == pytest.approx(10.0 / 1.5)


@pytest.mark.parametrize("offset_db", [1.0, 4.0])
def test_the_spread_of_devices_is_learnt(offset_db):
    """Offsets of measured windows, less their noise, give the prior's spread."""
    rng = np.random.default_rng(3)
    windows = []
    for shift_db in rng.normal(0.0, offset_db, 400).tolist():
        one = trial(rng, 100, 10.0)
        one.places.values[3], one.places.values[4] = 100.0 * shift_db, 100.0
        windows.append(Asked(0, replace(one.truth, chainage_m=200.0), one.places))
    assert _offset_sd_db(windows, PRIOR) == pytest.approx(offset_db, rel=0.15)
    nothing = windows[0].places.values.copy()
    nothing[3:] = 0.0  # at its truth the map has none of the window's cells
    strange = replace(windows[0], places=Places(windows[0].places.where, nothing))
    assert _offset_sd_db([*windows, strange], PRIOR) == pytest.approx(offset_db, rel=0.15)


def test_too_little_evidence_keeps_the_defaults():
    """Fewer windows than say anything leave that of real streets driven once."""
    model = models_of()[0]
    few = pack(unpack(model.evidence)[: MIN_WINDOWS - 1])
    assert calibrate([replace(model, evidence=few)]) == UNTRIED


def test_evidence_is_packed_without_loss():
    """What a model carries is what was held out, to the precision of its numbers."""
    for model in models_of():
        assert model.evidence.shape[1] == COLUMNS
        windows = unpack(model.evidence)
        assert len(windows) >= 20
        np.testing.assert_array_equal(pack(windows, shared_of(model.evidence)), model.evidence)
        for one in windows:
            assert one.rsrp_dbm.shape == (len(one.distance_m), len(one.cells))
            assert one.distance_m[-1] == 0.0
            assert 0.0 <= one.chainage_m <= model.length_m


def test_evidence_of_another_layout_is_no_evidence():
    """A table with other columns, from an older version of the code, has no windows."""
    assert unpack(np.ones((5, COLUMNS + 3), dtype=np.float32)) == []
    assert unpack(np.zeros((0, 0), dtype=np.float32)) == []


def test_one_pass_is_no_measurement_of_devices():
    """Evidence of a single pass is drawn from the model and marked so; that of two days is not."""
    assert not any(one.measured for model in models_of() for one in unpack(model.evidence))
    city = city_of("harsh")
    truth = city.roads[0]
    passes = [one for one in survey(city) if one.road_id == truth.road_id]
    model = fit_road(Road(truth.road_id, line=truth.line), passes)
    assert all(one.measured for one in unpack(model.evidence))


def test_where_all_windows_are_drawn_every_sample_counts():
    """They were drawn reading by reading: there is nothing to learn of it, and chance is not."""
    for cells in (1, 3, 6):
        told = index_of(cells=cells).calibration
        for window, _ in windows(city_of(cells=cells), 5, length_m=30.0):
            query = ask(index_of(cells=cells), window)
            samples = len(query.fine.weight)
            assert told.information(query.weight, samples) == samples
        assert told.position_sd_m == told.segment_sd_m == 0.0


@cache
def _short_fixes():
    """Windows of 10 m in two cells: roads are often in doubt."""
    index = index_of(cells=2)
    return [
        (locate(index, window), locate(index, window, confidence=0.95), truth)
        for window, truth in windows(city_of(cells=2), 160, length_m=10.0)
    ]


def test_probabilities_happen_that_often():
    """Of fresh windows, roads are right about as often as their posteriors say."""
    said = np.array([fix.road_posterior for fix, _, _ in _short_fixes()])
    right = np.array([fix.road_id == truth.road_id for fix, _, truth in _short_fixes()])
    assert right.mean() == pytest.approx(said.mean(), abs=0.08)


def test_radii_hold_the_truth_that_often():
    """The radius at 68 % holds the truth in 55 to 90 % of fresh windows, at 95 % in most."""
    near = [error_m(fix, truth) <= fix.accuracy_m for fix, _, truth in _short_fixes()]
    wide = [error_m(fix, truth) <= fix.accuracy_m for _, fix, truth in _short_fixes()]
    assert 0.55 <= np.mean(near) <= 0.90
    assert np.mean(wide) >= 0.82


def test_temperature_flattens_the_answer():
    """The same map at a higher temperature is less sure of its roads, and no less complete."""
    city, models = city_of(cells=2), models_of(cells=2)
    index = index_of(cells=2)
    surely = index.calibration
    flatter = replace(
        surely,
        information_once=surely.information_once / 8.0,
        information_each=surely.information_each / 8.0,
    )
    hot = MapIndex.build(RadioMap(1, models, flatter))
    surer = 0
    for window, _ in windows(city, 40, length_m=10.0):
        here, there = locate(index, window), locate(hot, window)
        surer += here.candidates[0].posterior >= there.candidates[0].posterior
        assert sum(one.posterior for one in there.candidates) == pytest.approx(
            1.0 - there.off_map_posterior, abs=1e-9
        )
    assert surer >= 38
