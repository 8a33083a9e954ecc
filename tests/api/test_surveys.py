"""Surveys in, listed, read back and forgotten."""

from __future__ import annotations

import gzip
import json
from typing import Any

import numpy as np
import pytest

from app.api.schemas.surveys import SurveyAccepted, SurveyDocument, SurveyPage, SurveySamples
from tests.api.conftest import Service, assert_problem, survey_json
from tests.factories import line_at, trace_along

CSV = """\
rsrp_dbm,serving,cell_id,lat,lon,time_s
-110.6,1,850:293,34.0136,-118.4919,10.0
-106.9,0,850:60,34.0136,-118.4919,10.0
-109.7,1,850:293,34.0137,-118.4918,11.0
,,,34.0138,-118.4917,12.0
-110.1,1,850:293,34.0139,-118.4916,13.0
"""
COLUMNAR = {
    "cells": ["850:293", "850:60"],
    "time_s": [0.0, 1.0, 2.0, 3.0],
    "lon": [-118.4919, -118.4918, -118.4917, -118.4916],
    "lat": [34.0136, 34.0137, 34.0138, 34.0139],
    "rsrp_dbm": [[-110.6, -106.9], [-109.7, None], [None, None], [-110.1, None]],
}


def a_survey(seed: int = 1, **changed: Any) -> dict[str, Any]:
    return survey_json(trace_along(line_at(), seed=seed, road_id="street-07"), **changed)


def test_a_survey_is_accepted_with_its_build(service: Service):
    """202 names the survey, its roads and the build, which `Location` leads to."""
    answer = service.client.post("/v1/surveys", json=a_survey())
    accepted = SurveyAccepted.model_validate_json(answer.content)
    assert answer.status_code == 202
    assert accepted.roads == ["street-07"]
    assert accepted.samples == len(a_survey()["time_s"])
    assert answer.headers["location"] == f"/v1/builds/{accepted.build_id}"
    build = service.client.get(answer.headers["location"]).json()
    assert build["status"] == "accepted"


def test_a_survey_without_a_build_builds_nothing(service: Service):
    """`build=false` stores only, and `Location` leads to the survey."""
    answer = service.client.post("/v1/surveys?build=false", json=a_survey())
    assert answer.status_code == 202
    assert answer.json()["build_id"] is None
    assert answer.headers["location"] == f"/v1/surveys/{answer.json()['survey_id']}"
    assert service.client.get("/v1/builds").json()["builds"] == []


def test_samples_come_back_as_they_were_posted(service: Service):
    """The samples can be posted as they are read, and are then the same survey."""
    posted = service.client.post("/v1/surveys", json=a_survey(reference_cell="850:60")).json()
    survey_id = posted["survey_id"]
    samples = service.client.get(f"/v1/surveys/{survey_id}/samples").json()
    SurveySamples.model_validate(samples)
    again = service.client.post("/v1/surveys", json=samples)
    assert_problem(again, 409, "duplicate-survey")
    assert again.headers["location"] == f"/v1/surveys/{survey_id}"


def test_the_summary_of_a_survey(service: Service):
    """A survey's document says what came in, and the list holds the same documents."""
    survey_id = service.client.post("/v1/surveys", json=a_survey()).json()["survey_id"]
    answer = service.client.get(f"/v1/surveys/{survey_id}")
    document = SurveyDocument.model_validate_json(answer.content)
    assert document.device == "pixel4a"
    assert document.samples == len(a_survey()["time_s"])
    page = service.client.get("/v1/surveys", params={"road_id": "street-07"})
    SurveyPage.model_validate_json(page.content)
    assert page.json()["surveys"] == [answer.json()]


