"""An odometer that is off by a few per cent costs little, and one that is right next to nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Window
from app.evaluation.scenario import windows
from app.numerics import native
from app.numerics.answer import answer, fit_of_place
from app.numerics.chosen import choose
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.matching import finest_places, locate, place
from app.numerics.odometer import (
    farther_of,
    peak_width_m,
    stretches_about,
    under_other_factors,
)
from app.numerics.odometer_prior import (
    FEWEST_STEPS,
    Looked,
    factors_for,
    fine_factors,
    rough_factors,
)
from app.numerics.offmap import off_map_probability
from app.numerics.posterior import Places, masses, raised
from app.numerics.query import ask
from tests.numerics.cities import city_of, index_of

WINDOWS = 60
ANY = fine_factors(None, FEWEST_STEPS)


def off_by(window: Window, factor: float, error: float | None = None) -> Window:
    """The window as a vehicle tells it whose odometer counts so much too far."""
    return replace(window, distance_m=window.distance_m * factor, distance_error=error)


def straight_of(index, query):
    """Places along roads with the window taken at its word."""
    return finest_places(index, query, choose(index, query)[0])


def errors_m(factor: float, error: float | None = None) -> np.ndarray:
    """Of windows of 30 m ending anywhere, with six cells; the error, and the 95 % radius."""
    index, out = index_of(), []
    for window, truth in windows(city_of(), WINDOWS, length_m=30.0):
        fix = locate(index, off_by(window, factor, error), confidence=0.95)
        assert fix.road_id == truth.road_id
        out.append((abs(fix.chainage_m - truth.chainage_m), fix.accuracy_m))
    return np.array(out).T


def looked_of(index, query) -> Looked | None:
    """The factors that are worth a look."""
    straight = straight_of(index, query)
    width_m = peak_width_m(straight, query.temperature(index.calibration))
    return factors_for(query.distance_error, query.length_m, width_m)


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_a_wrong_odometer_is_seen_through(factor):
    """3 % too far or too short: a third less error than at its word, and radii that hold."""
    error_m, radius_m = errors_m(factor)
    assert np.mean(error_m <= radius_m) >= 0.85
    without_m, narrow_m = errors_m(factor, 0.0)
    assert error_m.mean() < 2.0 / 3.0 * without_m.mean()
    assert np.mean(without_m <= narrow_m) < np.mean(error_m <= radius_m)


def test_a_right_odometer_pays_little():
    """Where nobody says that an odometer is exact it costs a fifth of the error at most."""
    assert errors_m(1.0)[0].mean() < 1.2 * errors_m(1.0, 0.0)[0].mean()


def test_what_an_odometer_is_known_for_decides():
    """
    Windows 6 % short: the farther they are said to err the better they are seen through, and the
    oftener the radius holds; an exact odometer is taken at its word, and has no other factors.
    """
    errors = (0.0, 0.01, None, 0.06)
    found = [errors_m(0.94, error) for error in errors]
    mean_m = [error_m.mean() for error_m, _ in found]
    held = [np.mean(error_m <= radius_m) for error_m, radius_m in found]
    assert mean_m == sorted(mean_m, reverse=True)
    assert held == sorted(held)
    assert held[-1] >= 0.9
    assert held[0] < 0.1
    window, _ = windows(city_of(), 1, length_m=30.0)[0]
    assert place(index_of(), ask(index_of(), off_by(window, 1.0, 0.0))).known is None


def test_the_definition_knows_factors_too():
    """With an odometer 3 % off, the fast answer stays the definition's, in C and in numpy."""
    index = index_of(cells=3)
    for window, _ in windows(city_of(cells=3), 12, length_m=40.0):
        asked = off_by(window, 1.03)
        slow = locate_exhaustively(index, asked)
        for in_c in {False, native.BUILT}:
            fast = locate(index, asked, in_c=in_c)
            assert (fast.road_id, fast.direction) == (slow.road_id, slow.direction)
            assert fast.road_posterior == pytest.approx(slow.road_posterior, abs=2e-3)
            assert fast.chainage_m == pytest.approx(slow.chainage_m, abs=0.02)
            assert fast.accuracy_m == pytest.approx(slow.accuracy_m, rel=0.05, abs=0.02)


