"""Laws of the simulated city: a true truth, independent streams, named presets."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from app.domain import Direction
from app.evaluation.scenario import PRESETS, Scenario, build_city, drive, preset, survey, windows
from app.evaluation.scenario.drives import survey_chainage_m
from app.numerics.geodesy import distance_m
from app.numerics.lines import length_m, project

SEED = 20240304


@pytest.fixture(scope="module")
def paper():
    return build_city(preset("paper"), SEED)


def digest(city) -> str:
    """Fingerprint of everything a user sees of a city, at a millionth of a dB."""
    parts = [np.round(truth.drive_dbm, 6) + 0.0 for truth in city.roads]
    parts += [np.nan_to_num(each.rsrp_dbm, nan=1.0) for each in survey(city)]
    parts += [np.nan_to_num(each.window.rsrp_dbm, nan=1.0) for each in windows(city, 20)]
    return hashlib.sha256(b"".join(part.astype("<f8").tobytes() for part in parts)).hexdigest()


def test_the_papers_area_is_as_the_paper_says(paper):
    """600 m x 600 m, four roads about a high-rise, 1 macro and 5 small cells, 1 m, 30 km/h."""
    x_m = [site.x_m for site in paper.layout.sites] + [node[0] for node in paper.layout.nodes]
    assert min(x_m) >= 0
    assert max(x_m) <= 600
    assert [site.macro for site in paper.layout.sites] == [True] + 5 * [False]
    assert len(paper.roads) == 4
    assert len(paper.layout.buildings) == 1
    trace = survey(paper)[0]
    step_m = distance_m(trace.lon[:-1], trace.lat[:-1], trace.lon[1:], trace.lat[1:])
    np.testing.assert_allclose(step_m, 1.0, rtol=1e-4)
    np.testing.assert_allclose(np.diff(trace.time_s), 3.6 / 30.0)


def test_no_two_drives_report_at_the_same_places():
    """Passes of a survey and drives begin anywhere within a sample's distance of the road's end."""
    city = build_city(preset("harsh"), SEED)
    truth, spacing_m = city.roads[0], city.scenario.spacing_m
    starts = [survey_chainage_m(city, truth, number)[0] for number in (0, 2)]
    for number in range(20):
        there = drive(city, truth.road_id, Direction.FORWARD, number)
        starts.append(float(project(truth.line, there.lon, there.lat).chainage_m[0]))
    assert 0.0 <= min(starts) < 0.2 * spacing_m
    assert 0.8 * spacing_m < max(starts) < spacing_m
    assert np.diff(np.sort(starts)).min() > 1e-4
    back = survey_chainage_m(city, truth, 1)
    np.testing.assert_allclose(np.diff(back), -spacing_m)
    assert truth.length_m - spacing_m < back[0] <= truth.length_m


def test_same_seed_same_numbers(paper):
    """A city's fingerprint is pinned: a change of it changes every published figure."""
    assert digest(build_city(preset("paper"), SEED)) == digest(paper)
    assert digest(build_city(preset("paper"), SEED + 1)) != digest(paper)
    assert digest(paper) == "1f0d0b71adec5fbb4e7e03947e5a6433aed067bb1af6f5bee106c9f1f30e059e"


def test_more_cells_shift_nothing(paper):
    """With K cells the first K of six have the very same means."""
    for cells in range(1, 6):
        fewer = build_city(replace(preset("paper"), cells=cells), SEED)
        for truth, whole in zip(fewer.roads, paper.roads, strict=True):
            np.testing.assert_array_equal(truth.survey_dbm, whole.survey_dbm[:, :cells])


def test_more_windows_or_passes_shift_nothing(paper):
    """Window and pass i do not depend on how many there are."""
    few, many = windows(paper, 3), windows(paper, 10)
    for one, other in zip(few, many, strict=False):
        assert one.truth == other.truth
        np.testing.assert_array_equal(one.window.rsrp_dbm, other.window.rsrp_dbm)
    twice = survey(build_city(replace(preset("paper"), survey_passes=2), SEED))
    np.testing.assert_array_equal(survey(paper)[1].rsrp_dbm, twice[2].rsrp_dbm)


def test_truth_lies_where_it_says(paper):
    """A window's truth projects on its road at its own chainage, and its window fits the road."""
    for window, truth in windows(paper, 200):
        line = paper.by_id[truth.road_id].line
        foot = project(line, np.array([truth.lon]), np.array([truth.lat]))
        assert foot.chainage_m[0] == pytest.approx(truth.chainage_m, abs=1e-3)
        assert abs(foot.offset_m[0]) < 1e-3
        span_m = window.distance_m[-1] - window.distance_m[0]
        start_m = truth.chainage_m - truth.direction.sign * span_m
        assert min(start_m, truth.chainage_m) >= -1e-6
        assert max(start_m, truth.chainage_m) <= length_m(line) + 1e-6


def test_windows_are_the_truth_when_nothing_disturbs():
    """Without noise, steps or impairments a window reads the true mean at every sample."""
    city = build_city(replace(preset("clean"), sensitivity_dbm=-200.0), SEED)
    for window, truth in windows(city, 50):
        back_m = window.distance_m[-1] - window.distance_m
        chainage_m = truth.chainage_m - truth.direction.sign * back_m
        mean_dbm = city.by_id[truth.road_id].mean_dbm(chainage_m)
        np.testing.assert_allclose(window.rsrp_dbm, np.clip(mean_dbm, -140, -44), atol=1e-9)


