"""Builds and their events, map versions and the way back."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from app.api.schemas.builds import BuildDocument, BuildPage, MapDocument, MapList
from app.domain import Calibration
from app.services import roadwork
from app.services.builds import request_build
from tests.api.conftest import (
    Service,
    assert_problem,
    made_up_model,
    serving,
    survey_json,
    window_json,
)
from tests.factories import line_at, trace_along


def post_road(service: Service, road_id: str, seed: int = 1) -> None:
    trace = trace_along(line_at(), seed=seed, road_id=road_id)
    answer = service.client.post("/v1/surveys?build=false", json=survey_json(trace))
    assert answer.status_code == 202, answer.text


def events(service: Service, build_id: str) -> tuple[list[dict[str, Any]], list[str]]:
    """Every event of a build's stream, which must end, and its comments."""
    seen, comments = [], []
    with service.client.stream("GET", f"/v1/builds/{build_id}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        for line in stream.iter_lines():
            if line.startswith("data: "):
                seen.append(json.loads(line.removeprefix("data: ")))
            elif line.startswith(":"):
                comments.append(line)
    return seen, comments


@pytest.mark.parametrize("body", [{}, {"road_ids": None}, {"road_ids": ["r"], "activate": True}])
def test_a_build_is_queued(service: Service, body: dict[str, Any]):
    """202 with the build, which `Location` leads to and the list holds."""
    post_road(service, "r")
    answer = service.client.post("/v1/builds", json=body)
    assert answer.status_code == 202
    build = BuildDocument.model_validate_json(answer.content)
    assert (build.status, build.progress, build.roads_total) == ("accepted", 0.0, 1)
    assert answer.headers["location"] == f"/v1/builds/{build.id}"
    assert service.client.get(answer.headers["location"]).json() == answer.json()
    page = BuildPage.model_validate_json(service.client.get("/v1/builds").content)
    assert [listed.id for listed in page.builds] == [build.id]


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({"road_ids": ["none"]}, 404, "not-found"),
        ({}, 409, "nothing-to-build"),
        ({"road_ids": "r"}, 422, "invalid-input"),
        ({"road_ids": [""]}, 422, "invalid-input"),
        ({"activate": "yes"}, 422, "invalid-input"),
        ({"roads": []}, 422, "invalid-input"),
    ],
)
def test_a_build_that_cannot_be_is_refused(
    service: Service, body: dict[str, Any], status: int, code: str
):
    """Unknown roads, nothing to build, a malformed request."""
    assert_problem(service.client.post("/v1/builds", json=body), status, code)
    assert service.client.get("/v1/builds").json()["builds"] == []


@pytest.mark.parametrize("method", ["GET", "DELETE"])
def test_an_unknown_build_is_not_found(service: Service, method: str):
    """404, as a document or as a stream."""
    assert_problem(service.client.request(method, "/v1/builds/none"), 404, "not-found")
    assert_problem(service.client.get("/v1/builds/none/events"), 404, "not-found")


def test_events_follow_a_build_to_its_end(service: Service):
    """The stream tells each change, keeps alive in between, and ends with the build."""
    post_road(service, "r")
    build_id = service.client.post("/v1/builds", json={}).json()["id"]

    def work_later() -> None:
        time.sleep(0.5)  # long enough for keep-alives
        service.work_on(build_id)

    worker = threading.Thread(target=work_later)
    worker.start()
    seen, comments = events(service, build_id)
    worker.join()
    statuses = [event["status"] for event in seen]
    assert statuses[0] == "accepted"
    assert statuses[-1] == "successful"
    assert statuses.count("successful") == 1
    assert comments
    assert seen[-1] == service.client.get(f"/v1/builds/{build_id}").json()
    assert seen[-1]["map_version"] == 1


