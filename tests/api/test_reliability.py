"""How far a map version can be trusted, over HTTP and in words."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from app.api.reliability import PARAMETERS, reliability_document
from app.api.schemas.reliability import ReliabilityDocument
from app.commands.reliability import reliability_words
from app.domain import Calibration, Reliability
from app.services import roadwork
from app.services.builds import request_build
from app.services.maps import get_map
from tests.api.conftest import Service, assert_problem, made_up_model, survey_json
from tests.factories import line_at, trace_along

MEASURED = Reliability(
    window_count=200,
    measured_count=150,
    road_right=0.97,
    ece=0.013,
    curve=((0.55, 0.5, 20), (0.98, 1.0, 180)),
    coverage=((0.5, 0.51), (0.68, 0.67), (0.8, 0.81), (0.9, 0.9), (0.95, 0.94)),
    median_m=3.25,
    p90_m=9.0,
    refused=0.01,
    strangers_refused=0.92,
    off_map_auroc=0.97,
    segment_right=0.91,
    segment_ece=0.027,
)


def build_with(service: Service, calibration: Calibration) -> int:
    """A map whose calibration is given; its version."""
    trace = trace_along(line_at(), seed=1, road_id="a")
    service.client.post("/v1/surveys?build=false", json=survey_json(trace))
    build = request_build(service.engine, None)
    count = roadwork.begin_build(service.engine, build.id)
    for road_id in roadwork.waiting_roads(service.engine, build.id, 0, count):
        roadwork.build_road(service.engine, made_up_model, build.id, road_id)
    roadwork.publish(service.engine, lambda _models: calibration, build.id)
    return int(service.client.get(f"/v1/builds/{build.id}").json()["map_version"])


def reliability_of(service: Service, version: int | str) -> dict[str, Any]:
    answer = service.client.get(f"/v1/maps/{version}/reliability")
    assert answer.status_code == 200, answer.text
    ReliabilityDocument.model_validate_json(answer.content, extra="forbid")
    return answer.json()


def test_what_was_measured_is_served(service: Service):
    """Every figure of the calibration, by number and as the active one."""
    calibration = Calibration(offset_sd_db=2.5, window_count=200, reliability=MEASURED)
    version = build_with(service, calibration)
    found = reliability_of(service, version)
    assert found == reliability_of(service, "active")
    assert found["map_version"] == version
    assert (found["window_count"], found["measured_count"]) == (200, 150)
    assert found["road"]["curve"][0] == {"posterior": 0.55, "right": 0.5, "windows": 20}
    assert found["road"]["ece"] == 0.013
    assert found["segment"] == {"right": 0.91, "ece": 0.027}
    assert found["position"]["coverage"][1] == {"confidence": 0.68, "share": 0.67}
    assert found["off_map"] == {"refused": 0.01, "strangers_refused": 0.92, "auroc": 0.97}
    offset = found["calibration"]["offset_sd_db"]
    assert (offset["value"], offset["unit"]) == (2.5, "dB")
    assert "driven once" in found["note"]


@pytest.mark.parametrize(
    ("calibration", "words"),
    [
        (Calibration(), "Too few held-out windows"),
        (Calibration(window_count=90), "before maps measured"),
        (
            Calibration(window_count=200, reliability=replace(MEASURED, measured_count=0)),
            "drawn from the model itself",
        ),
    ],
)
def test_what_was_not_measured_is_said(service: Service, calibration: Calibration, words: str):
    """Nulls and empty lists with the reason, never a figure that nobody measured."""
    found = reliability_of(service, build_with(service, calibration))
    assert words in found["note"]
    if not found["window_count"]:
        assert set(found["off_map"].values()) == {None}
        assert found["road"] == {"right": None, "ece": None, "curve": []}
        assert found["segment"] == {"right": None, "ece": None}
        assert found["position"] == {"median_m": None, "p90_m": None, "coverage": []}


def test_windows_all_measured_need_no_note(service: Service):
    """Nothing to warn of."""
    reliability = replace(MEASURED, measured_count=200)
    calibration = Calibration(window_count=200, reliability=reliability)
    assert reliability_of(service, build_with(service, calibration))["note"] is None


@pytest.mark.parametrize("version", ["99", "0", "-1", "x", "1e3", str(2**31), "9" * 40, "²"])
def test_an_unknown_version_is_not_found(shared: Service, version: str):
    """Whatever stands in the path, the answer is a problem that names it."""
    answer = shared.client.get(f"/v1/maps/{version}/reliability")
    assert answer.status_code == 404
    assert answer.json()["code"] == "not-found"
    assert version in answer.json()["detail"]


def test_without_a_map_there_is_none_active(service: Service):
    """As everywhere: 503 until the first build is done."""
    assert_problem(service.client.get("/v1/maps/active/reliability"), 503, "no-map")


def test_other_methods_are_refused(shared: Service):
    """It is read only."""
    answer = shared.client.put("/v1/maps/1/reliability", json={})
    assert_problem(answer, 405, "method-not-allowed")


def test_who_has_it_needs_it_no_second_time(shared: Service):
    """The ETag is the version's: a second read is 304 without a body."""
    first = shared.client.get("/v1/maps/active/reliability")
    tag = first.headers["etag"]
    again = shared.client.get("/v1/maps/active/reliability", headers={"If-None-Match": tag})
    assert again.status_code == 304
    assert again.content == b""


def test_every_parameter_has_a_unit():
    """All numbers of a calibration that answers depend on are told, with unit and meaning."""
    named = {one.name for one in fields(Calibration)} - {"window_count", "reliability"}
    assert named == set(PARAMETERS)


def test_a_build_ends_in_three_lines(service: Service):
    """Places, probabilities and off the map, with a note where one is due; or the note alone."""
    calibration = Calibration(window_count=200, reliability=MEASURED)
    version = build_with(service, calibration)
    found = reliability_document(get_map(service.engine, version))
    places, probabilities, off_map, note = reliability_words(found)
    assert "97.0 %" in places
    assert "200 held-out windows (150 of other passes than their curves)" in places
    assert "3.2 m" in places
    assert "the road's is off by 1.3 % on average, the sub-segment's by 2.7 %" in probabilities
    assert "67.0 % at 68 %" in probabilities
    assert "AUROC 0.970" in off_map
    assert note.startswith("note: ")
    found["segment"]["ece"] = None  # as versions have it from before this was measured
    assert "1.3 % on average; the radius" in reliability_words(found)[1]
    empty = reliability_document(get_map(service.engine, build_with(service, Calibration())))
    assert [line[:20] for line in reliability_words(empty)] == ["note: Too few held-o"]
