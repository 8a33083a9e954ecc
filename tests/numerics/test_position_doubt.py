"""What is left of the scatter of surveyed fixes: in truths of held-out windows, and in maps."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.domain import RadioMap, RoadModel
from app.evaluation.scenario import City, build_city, preset, survey, windows
from app.numerics.calibration import calibrate
from app.numerics.evidence_table import unpack
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.roadfit import fit_road
from tests.numerics.cities import error_m, models_of

SCATTER_M = 3.0


@cache
def scattered(passes: int) -> tuple[City, tuple[RoadModel, ...]]:
    """The paper's area with four cells, its surveyed positions off by 3 m."""
    scenario = replace(
        preset("paper"), cells=4, survey_position_noise_m=SCATTER_M, survey_passes=passes
    )
    city = build_city(scenario, 5)
    driven = survey(city)
    models = [
        fit_road(truth.road, [one for one in driven if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    return city, tuple(models)


def doubts_m(passes: int) -> np.ndarray:
    return np.array(
        [one.doubt_m for model in scattered(passes)[1] for one in unpack(model.evidence)]
    )


def test_truths_of_older_tables_have_no_doubt():
    """They lack the last column; all else is read as it was."""
    table = models_of("harsh")[0].evidence
    windows_now, windows_before = unpack(table), unpack(table[:, :-1])
    assert len(windows_now) == len(windows_before) > 20
    for now, before in zip(windows_now, windows_before, strict=True):
        assert now.doubt_m > 0.0
        assert before.doubt_m == 0.0
        assert (before.chainage_m, before.sign, before.fold) == (now.chainage_m, now.sign, now.fold)
        np.testing.assert_array_equal(before.rsrp_dbm, now.rsrp_dbm)


def test_a_map_of_one_pass_errs_as_the_pass_does():
    """By a tenth of the scatter here, where the speed is steady and there is a fix a metre."""
    known = doubts_m(1)
    assert 0.05 * SCATTER_M < known.mean() < 0.2 * SCATTER_M
    told = calibrate(scattered(1)[1])
    assert told.position_sd_m == pytest.approx(np.sqrt((known**2).mean()), rel=1e-3)
    assert calibrate(models_of()).position_sd_m == 0.0


def test_passes_that_err_each_for_itself_make_a_better_map():
    """Three of them: their mean errs less than one, and no less than what is left of it."""
    least_m = np.sqrt((doubts_m(3) ** 2).mean() / 3.0)
    assert calibrate(scattered(3)[1]).position_sd_m >= 0.999 * least_m


@pytest.mark.parametrize("passes", [1, 3])
def test_radii_hold_where_fixes_scattered(passes):
    """Of 400 windows with true positions."""
    city, models = scattered(passes)
    index = MapIndex.build(RadioMap(1, models, calibrate(models)))
    held = []
    for window, truth in windows(city, 400, length_m=30.0):
        fix = locate(index, window)
        held.append(error_m(fix, truth) <= fix.accuracy_m)
    assert 0.6 < np.mean(held) < 0.85