def test_windows_end_anywhere_and_both_ways(paper):
    """Ends spread evenly over the roads, directions are even, lengths as asked."""
    many = windows(paper, 2000, length_m=30.0)
    ends_m = np.array([truth.chainage_m for _, truth in many])
    forward = np.mean([truth.direction is Direction.FORWARD for _, truth in many])
    assert forward == pytest.approx(0.5, abs=0.04)
    counts, _ = np.histogram(ends_m, bins=4, range=(0, 400))
    inner, outer = (
        1000 * 2 * 100 / 370,
        1000 * (100 + 70) / 370,
    )  # no window ends 30 m from its start
    np.testing.assert_allclose(counts, [outer, inner, inner, outer], atol=60)
    assert {len(window.distance_m) for window, _ in many} == {31}


def test_each_impairment_is_as_large_as_it_says():
    """Noise, device offset, odometer scale, drift and survey positions have the chosen spread."""
    quiet = replace(preset("clean"), sensitivity_dbm=-200.0, shadowing_nlos_db=1.0)
    base = build_city(quiet, SEED)
    noisy = replace(quiet, noise_db=3.0)
    noise_db = survey(build_city(noisy, SEED))[0].rsrp_dbm - survey(base)[0].rsrp_dbm
    assert np.std(noise_db) == pytest.approx(3.0, rel=0.06)

    uneven = build_city(replace(quiet, device_offset_sd_db=4.0, odometer_error_sd=0.03), SEED)
    pairs = list(zip(windows(uneven, 600), windows(base, 600), strict=True))
    offsets_db = [np.median(one.window.rsrp_dbm - two.window.rsrp_dbm) for one, two in pairs]
    assert np.std(offsets_db) == pytest.approx(4.0, rel=0.1)
    scales = [one.window.distance_m[-1] / two.window.distance_m[-1] for one, two in pairs]
    assert np.std(scales) == pytest.approx(0.03, rel=0.1)

    drifts_db = [
        truth.drive_dbm - truth.survey_dbm
        for seed in range(40)
        for truth in build_city(replace(quiet, drift_db=2.0), seed).roads
    ]
    assert np.std(np.concatenate(drifts_db)) == pytest.approx(2.0, rel=0.1)

    shaken = survey(build_city(replace(quiet, survey_position_noise_m=3.0), SEED))[0]
    still = survey(base)[0]
    away_m = distance_m(shaken.lon, shaken.lat, still.lon, still.lat)
    assert np.sqrt(np.mean(away_m**2) / 2) == pytest.approx(3.0, rel=0.1)


def test_readings_are_reported_as_receivers_do(paper):
    """Whole decibels within the LTE range, nothing below the sensitivity."""
    for trace in survey(paper):
        heard = trace.rsrp_dbm[np.isfinite(trace.rsrp_dbm)]
        np.testing.assert_array_equal(heard, np.round(heard))
        assert heard.min() >= paper.scenario.sensitivity_dbm
        assert heard.max() <= -44.0


def test_survey_passes_alternate_and_drives_go_where_told(paper):
    """Every second pass runs against the line; a drive runs in the direction asked for."""
    city = build_city(replace(preset("paper"), survey_passes=2), SEED)
    there, back = survey(city)[:2]
    line = city.roads[0].line
    assert np.all(np.diff(project(line, there.lon, there.lat).chainage_m) > 0)
    assert np.all(np.diff(project(line, back.lon, back.lat).chainage_m) < 0)
    against = drive(city, "road-east", Direction.BACKWARD)
    assert np.all(np.diff(project(city.roads[1].line, against.lon, against.lat).chainage_m) < 0)


def test_harsh_samples_once_a_second():
    """1 Hz at 30 km/h: 8.33 m between samples, ten seconds are eleven samples."""
    city = build_city(preset("harsh"), SEED)
    window, _ = windows(city, 1, duration_s=10.0)[0]
    assert len(window.distance_m) == 11
    assert len(survey(city)) == 12


def test_city_is_a_grid_of_any_number_of_roads():
    """Roads and cells have names of their own, and each road hears 6 to 12 of hundreds of cells."""
    city = build_city(replace(preset("city"), roads=120, cells=200), SEED)
    assert len({truth.road_id for truth in city.roads}) == 120
    assert len({site.cell for site in city.layout.sites}) == 200
    assert all(6 <= len(truth.cells) <= 12 for truth in city.roads)
    assert len({len(truth.cells) for truth in city.roads}) > 3


def test_presets_are_those_of_the_documentation():
    """Names are what users type; an unknown one is refused with the list."""
    assert list(PRESETS) == ["clean", "paper", "harsh", "city"]
    with pytest.raises(ValueError, match="clean, paper, harsh, city"):
        preset("mild")


@pytest.mark.parametrize(
    "wrong", [{"cells": 0}, {"cells": 7}, {"roads": 5}, {"speed_mps": 0.0}, {"survey_passes": 0}]
)
def test_impossible_scenarios_are_refused(wrong):
    """A city that cannot be built is refused when it is described, with the number."""
    with pytest.raises(ValueError, match=str(next(iter(wrong.values())))):
        Scenario(**wrong)


def test_windows_that_fit_no_road_are_refused(paper):
    """Longer than every road, or too short for two samples."""
    with pytest.raises(ValueError, match=r"500\.0 m"):
        windows(paper, 1, length_m=500.0)
    with pytest.raises(ValueError, match="1 sample"):
        windows(paper, 1, length_m=0.5)