def test_a_place_known_no_better_than_the_factor_moves_it_is_looked_at_once():
    """Windows of a few metres, and windows that fit everywhere, have no other factors."""
    index = index_of(cells=1)
    for window, _ in windows(city_of(cells=1), 10, length_m=4.0):
        query = ask(index, window)
        assert place(index, query).known is None
        assert looked_of(index, query) is None


def test_narrow_peaks_have_more_factors_than_wide_ones():
    """What one standard deviation moves the oldest sample by, against the peak's width."""
    index = index_of()
    found = set()
    for length_m in (10.0, 30.0, 100.0):
        for window, _ in windows(city_of(), 10, length_m=length_m):
            query = ask(index, window)
            looked = looked_of(index, query)
            found.add(0 if looked is None else len(looked.near.value))
    assert {2, 4} <= found
    assert max(found) > 8


def test_places_that_are_not_laid_again_stand_for_every_factor():
    """They gain what the factors' shares are together; those laid again and their order stay."""
    index, kept = index_of(cells=2), 0
    for window, _ in windows(city_of(cells=2), 10, length_m=30.0):
        query = ask(index, window)
        straight, temperature = straight_of(index, query), query.temperature(index.calibration)
        turned = straight.slice(0, 3)
        before = Places.join((straight, turned))
        others = under_other_factors(index, query, straight, before)
        if others is None:
            continue
        gained = (others.places.score[: len(before)] - before.score) / temperature
        again = np.zeros(len(before), dtype=bool)
        for road, sign, first, last in stretches_about(index, query, straight, temperature):
            beyond_m = 0.5 * index.roads[road].step_m
            along = (straight.road == road) & (straight.sign == sign)
            along &= straight.chainage_m >= first * index.roads[road].step_m - beyond_m
            along &= straight.chainage_m <= last * index.roads[road].step_m + beyond_m
            again[: len(straight)] |= along
        looked = looked_of(index, query)
        assert looked is not None
        factors = looked.near
        if set(others.known.factor) > set(factors.value):  # one side farther, too
            assert looked.farther is not None
            factors = factors.and_then(looked.farther[0])
        exact = 1.0 / (1.0 + np.exp(factors.log_prior).sum())
        assert others.together == pytest.approx(-np.log(exact))
        np.testing.assert_allclose(gained, np.where(again, 0.0, others.together), atol=1e-9)
        np.testing.assert_array_equal(others.places.where[:, : len(before)], before.where)
        assert again[straight.score.argmax()]
        kept += int(again.sum())
    assert kept > 0


def test_an_odometer_that_errs_by_far_more_is_looked_for_on_its_side():
    """
    Of windows 8 % too far or short, those whose outermost factor fits about as well as any have
    some beyond it, in C and in numpy alike; that is most of them, and few that are exact.
    """
    index, asked = index_of(), windows(city_of(), 15, length_m=40.0)
    looked = {}
    for factor in (0.92, 1.0, 1.08):
        looked[factor] = 0
        for window, _ in asked:
            found = []
            for in_c in sorted({False, native.BUILT}):
                query = ask(index, off_by(window, factor), in_c=in_c)
                straight = straight_of(index, query)
                found.append(under_other_factors(index, query, straight, straight))
            first, last = found[0], found[-1]
            assert first is not None
            assert last is not None
            np.testing.assert_array_equal(first.known, last.known)
            np.testing.assert_array_equal(first.places.where, last.places.where)
            score = [one.places.score for one in (first, last)]
            np.testing.assert_allclose(*score, rtol=1e-6, atol=1e-4)
            assert first.together == pytest.approx(last.together, abs=1e-12)
            looked[factor] += bool((np.abs(first.known.factor - 1.0) > 0.055).any())
    assert looked[0.92] >= 12
    assert looked[1.08] >= 12
    assert looked[1.0] <= 3


