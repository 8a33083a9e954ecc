"""Windows off the map: told by how badly they fit, by their device, by what any road would do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, Window
from app.evaluation.scenario import windows
from app.numerics.answer import fit_of_place
from app.numerics.evidence_table import DRAWN
from app.numerics.matching import fine_places, shortlist
from app.numerics.odds import ENOUGH_TO_PART, OF_REAL_STREETS, _log_odds, log_odds_of
from app.numerics.offmap import OFF_MAP_PRIOR, Fit, off_map_probability, off_map_terms
from app.numerics.offsets import APART_SHARE
from app.numerics.query import ask
from tests.numerics.cities import city_of, index_of
from tests.numerics.trials import trial

TOGETHER = Calibration(information_each=0.1)  # samples err as on real streets
APART = Calibration(information_each=1.6)  # or each for itself


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
        weight = float(np.exp(rng.uniform(0.0, 3.0)))
        noise = 1.0 / np.sqrt(weight)
        on, off = (half_way(mean + noise * rng.normal(), weight) for mean in (1.0, 0.0))
        one = trial(rng, 10, 10.0)
        trials.append(replace(one, weight=weight, samples=99, fit=on, stranger_fit=off))
    for errs in (TOGETHER, APART):
        parted(Calibration(off_map=_log_odds(trials, errs)))


def parted(learnt):
    """At what the odds of the two Gaussians are, for short windows and long ones."""
    for weight, sure in ((1.0, 0.25), (18.0, 0.02)):
        assert off_map_probability(learnt, half_way(1.0, weight), weight) < sure
        # Log odds of the two Gaussians at their middle are even, but for the prior.
        middle = off_map_probability(learnt, half_way(0.5, weight), weight)
        assert middle == pytest.approx(OFF_MAP_PRIOR, abs=0.02)
    off = off_map_probability(learnt, half_way(0.0, 18.0), 18.0)
    evidence = off / (1.0 - off) * (1.0 - OFF_MAP_PRIOR) / OFF_MAP_PRIOR
    assert evidence > 57.0  # with a prior of one in twenty: off the map at three to one


def half_way(per_reading, weight):
    """A fit of so many readings whose levels are half as probable on any road, by the logarithm."""
    score, elsewhere = weight * per_reading, 0.5 * weight
    return Fit(per_reading, 0.0, score=score, elsewhere=elsewhere, factor=score - elsewhere)


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
    learnt = Calibration(off_map=_log_odds(trials_with_offsets(3, measured=True), TOGETHER))
    usual, unusual, strange = (
        off_map_probability(learnt, Fit(0.8, offset_db), 5.0) for offset_db in (0.3, 6.0, 15.0)
    )
    assert usual < unusual < 0.5
    assert strange > 5.0 * usual
    assert off_map_probability(learnt, Fit(0.8, -15.0), 5.0) == pytest.approx(strange)


def test_drawn_windows_tell_nothing_of_devices():
    """Of roads with one pass: the odds do not hang on the offset."""
    learnt = Calibration(off_map=_log_odds(trials_with_offsets(4, measured=False), TOGETHER))
    odds = [off_map_probability(learnt, Fit(0.4, offset_db), 5.0) for offset_db in (0.0, 15.0)]
    assert odds[0] == pytest.approx(odds[1])


def test_a_window_that_fits_any_road_is_likelier_off_the_map():
    """Where strangers fit as their levels do anywhere, and on its own road a window fits better."""
    rng = np.random.default_rng(6)
    trials = []
    for _ in range(500):
        elsewhere = float(rng.normal(10.0, 5.0))
        on, off = (
            Fit(0.8, 0.0, score=elsewhere + better + rng.normal(), elsewhere=elsewhere)
            for better in (3.0, 0.0)
        )
        one = trial(rng, 10, 10.0)
        trials.append(replace(one, weight=5.0, samples=99, fit=on, stranger_fit=off))
    learnt = Calibration(off_map=_log_odds(trials, TOGETHER))
    fits = [Fit(0.8, 0.0, score=10.0, elsewhere=each) for each in (7.0, 8.5, 10.0)]
    low, middle, high = (off_map_probability(learnt, fit, 5.0) for fit in fits)
    assert low < 0.2 * middle < 0.04 * high


def test_where_samples_err_apart_a_bayes_factor_decides():
    """Classes that any term parts teach its slope, 1 by theory, and beside it the fit's alone."""
    rng = np.random.default_rng(7)
    trials = []
    for _ in range(300):
        elsewhere, size = float(rng.normal(20.0, 5.0)), float(np.exp(rng.uniform(0.0, 2.0)))
        good, bad = 30.0 + 3.0 * rng.normal(), -90.0 + 30.0 * rng.normal()
        on, off = (
            Fit(per_reading, offset_db, score=elsewhere + by, elsewhere=elsewhere, factor=by)
            for per_reading, offset_db, by in ((1.0, 0.1, good), (-9.0, 5.0, bad))
        )
        one = trial(rng, 10, 10.0)
        trials.append(replace(one, weight=size, samples=99, fit=on, stranger_fit=off))
    constant, per_reading, *others, factor = _log_odds(trials, APART)
    assert constant != 0.0
    assert per_reading > 0.0
    assert others == [0.0] * 5
    assert factor == pytest.approx(1.0, abs=0.2)


