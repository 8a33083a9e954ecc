"""The least error with a survey: exact on small cases, calibrated, between what it must be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.bound import MEAN_ABSOLUTE, least_sd_m
from app.evaluation.scenario import build_city, preset, windows
from app.evaluation.survey_bound import ANY, Odometers, best_answers, on_map_log
from app.evaluation.survey_bound.curves import Curve, field_covariance_db2
from app.evaluation.survey_bound.places import Terms, law_at
from app.evaluation.survey_bound.roads import (
    reading_variance_db2,
    surveyed_curves,
    unsurveyed_curves,
)
from app.numerics.geodesy import distance_m
from app.numerics.reliability import auroc

SEED = 4
ALL_HEARD_DBM = -200.0
HARSH = replace(preset("harsh"), cells=4, sensitivity_dbm=ALL_HEARD_DBM)


def log_normal(values, mean, covariance):
    """Density of a Gaussian, by the book."""
    away = values - mean
    squared = away @ np.linalg.solve(covariance, away)
    return -0.5 * (squared + np.linalg.slogdet(2.0 * np.pi * covariance)[1])


def asked(city, count):
    if city.scenario.sample_interval_s is None:
        return windows(city, count, length_m=30.0)
    return windows(city, count, length_m=None, duration_s=10.0)


def errors_m(city, count, step_m):
    found = asked(city, count)
    answers = best_answers(city, [one.window for one in found], step_m=step_m)
    return np.array(
        [
            float(distance_m(answer.lon, answer.lat, one.truth.lon, one.truth.lat))
            for answer, one in zip(answers, found, strict=True)
        ]
    )


def small(rng, cells=2):
    """A road of 8 nodes, a survey of seven readings a cell, and the joint law by brute force."""
    nodes, step_m, noise_db2 = 8, 2.0, 1.5
    surveyed_m = np.array([0.0, 1.0, 3.5, 6.0, 6.0, 9.0, 13.0])
    spread_db, median_dbm = rng.uniform(2.0, 6.0, nodes), rng.normal(-90.0, 5.0, (nodes, cells))
    prior_db2 = field_covariance_db2(spread_db, step_m, 12.0)
    curves = [Curve(step_m, median_dbm[:, cell], prior_db2) for cell in range(cells)]
    readings_dbm = rng.normal(-90.0, 6.0, (len(surveyed_m), cells))
    known = [
        curve.given(surveyed_m, readings_dbm[:, cell], noise_db2)
        for cell, curve in enumerate(curves)
    ]
    return curves, known, surveyed_m, readings_dbm, noise_db2


def by_brute_force(case, at_m, window_dbm, offset_db2):
    """``log p(window, survey) - log p(survey)``, offset and all, as one large Gaussian."""
    curves, _, surveyed_m, readings_dbm, noise_db2 = case
    every_m = np.concatenate([surveyed_m, at_m])
    grid_m = np.arange(len(curves[0].mean_dbm)) * curves[0].step_m
    hat = np.array([np.interp(every_m, grid_m, row) for row in np.eye(len(grid_m))]).T
    means, blocks, values = [], [], []
    for cell, curve in enumerate(curves):
        means.append(hat @ curve.mean_dbm)
        blocks.append(hat @ curve.covariance_db2 @ hat.T + noise_db2 * np.eye(len(every_m)))
        values.append(np.concatenate([readings_dbm[:, cell], window_dbm[:, cell]]))
    size = len(every_m)
    whole = np.zeros((size * len(curves), size * len(curves)))
    for cell, block in enumerate(blocks):
        whole[cell * size : (cell + 1) * size, cell * size : (cell + 1) * size] = block
    late = np.tile(np.arange(size) >= len(surveyed_m), len(curves))
    whole += offset_db2 * np.outer(late, late)
    mean, value = np.concatenate(means), np.concatenate(values)
    there = np.isfinite(value)
    early = ~late
    joint = log_normal(value[there], mean[there], whole[np.ix_(there, there)])
    return joint - log_normal(value[early], mean[early], whole[np.ix_(early, early)])


@pytest.mark.parametrize("offset_db2", [0.0, 16.0])
@pytest.mark.parametrize("missing", ["none", "some", "a cell"])
def test_densities_are_those_of_one_large_gaussian(offset_db2, missing):
    """Survey, window, offset and cells not heard: all at once gives what the steps give."""
    rng = np.random.default_rng(SEED)
    case = small(rng)
    at_m = np.array([[0.0, 2.5, 5.0], [1.25, 3.75, 6.25], [8.0, 10.5, 13.0]])
    window_dbm = rng.normal(-88.0, 6.0, (2, 3, 2))
    if missing == "some":
        window_dbm[0, 1, 0] = window_dbm[1, 0, 1] = window_dbm[1, 2, 1] = np.nan
    if missing == "a cell":
        window_dbm[0, :, 1] = np.nan
    terms = Terms.none(len(at_m), len(window_dbm))
    for cell, curve in enumerate(case[1]):
        terms.add(law_at(curve, case[4], at_m), window_dbm[:, :, cell])
    for number, window in enumerate(window_dbm):
        ours = terms.log_density(offset_db2)[:, number]
        theirs = np.array([by_brute_force(case, at, window, offset_db2) for at in at_m])
        np.testing.assert_allclose(ours - ours[0], theirs - theirs[0], atol=1e-8)


def test_the_best_rule_tells_strangers():
    """Of four cells nearly all of them; without its own road no window is likelier to be on it."""
    city = build_city(HARSH, SEED)
    found = asked(city, 60)
    here, without = on_map_log(
        city, [one.window for one in found], [one.truth.road_id for one in found]
    )
    assert auroc(-without, -here) > 0.98
    assert np.median(here) > 5.0 > -5.0 > np.median(without)
    longest = max(truth.length_m for truth in city.roads)
    whole = sum(truth.length_m for truth in city.roads)
    assert np.all(without <= here + np.log(whole / (whole - longest)) + 1e-9)


def test_a_road_that_nobody_drove_is_any_road():
    """What the survey says of a place comes from its readings alone, drift or no drift."""
    city = build_city(replace(HARSH, cells=2), SEED)
    for truth in city.roads:
        surveyed, bare = surveyed_curves(city, truth), unsurveyed_curves(city, truth)
        for cell, (known, any_) in enumerate(zip(surveyed, bare, strict=True)):
            doubt, before = np.diag(known.covariance_db2), np.diag(any_.covariance_db2)
            assert np.all(doubt <= before + 1e-6)
            assert doubt.mean() < 0.5 * before.mean()
            drift_db2 = np.full(len(before), city.scenario.drift_db**2)
            np.testing.assert_allclose(
                before - drift_db2, truth.shadowing_db[:, cell] ** 2, rtol=1e-6
            )
        np.testing.assert_array_equal(bare[1].mean_dbm, truth.median_dbm[:, 1])


def test_drift_widens_what_the_survey_left_open():
    """The covariance when driving is that on the survey's day and the drift's."""
    still, drifting = (
        build_city(replace(HARSH, cells=1, drift_db=drift_db), SEED) for drift_db in (0.0, 2.0)
    )
    before, after = (surveyed_curves(city, city.roads[0])[0] for city in (still, drifting))
    at_m = np.array([[100.0, 150.0]])
    added = (after.covariance_at_db2(at_m) - before.covariance_at_db2(at_m))[0]
    wanted = 4.0 * np.array([[1.0, np.exp(-0.5)], [np.exp(-0.5), 1.0]])
    np.testing.assert_allclose(added, wanted, rtol=1e-3)  # linear between nodes, 0.25 m apart


def least_m(city, found):
    """The Cramer-Rao bound's mean absolute error for each window."""
    behind_m = np.arange(31)[::-1]
    return np.array(
        [
            MEAN_ABSOLUTE
            * least_sd_m(
                city.by_id[truth.road_id],
                truth.chainage_m - truth.direction.sign * behind_m,
                city.scenario,
            )
            for _, truth in found
        ]
    )


