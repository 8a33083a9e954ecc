"""Scores against answers made by hand."""

from __future__ import annotations

import math

import pytest

from app.commands.scores import Answer, Scores, scores_table
from app.domain import Direction
from app.evaluation.truth import Truth
from app.numerics.geodesy import metres_per_degree

TRUTH = Truth("r1", 100.0, Direction.FORWARD, 11.5, 48.1)
NORTH_DEG = 1.0 / float(metres_per_degree(48.1).y_m)


def fix(metres_north=0.0, *, road="r1", direction="forward", status="located"):
    place = {"lon": 11.5, "lat": 48.1 + metres_north * NORTH_DEG, "direction": direction}
    found = status == "located"
    return {
        "status": status,
        "road": {"id": road} if found else None,
        "position": place if found else None,
        "candidates": [place | {"road_id": road}],
    }


def test_an_answer_is_compared_with_its_truth():
    """Distance in metres, road and direction by name, time from the header."""
    answer = Answer.of(fix(3.0, road="r2"), TRUTH, 1.5, "match;dur=0.25")
    assert answer.error_m == pytest.approx(3.0, abs=1e-3)
    assert (answer.road_right, answer.direction_right, answer.located) == (False, True, True)
    assert answer.match_ms == 0.25


def test_giving_up_is_not_rewarded():
    """An off-map answer counts with its best candidate's error, and as wrong."""
    answer = Answer.of(fix(40.0, status="off_map"), TRUTH, 1.0, "")
    assert answer.error_m == pytest.approx(40.0, abs=1e-2)
    assert not answer.road_right
    assert not answer.direction_right
    assert math.isnan(answer.match_ms)


def test_scores_of_a_run():
    """Mean, median and rates over all answers."""
    fixes = [fix(1.0), fix(2.0), fix(3.0, direction="backward"), fix(10.0, road="r2")]
    scores = Scores.of([Answer.of(each, TRUTH, 1.0, "match;dur=1") for each in fixes])
    assert scores.mean_error_m == pytest.approx(4.0, abs=1e-3)
    assert scores.median_error_m == pytest.approx(2.5, abs=1e-3)
    assert (scores.road_right, scores.direction_right, scores.located) == (0.75, 0.75, 1.0)


def test_the_table_says_every_figure():
    """One row a figure."""
    table = scores_table([Answer.of(fix(1.0), TRUTH, 1.0, "match;dur=1")])
    assert table.row_count == 8