def test_pages_of_surveys_follow_one_another(service: Service):
    """Cursors lead through all surveys, each once, in the order of arrival."""
    posted = [
        service.client.post("/v1/surveys?build=false", json=a_survey(seed)).json()["survey_id"]
        for seed in range(5)
    ]
    seen: list[str] = []
    cursor = None
    while True:
        query = {"limit": 2} | ({"cursor": cursor} if cursor else {})
        page = service.client.get("/v1/surveys", params=query).json()
        seen += [survey["id"] for survey in page["surveys"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert seen == posted


def test_csv_and_json_say_the_same(service: Service):
    """Tidy rows in any order of columns are the columnar survey; the query describes them."""
    query = {"road_id": "street-07", "device": "pixel4a", "recorded_at": "2021-05-08T10:12:00Z"}
    headers = {"Content-Type": "text/csv; charset=utf-8"}
    answer = service.client.post("/v1/surveys", params=query, content=CSV, headers=headers)
    assert answer.status_code == 202, answer.text
    samples = service.client.get(f"/v1/surveys/{answer.json()['survey_id']}/samples").json()
    assert {name: samples[name] for name in COLUMNAR} == COLUMNAR
    assert_problem(
        service.client.post("/v1/surveys", json=COLUMNAR | query), 409, "duplicate-survey"
    )


def test_a_query_that_contradicts_its_body_is_refused(service: Service):
    """What is said twice must be said alike."""
    answer = service.client.post("/v1/surveys?road_id=other", json=a_survey())
    assert_problem(answer, 422, "invalid-input", {"/road_id"})
    assert service.client.post("/v1/surveys?road_id=street-07", json=a_survey()).is_success


def test_an_idempotency_key_gets_the_first_answer_again(service: Service):
    """The same key with the same survey is answered as before, and stored once."""
    headers = {"Idempotency-Key": "drive-17"}
    first = service.client.post("/v1/surveys", json=a_survey(), headers=headers)
    second = service.client.post("/v1/surveys", json=a_survey(), headers=headers)
    assert (second.status_code, second.json()) == (first.status_code, first.json())
    assert second.headers["location"] == first.headers["location"]
    assert "idempotency-replayed" not in first.headers
    assert second.headers["idempotency-replayed"] == "true"
    assert len(service.client.get("/v1/surveys").json()["surveys"]) == 1
    other = service.client.post("/v1/surveys", json=a_survey(2), headers=headers)
    assert_problem(other, 409, "idempotency-mismatch")


def test_a_deleted_survey_is_gone_and_its_road_is_built_again(service: Service):
    """Deleting answers with the build that takes the survey out of the map."""
    survey_id = service.client.post("/v1/surveys?build=false", json=a_survey()).json()["survey_id"]
    answer = service.client.delete(f"/v1/surveys/{survey_id}")
    assert answer.status_code == 200
    assert answer.headers["location"] == f"/v1/builds/{answer.json()['build_id']}"
    assert_problem(service.client.get(f"/v1/surveys/{survey_id}"), 404, "not-found")
    assert_problem(service.client.delete(f"/v1/surveys/{survey_id}"), 404, "not-found")


@pytest.mark.parametrize(
    "path", ["/v1/surveys/none", "/v1/surveys/none/samples", "/v1/surveys?road_id=none"]
)
def test_what_is_not_there_is_not_found(service: Service, path: str):
    """Unknown ids are 404, whatever they look like."""
    assert_problem(service.client.get(path), 404, "not-found")


def test_times_may_count_from_anywhere(service: Service):
    """Unix times are stored from the first sample on."""
    survey = a_survey()
    survey["time_s"] = [1_619_039_596.25 + time_s for time_s in survey["time_s"]]
    survey_id = service.client.post("/v1/surveys", json=survey).json()["survey_id"]
    samples = service.client.get(f"/v1/surveys/{survey_id}/samples").json()
    np.testing.assert_allclose(samples["time_s"], a_survey()["time_s"], atol=1e-6)


def test_a_large_survey_goes_through(tmp_path):
    """A day of driving in one gzipped body: 100,000 samples of six cells."""
    from tests.api.conftest import serving

    rng = np.random.default_rng(5)
    count = 100_000
    survey = {
        "road_id": "long",
        "cells": [f"850:{number}" for number in range(6)],
        "time_s": np.arange(count, dtype=float).tolist(),
        "lon": (8.0 + 1e-6 * np.arange(count)).tolist(),
        "lat": [50.0] * count,
        "rsrp_dbm": np.round(rng.uniform(-120, -60, (count, 6)), 1).tolist(),
    }
    body = gzip.compress(json.dumps(survey).encode(), compresslevel=1)
    headers = {"Content-Type": "application/json", "Content-Encoding": "gzip"}
    with serving(tmp_path, max_body_bytes=50_000_000) as service:
        answer = service.client.post("/v1/surveys?build=false", content=body, headers=headers)
        assert answer.status_code == 202, answer.text
        assert answer.json()["samples"] == count