def test_events_of_a_finished_build_end_at_once(service: Service):
    """One event; a reader that comes back after it gets 204."""
    post_road(service, "r")
    build_id = service.client.post("/v1/builds", json={}).json()["id"]
    dismissed = service.client.delete(f"/v1/builds/{build_id}")
    assert dismissed.json()["status"] == "dismissed"
    seen, _ = events(service, build_id)
    assert seen == [dismissed.json()]
    back = service.client.get(
        f"/v1/builds/{build_id}/events", headers={"Last-Event-ID": "dismissed"}
    )
    assert (back.status_code, back.content) == (204, b"")


def test_many_streams_hold_nobody_up(service: Service):
    """Other requests are answered while streams are open."""
    post_road(service, "r")
    build_id = service.client.post("/v1/builds", json={}).json()["id"]
    readers = [threading.Thread(target=events, args=(service, build_id)) for _ in range(50)]
    for reader in readers:
        reader.start()
    assert service.client.get("/v1/surveys").is_success
    service.client.delete(f"/v1/builds/{build_id}")
    for reader in readers:
        reader.join(20)
        assert not reader.is_alive()


def test_maps_are_listed_and_chosen(service: Service):
    """A version can be activated and taken back; fixes name the one in force."""
    assert service.client.get("/v1/maps").json() == {"maps": []}
    assert_problem(service.client.get("/v1/maps/active"), 503, "no-map")
    post_road(service, "a")
    service.wait_for_map(service.build())
    post_road(service, "b", seed=2)
    assert service.build(activate=False) == 2
    listed = service.client.get("/v1/maps")
    MapList.model_validate_json(listed.content)
    assert [(m["version"], m["active"]) for m in listed.json()["maps"]] == [(2, False), (1, True)]
    for version in (2, 1):
        chosen = service.client.put("/v1/maps/active", json={"version": version})
        assert MapDocument.model_validate_json(chosen.content).active
        assert service.client.get("/v1/maps/active").json() == chosen.json()
        fix = service.client.post("/v1/locate", json=window_json()).json()
        assert fix["map_version"] == version


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({"version": 99}, 404, "not-found"),
        ({"version": 0}, 422, "invalid-input"),
        ({"version": 2**63}, 422, "invalid-input"),
        ({"version": "1"}, 422, "invalid-input"),
        ({}, 422, "invalid-input"),
        ({"version": 1, "force": True}, 422, "invalid-input"),
    ],
)
def test_only_a_map_that_is_there_can_be_chosen(
    shared: Service, body: dict[str, Any], status: int, code: str
):
    """A refused choice changes nothing."""
    before = shared.client.get("/v1/maps/active").json()
    assert_problem(shared.client.put("/v1/maps/active", json=body), status, code)
    assert shared.client.get("/v1/maps/active").json() == before


def test_a_new_map_is_served_without_being_asked(service: Service):
    """What a worker activates is served within the poll interval."""
    post_road(service, "a")
    version = service.build()
    service.wait_for_map(version)
    assert service.client.post("/v1/locate", json=window_json()).json()["map_version"] == version


@pytest.mark.parametrize("told_by", ["build", "events", "active"])
def test_whoever_is_told_of_a_map_is_served_by_it(tmp_path: Path, told_by: str):
    """A fix right after a build's end comes from its map, however seldom maps are polled."""
    with serving(tmp_path, map_poll_interval_s=600.0) as service:
        post_road(service, "r")
        build = request_build(service.engine, None)
        work_quietly(service, build.id)
        if told_by == "events":
            assert events(service, build.id)[0][-1]["status"] == "successful"
        else:
            path = {"build": f"/v1/builds/{build.id}", "active": "/v1/maps/active"}[told_by]
            service.client.get(path).raise_for_status()
        answer = service.client.post("/v1/locate", json=window_json())
        assert answer.status_code == 200, answer.text
        assert answer.json()["map_version"] == 1


def work_quietly(service: Service, build_id: str) -> None:
    """Do a build without asking the service for anything."""
    count = roadwork.begin_build(service.engine, build_id)
    for road_id in roadwork.waiting_roads(service.engine, build_id, 0, count):
        roadwork.build_road(service.engine, made_up_model, build_id, road_id)
    roadwork.publish(service.engine, lambda _models: Calibration(), build_id)
