"""What a map says of its own reliability: learnt from held-out windows, honest on fresh ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.domain import Calibration, RadioMap, Road, Window
from app.evaluation.scenario import survey, windows
from app.numerics.answer import fit_of_place
from app.numerics.calibration import (
    MIN_WINDOWS,
    UNTRIED,
    _log_odds,
    _most_probable,
    _offset_sd_db,
    calibrate,
)
from app.numerics.evidence_table import COLUMNS, DRAWN, HeldOut, pack, unpack
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, locate, shortlist
from app.numerics.offmap import OFF_MAP_PRIOR, Fit, off_map_probability, off_map_terms
from app.numerics.offsets import APART_SHARE, OffsetPrior
from app.numerics.posterior import Places
from app.numerics.query import ask
from app.numerics.roadfit import fit_road
from app.numerics.trials import Trial
from app.numerics.unseen import Asked
from tests.numerics.cities import city_of, error_m, index_of, models_of

PRIOR = OffsetPrior.learnt(1.0)


def trial(rng, samples, information, position_sd_m=0.0):
    """A window on a long road whose score falls from its peak as if each sample told one unit."""
    at_m = np.arange(0.0, 400.0)
    peak_m = rng.uniform(150.0, 250.0)
    score = -0.5 * samples * (at_m - peak_m) ** 2 / 60.0**2
    true_m = peak_m + rng.normal(0.0, np.hypot(60.0 / np.sqrt(information), position_sd_m))
    where = np.stack([np.zeros(400, dtype=np.int64), np.ones(400, dtype=np.int64)])
    zero = np.zeros(400)
    places = Places(where, np.stack([at_m, zero + 1.0, score, zero, zero + 1.0]))
    truth = HeldOut(np.zeros(1), np.zeros((1, 1)), np.zeros(1, int), true_m, 1, 0)
    return Trial(0, truth, places, float(samples), samples, Fit(1.0, 0.0), Fit(0.0, 0.0))


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
        np.testing.assert_array_equal(pack(windows), model.evidence)
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


def test_off_map_falls_with_the_fit():
    """The better a window fits the less it is off the map; with no known cell it is."""
    fits = [Fit(per_reading, 0.0) for per_reading in (-9.0, -2.0, 0.0, 1.0, 3.0)]
    odds = [off_map_probability(Calibration(), fit, 5.0) for fit in fits]
    assert odds == sorted(odds, reverse=True)
    assert odds[0] > 0.9
    assert odds[-1] < 0.1
    assert off_map_probability(Calibration(), None, 5.0) > 0.999


def test_log_odds_part_two_classes():
    """Fits that lie apart the more the longer the window: the learnt odds say so, both ways."""
    rng = np.random.default_rng(8)
    trials = []
    for _ in range(600):
        one = trial(rng, 10, 10.0)
        weight = float(np.exp(rng.uniform(0.0, 3.0)))
        noise = 1.0 / np.sqrt(weight)
        on, off = 1.0 + noise * rng.normal(), noise * rng.normal()
        trials.append(
            replace(one, weight=weight, samples=99, fit=Fit(on, 0.0), stranger_fit=Fit(off, 0.0))
        )
    learnt = Calibration(off_map=_log_odds(trials, Calibration()))
    for weight, sure in ((1.0, 0.25), (18.0, 0.02)):
        assert off_map_probability(learnt, Fit(1.0, 0.0), weight) < sure
        # Log odds of the two Gaussians at their middle are even, but for the prior.
        middle = off_map_probability(learnt, Fit(0.5, 0.0), weight)
        assert middle == pytest.approx(OFF_MAP_PRIOR, abs=0.02)
    off = off_map_probability(learnt, Fit(0.0, 0.0), 18.0)
    evidence = off / (1.0 - off) * (1.0 - OFF_MAP_PRIOR) / OFF_MAP_PRIOR
    assert evidence > 57.0  # with a prior of one in twenty: off the map at three to one


def trials_with_offsets(seed: int, *, measured: bool):
    """Fits that overlap, survey devices alike, strangers' best places that need any offset."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(500):
        one = trial(rng, 10, 10.0)
        truth = replace(one.truth, fold=0 if measured else DRAWN)
        on = Fit(0.7 + 0.5 * rng.normal(), 0.4 * rng.normal())
        off = Fit(0.5 * rng.normal(), 7.0 * rng.normal())
        out.append(replace(one, truth=truth, weight=5.0, samples=99, fit=on, stranger_fit=off))
    return out