def test_known_curves_leave_the_cramer_rao_bound():
    """Without shadowing the plan alone tells the curves, and nothing is lost to the survey."""
    quiet = replace(preset("paper"), cells=3, noise_db=0.2, quantisation_db=0.0)
    smooth = replace(quiet, shadowing_los_db=1e-6, shadowing_nlos_db=1e-6)
    city = build_city(replace(smooth, sensitivity_dbm=ALL_HEARD_DBM), SEED)
    least = least_m(city, asked(city, 200))
    found_m = errors_m(city, 200, 0.25)
    # A place may lie near an end of its road, which is known and bounds the error; else the same.
    assert 0.8 < np.mean(np.minimum(found_m, 3.0)) / np.mean(np.minimum(least, 3.0)) < 1.1


def test_more_passes_lead_down_towards_the_cramer_rao_bound():
    """Each pass lowers the least error; the bound with known curves lies below all."""
    base = replace(preset("paper"), cells=2)
    cities = [build_city(replace(base, survey_passes=passes), SEED) for passes in (1, 4)]
    few_m, many_m = (float(errors_m(city, 80, 0.25).mean()) for city in cities)
    assert few_m > 1.2 * many_m > 1.2 * least_m(cities[0], asked(cities[0], 80)).mean()


def test_the_interval_holds_the_truth_as_often_as_it_says():
    """
    Of 360 windows of six cities 68 % +- 4 %; the mean error is near the expected one.

    Without drift, which all windows of a city share: six cities would be six draws.
    """
    held, right, expected_m, error_m = [], [], [], []
    for seed in range(6, 12):
        city = build_city(replace(HARSH, drift_db=0.0), seed)
        found = asked(city, 60)
        for answer, one in zip(
            best_answers(city, [each.window for each in found], step_m=0.5), found, strict=True
        ):
            ((low_m, high_m),) = answer.intervals_m
            held.append(low_m <= one.truth.chainage_m <= high_m)
            right.append(answer.road_id == one.truth.road_id)
            expected_m.append(answer.expected_error_m)
            place = (answer.lon, answer.lat, one.truth.lon, one.truth.lat)
            error_m.append(float(distance_m(*place)))
    assert np.mean(right) > 0.99
    assert np.mean(held) == pytest.approx(0.68, abs=0.04)
    assert np.median(error_m) < np.mean(error_m) == pytest.approx(np.mean(expected_m), rel=0.25)