def test_few_windows_that_err_together_decide_nothing():
    """They come from a road or two; where each sample errs for itself they are many samples."""
    trials = trials_with_offsets(3, measured=True)
    enough, few = trials[:ENOUGH_TO_PART], trials[: ENOUGH_TO_PART - 1]
    assert log_odds_of(few, TOGETHER) == OF_REAL_STREETS
    for told, learnt in ((enough, TOGETHER), (few, APART)):
        assert log_odds_of(told, learnt) == _log_odds(told, learnt) != OF_REAL_STREETS


def test_another_device_is_paid_for_by_its_prior():
    """By the book: what the score of the same window would be, its levels shifted."""
    index, held = index_of(cells=6), 0
    for window, _ in windows(city_of(cells=6), 10, length_m=30.0):
        query = ask(index, window)
        prior = query.prior(index)
        louder = Window(window.cells, window.distance_m, window.rsrp_dbm + 9.0)
        places = fine_places(index, query, shortlist(index, query))
        best = int(places.score.argmax())
        fit = fit_of_place(index, query, places, best)
        there = fit.heard_by(fit.offset_db + 9.0, prior)
        assert there.heard_by(fit.offset_db, prior).score == pytest.approx(fit.score)
        assert there.per_reading == fit.per_reading
        same = fit_at(index, louder, places, best)
        if fit.apart < 0.05 and same.apart < 0.05:  # else cells may have changed, each for itself
            assert there.score == pytest.approx(same.score, abs=0.2)
            held += 1
    assert held >= 1


def fit_at(index, window, places, best):
    """Of another window, at a place of the grid."""
    query = ask(index, window)
    others = fine_places(index, query, shortlist(index, query))
    here = (others.road == places.road[best]) & (others.sign == places.sign[best])
    away_m = np.abs(others.chainage_m - places.chainage_m[best])
    return fit_of_place(index, query, others, int(np.where(here, away_m, np.inf).argmin()))


def test_a_fit_that_needs_changed_cells_pays_their_prior():
    """As probable as the same fit without them once the prior odds of changed cells are paid."""
    odds = []
    for apart in (0.0, 0.5, 1.0):
        off = off_map_probability(Calibration(), Fit(0.6, 0.0, apart), 5.0)
        odds.append(np.log(off / (1.0 - off)))
    paid = np.log((1.0 - APART_SHARE) / APART_SHARE)
    np.testing.assert_allclose(odds - odds[0], [0.0, 0.5 * paid, paid], atol=1e-9)


def test_maps_of_before_answer_as_before():
    """Four or five coefficients, as stored by older versions: what came later has no say."""
    for known in ((1.2, 2.3, 0.4, 1.6), (1.2, 2.3, 0.4, 1.6, -0.3)):
        older = Calibration(off_map=known)
        for fit in (Fit(0.5, 0.0), Fit(0.5, 9.0, score=20.0, elsewhere=-3.0)):
            terms = off_map_terms(fit, 4.0)[: len(known)]
            off = off_map_probability(older, fit, 4.0)
            assert off == pytest.approx(1.0 / (1.0 + np.exp(np.dot(known, terms))))


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