def test_a_window_that_needs_a_strange_device_is_likelier_off_the_map():
    """The same fit with 15 dB of offset; with 6 dB, as a vehicle's may have, it is kept."""
    learnt = Calibration(off_map=_log_odds(trials_with_offsets(3, measured=True), Calibration()))
    usual, unusual, strange = (
        off_map_probability(learnt, Fit(0.8, offset_db), 5.0) for offset_db in (0.3, 6.0, 15.0)
    )
    assert usual < unusual < 0.5
    assert strange > 5.0 * usual
    assert off_map_probability(learnt, Fit(0.8, -15.0), 5.0) == pytest.approx(strange)


def test_drawn_windows_tell_nothing_of_devices():
    """Of roads with one pass: the odds do not hang on the offset."""
    learnt = Calibration(off_map=_log_odds(trials_with_offsets(4, measured=False), Calibration()))
    odds = [off_map_probability(learnt, Fit(0.4, offset_db), 5.0) for offset_db in (0.0, 15.0)]
    assert odds[0] == pytest.approx(odds[1])


def test_a_fit_that_needs_changed_cells_pays_their_prior():
    """As probable as the same fit without them once the prior odds of changed cells are paid."""
    odds = []
    for apart in (0.0, 0.5, 1.0):
        off = off_map_probability(Calibration(), Fit(0.6, 0.0, apart), 5.0)
        odds.append(np.log(off / (1.0 - off)))
    paid = np.log((1.0 - APART_SHARE) / APART_SHARE)
    np.testing.assert_allclose(odds - odds[0], [0.0, 0.5 * paid, paid], atol=1e-9)


def test_where_all_windows_are_drawn_every_sample_counts():
    """They were drawn reading by reading: there is nothing to learn of it, and chance is not."""
    for cells in (1, 3, 6):
        told = index_of(cells=cells).calibration
        for window, _ in windows(city_of(cells=cells), 5, length_m=30.0):
            query = ask(index_of(cells=cells), window)
            samples = len(query.fine.weight)
            assert told.information(query.weight, samples) == samples
        assert told.position_sd_m == told.segment_sd_m == 0.0


def test_maps_of_before_answer_as_before():
    """Four coefficients, as stored by older versions: the offset has no say."""
    older = Calibration(off_map=(1.2, 2.3, 0.4, 1.6))
    for offset_db in (0.0, 9.0):
        terms = off_map_terms(Fit(0.5, offset_db), 4.0)
        off = off_map_probability(older, Fit(0.5, offset_db), 4.0)
        assert off == pytest.approx(1.0 / (1.0 + np.exp(np.dot(older.off_map, terms[:4]))))


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


@pytest.mark.parametrize("offset_db", [-6.0, 6.0])
def test_an_unusual_device_is_no_stranger(offset_db):
    """A common offset leaves the fit per reading as it was, and is told beside it."""
    index = index_of(cells=6)
    for window, _ in windows(city_of(cells=6), 20, length_m=30.0):
        shifted = Window(window.cells, window.distance_m, window.rsrp_dbm + offset_db)
        there, here = fit_of(index, shifted), fit_of(index, window)
        assert there.per_reading == pytest.approx(here.per_reading, abs=0.02)
        assert there.offset_db == pytest.approx(here.offset_db + offset_db, abs=0.5)


def fit_of(index, window):
    query = ask(index, window)
    places = fine_places(index, query, shortlist(index, query))
    return fit_of_place(index, query, places, int(places.score.argmax()))