def test_a_cell_never_heard_moves_nothing():
    """A window's cells may come in any order, and lack those that were not heard."""
    city = build_city(replace(HARSH, cells=2), SEED)
    window = asked(city, 1)[0].window
    turned = replace(window, cells=window.cells[::-1], rsrp_dbm=window.rsrp_dbm[:, ::-1])
    silent = np.column_stack([window.rsrp_dbm[:, 0], np.full(len(window.rsrp_dbm), np.nan)])
    alone = replace(window, cells=window.cells[:1], rsrp_dbm=window.rsrp_dbm[:, :1])
    one, two = best_answers(city, [window, turned], step_m=1.0)
    three, four = best_answers(city, [replace(window, rsrp_dbm=silent), alone], step_m=1.0)
    assert one == two
    assert three == four != one


def test_what_the_law_does_not_cover_is_refused():
    """Windows of several lengths; roads that hear different cells."""
    city = build_city(replace(HARSH, cells=2), SEED)
    short = windows(city, 1, length_m=None, duration_s=5.0)[0].window
    with pytest.raises(ValueError, match="6 to 11 samples"):
        best_answers(city, [short, asked(city, 1)[0].window])
    grid = build_city(replace(preset("city"), roads=12, cells=20), SEED)
    with pytest.raises(ValueError, match="different cells"):
        best_answers(grid, [each.window for each in windows(grid, 1)])
    assert best_answers(city, []) == []


def test_readings_have_noise_and_rounding():
    """A step of q dB counts as variance q^2 / 12."""
    assert reading_variance_db2(preset("paper")) == pytest.approx(4.0 + 1.0 / 12.0)


def test_odometers_are_of_their_kinds():
    """All factors together are as probable as the scale that an odometer has, whatever it says."""
    ((factor, log_density),) = Odometers.alike(0.0).factors(np.ones(2))
    assert factor == 1.0
    assert log_density.tolist() == [0.0, 0.0]
    found = list(ANY.factors(np.array([1.0, 1.05])))
    values = np.array([factor for factor, _ in found])
    density = np.exp([log for _, log in found]).T
    apart = values[1] - values[0]
    assert (density.sum(axis=1) * apart) == pytest.approx([1.0, 1.0], rel=0.06)
    exact = dict(ANY.kinds)[0.0]
    assert density[0, np.abs(values - 1.0).argmin()] * apart > exact
    assert values[density[1].argmax()] == pytest.approx(1.05, abs=apart)


def test_who_is_not_told_of_odometers_expects_to_err_more():
    """The same windows, whose odometers are exact."""
    city = build_city(replace(preset("paper"), sample_interval_m=2.0), 5)
    found = [one.window for one in windows(city, 20, length_m=20.0)]
    told, untold = (
        best_answers(city, found, step_m=0.5, odometers=odometers) for odometers in (None, ANY)
    )
    expected_m = [np.mean([one.expected_error_m for one in answers]) for answers in (told, untold)]
    assert expected_m[1] > 1.1 * expected_m[0]
