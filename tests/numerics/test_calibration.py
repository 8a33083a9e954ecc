"""What a map says of its own reliability: learnt from held-out windows, honest on fresh ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.domain import Calibration, RadioMap, Road, Window
from app.evaluation.scenario import survey, windows
from app.numerics.answer import fit_at_best
from app.numerics.calibration import MIN_WINDOWS, calibrate
from app.numerics.evidence_table import CHOICES, COLUMNS, FIXED_COLUMNS
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, locate, shortlist
from app.numerics.offmap import off_map_probability
from app.numerics.query import ask
from app.numerics.roadfit import fit_road
from tests.factories import model_of
from tests.numerics.cities import city_of, error_m, index_of, models_of


def with_evidence(number: int, rows: int, best: int, offset_db: float = 0.0):
    """A model whose evidence prefers one choice of temperature and position error."""
    rng = np.random.default_rng(number)
    evidence = np.full((rows, len(COLUMNS)), -5.0, dtype=np.float32)
    evidence[:, len(FIXED_COLUMNS) + best] = -1.0
    evidence[:, COLUMNS.index("fit")] = rng.normal(1.0, 0.2, rows)
    evidence[:, COLUMNS.index("offset_db")] = rng.normal(0.0, 1.0, rows) * offset_db
    evidence[:, COLUMNS.index("offset_variance_db2")] = 0.01
    evidence[:, COLUMNS.index("measured")] = 1.0
    return replace(model_of(f"r{number}", seed=number, step_m=1.0), evidence=evidence)


@pytest.mark.parametrize("best", [0, 37, len(CHOICES) - 1])
def test_the_choice_of_the_best_log_score_is_taken(best):
    """Temperature and position error are those under which the truths were most probable."""
    learnt = calibrate([with_evidence(i, 30, best) for i in range(3)])
    assert (learnt.temperature, learnt.position_sd_m) == CHOICES[best]
    assert learnt.window_count == 90


@pytest.mark.parametrize("offset_db", [1.0, 4.0])
def test_the_spread_of_devices_is_learnt(offset_db):
    """Offsets of measured windows, less their noise, give the prior's spread."""
    learnt = calibrate([with_evidence(i, 200, 5, offset_db) for i in range(3)])
    assert learnt.offset_sd_db == pytest.approx(offset_db, rel=0.15)


def test_too_little_evidence_keeps_the_defaults():
    """Fewer windows than say anything leave the calibration as it was written."""
    assert calibrate([with_evidence(1, MIN_WINDOWS - 1, 5)]) == Calibration()


def test_evidence_is_a_table_as_agreed():
    """A model's evidence has the named columns, finite, with densities that are logarithms."""
    for model in models_of():
        assert model.evidence.shape[1] == len(COLUMNS)
        assert len(model.evidence) >= 20
        assert np.isfinite(model.evidence).all()
        assert np.all(model.evidence[:, COLUMNS.index("offset_variance_db2")] > 0.0)


def test_one_pass_is_no_measurement_of_devices():
    """Evidence of a single pass is drawn from the model and marked so; that of two days is not."""
    assert not any(model.evidence[:, COLUMNS.index("measured")].any() for model in models_of())
    city = city_of("harsh")
    truth = city.roads[0]
    passes = [one for one in survey(city) if one.road_id == truth.road_id]
    model = fit_road(Road(truth.road_id, line=truth.line), passes)
    assert model.evidence[:, COLUMNS.index("measured")].all()


def test_off_map_falls_with_the_fit():
    """The better a window fits the less it is off the map; with no known cell it is."""
    odds = [off_map_probability(Calibration(), fit) for fit in (-9.0, -2.0, 0.0, 1.0, 3.0)]
    assert odds == sorted(odds, reverse=True)
    assert odds[0] > 0.9
    assert odds[-1] < 0.1
    assert off_map_probability(Calibration(), None) > 0.999


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
    flatter = replace(index.calibration, temperature=8.0 * index.calibration.temperature)
    hot = MapIndex.build(RadioMap(1, models, flatter))
    surer = 0
    for window, _ in windows(city, 40, length_m=10.0):
        here, there = locate(index, window), locate(hot, window)
        surer += here.candidates[0].posterior >= there.candidates[0].posterior
        assert sum(one.posterior for one in there.candidates) == pytest.approx(
            1.0 - there.off_map_posterior, abs=1e-9
        )
    assert surer >= 38


@pytest.mark.parametrize("offset_db", [-6.0, 6.0])
def test_an_unusual_device_is_no_stranger(offset_db):
    """A common offset leaves the fit by which a window is judged to be on the map as it was."""
    index = index_of(cells=6)
    for window, _ in windows(city_of(cells=6), 20, length_m=30.0):
        shifted = Window(window.cells, window.distance_m, window.rsrp_dbm + offset_db)
        assert fit_of(index, shifted) == pytest.approx(fit_of(index, window), abs=0.02)


def fit_of(index, window):
    query = ask(index, window)
    return fit_at_best(index, query, fine_places(index, query, shortlist(index, query)))