def test_farther_factors_lie_beyond_the_fit_of_the_outermost():
    """On the side of the better one, from a factor that is within reach of the best place."""
    best = np.array([-1.0, -9.0, -9.0, -9.0])
    assert ANY.farther is not None
    low, high = ANY.farther
    assert farther_of(ANY, best, 0.9) is low
    assert farther_of(ANY, best[::-1], 0.9) is high
    assert farther_of(ANY, best, 1.1) is None
    assert farther_of(ANY, np.array([-3.1, 0.0, -1.0, -2.1]), -5.0) is None
    assert farther_of(rough_factors(None), best[:2], -5.0) is None
    assert farther_of(fine_factors(0.03, 2), best, -5.0) is None
    assert np.all(low.value < ANY.near.value.min())
    assert np.all(high.value > ANY.near.value.max())


def test_the_true_factor_carries_the_mass():
    """Of a window whose odometer counts 3 % too far, factors under 1 hold more than those over."""
    index, below = index_of(), []
    for window, _ in windows(city_of(), 20, length_m=40.0):
        query = ask(index, off_by(window, 1.03))
        straight = straight_of(index, query)
        others = under_other_factors(index, query, straight, straight)
        assert others is not None
        mass = masses(others.places, query.temperature(index.calibration))[len(straight) :]
        assert len(mass) == len(others.known.factor)
        under = others.known.factor < 1.0
        below.append(mass[under].sum() > mass[~under].sum())
    assert np.mean(below) > 0.8


def test_multiplied_windows_keep_their_readings():
    """Distances alone change; the window itself stays as it was."""
    index = index_of()
    window, _ = windows(city_of(), 1, length_m=30.0)[0]
    query = ask(index, window)
    before_m = query.fine.behind_m.copy()
    longer = query.multiplied(1.02)
    np.testing.assert_array_equal(query.fine.behind_m, before_m)
    np.testing.assert_allclose(longer.fine.behind_m, 1.02 * before_m)
    np.testing.assert_array_equal(longer.fine.rsrp_db, query.fine.rsrp_db)
    assert longer.temperature(index.calibration) == query.temperature(index.calibration)


def test_what_is_known_of_a_factor_is_no_part_of_the_fit():
    """
    Being off the map is told from the readings of the best place alone, its distances as that
    place's factor has them.
    """
    index = index_of()
    seen = set()
    for window, _ in windows(city_of(), 20, length_m=40.0):
        query = ask(index, off_by(window, 1.03), in_c=native.BUILT)
        placed = place(index, query)
        assert placed.known is not None
        temperature = query.temperature(index.calibration)
        known, factor = np.zeros(len(placed.places)), np.ones(len(placed.places))
        known[-len(placed.known.log_prior) :] = placed.known.log_prior
        factor[-len(placed.known.factor) :] = placed.known.factor
        best = int(placed.places.score.argmax())
        stretched = query.multiplied(float(factor[best]))
        fit = fit_of_place(index, stretched, raised(placed.places, -temperature * known), best)
        told = answer(index, query, placed.places, 0.68, placed.known)
        much = query.information(index.calibration)
        expected = off_map_probability(index.calibration, fit, much)
        assert told.off_map_posterior == pytest.approx(expected, rel=1e-6)
        seen.add(bool(known[best]))
    assert seen == {False, True}


def test_a_window_is_judged_by_its_distances_as_they_fit():
    """100 m, 5 % too far: on the map as what it is, not as a road that it fits hardly anywhere."""
    index = index_of()
    for window, truth in windows(city_of(), 15, length_m=100.0):
        for factor in (0.95, 1.05):
            fix = locate(index, off_by(window, factor))
            assert fix.off_map_posterior < 0.02
            assert fix.road_id == truth.road_id
            assert abs(fix.chainage_m - truth.chainage_m) < 1.0
