"""Alive, ready, metrics, request ids, unknown paths, and what a defect shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.api.schemas.health import Alive, Ready
from tests.api.conftest import Service, assert_problem, serving, survey_json, window_json
from tests.factories import line_at, trace_along


def test_alive_and_ready(service: Service):
    """A new service is alive and ready, with no map yet."""
    Alive.model_validate_json(service.client.get("/livez").content)
    ready = Ready.model_validate_json(service.client.get("/readyz").content)
    assert (ready.map_version, ready.active_map_version) == (None, None)


def test_without_its_store_a_service_is_alive_but_not_ready(tmp_path: Path):
    """A store that fails is 503 on whatever needs it, and a map in memory is served on."""
    with serving(tmp_path, map_poll_interval_s=60.0) as service:
        trace = trace_along(line_at(), seed=1, road_id="r")
        service.client.post("/v1/surveys?build=false", json=survey_json(trace))
        version = service.build()
        service.client.put("/v1/maps/active", json={"version": version})
        with service.engine.connect() as connection:
            for table in sa.inspect(connection).get_table_names():
                connection.exec_driver_sql(f"ALTER TABLE {table} RENAME TO lost_{table}")
            connection.commit()
        for path in ("/readyz", "/v1/surveys", "/v1/roads"):
            answer = service.client.get(path)
            assert_problem(answer, 503, "store-unavailable")
            assert answer.headers["retry-after"]
        assert service.client.get("/livez").status_code == 200
        assert service.client.post("/v1/locate", json=window_json()).status_code == 200


def test_metrics_count_by_route(shared: Service):
    """Labels are route templates, never paths with ids, and unknown paths share one."""
    for path in ("/v1/roads/north", "/v1/roads/south", "/wp-login.php", "/.env"):
        shared.client.get(path)
    shared.client.post("/v1/locate", json=window_json())
    answer = shared.client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    text = answer.text
    assert re.search(
        r'roadprint_requests_total\{method="GET",route="/v1/roads/\{road_id\}",status="200"\}', text
    )
    assert re.search(
        r'roadprint_requests_total\{method="POST",route="/v1/locate",status="200"\}', text
    )
    assert 'route="none",status="404"' in text
    assert "wp-login" not in text
    assert re.search(r"roadprint_map_version 1\.0", text)
    assert re.search(r'roadprint_fixes_total\{status="(located|off_map)"\} [1-9]', text)
    assert "roadprint_request_duration_seconds_bucket" in text


@pytest.mark.parametrize("sent", ["abc-123", "a" * 128, "01HV:7.x_y"])
def test_a_request_id_is_echoed(shared: Service, sent: str):
    """On answers and refusals alike."""
    for path in ("/livez", "/none"):
        answer = shared.client.get(path, headers={"X-Request-ID": sent})
        assert answer.headers["x-request-id"] == sent


@pytest.mark.parametrize("sent", [None, "", "a" * 129, "a b", 'x"y', "a;b", "é".encode("latin-1")])
def test_an_unfit_request_id_is_replaced(shared: Service, sent: str | bytes | None):
    """What could confuse a log or a header is not echoed; a fresh one comes instead."""
    headers = {} if sent is None else {"X-Request-ID": sent}
    ids = {shared.client.get("/livez", headers=headers).headers["x-request-id"] for _ in range(2)}
    assert len(ids) == 2
    assert all(re.fullmatch(r"[0-9a-f]{32}", fresh) for fresh in ids)


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/v1",
        "/v1/",
        "/v2/locate",
        "/v1/roads/",
        "/v1/locate/",
        "/v1/roads/a/b",
        "/docs/x",
        "/docs/assets/x",
    ],
)
def test_unknown_paths_are_not_found(shared: Service, path: str):
    """404 as a problem, never a redirect."""
    document = assert_problem(shared.client.get(path), 404, "no-such-path")
    assert path in document["detail"]


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("GET", "/v1/locate", {"POST"}),
        ("DELETE", "/v1/locate/batch", {"POST"}),
        ("PATCH", "/v1/surveys", {"GET", "POST"}),
        ("POST", "/v1/surveys/x", {"GET", "DELETE"}),
        ("POST", "/v1/maps/active", {"GET", "PUT"}),
        ("DELETE", "/v1/roads/north", {"GET", "PUT"}),
        ("POST", "/livez", {"GET"}),
    ],
)
def test_other_methods_are_not_allowed(shared: Service, method: str, path: str, allowed: set[str]):
    """405 names every method that the path has."""
    answer = shared.client.request(method, path)
    assert_problem(answer, 405, "method-not-allowed")
    assert set(answer.headers["allow"].split(", ")) == allowed


@pytest.mark.parametrize("path", ["/v1/surveys", "/v1/locate"])
def test_a_defect_shows_nothing_of_the_inside(
    shared: Service, monkeypatch: pytest.MonkeyPatch, path: str
):
    """500 as a problem with the request's id; the cause is in the log only."""

    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("the secret of the inside")

    monkeypatch.setattr("app.api.routes.surveys.list_surveys", broken)
    monkeypatch.setattr("app.api.routes.locate.located_document", broken)
    headers = {"X-Request-ID": "defect-1"}
    if path == "/v1/locate":
        answer = shared.client.post(path, json=window_json(), headers=headers)
    else:
        answer = shared.client.get(path, headers=headers)
    assert_problem(answer, 500, "internal-error")
    assert answer.headers["x-request-id"] == "defect-1"
    assert "secret" not in answer.text
    assert shared.client.get("/livez").status_code == 200


def test_the_interface_describes_itself(shared: Service):
    """/docs is a page, /openapi.json the document."""
    page = shared.client.get("/docs")
    assert "text/html" in page.headers["content-type"]
    loaded = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert len(loaded) == 3
    for address in loaded:
        assert address.startswith("/")  # nothing from elsewhere: the service may be offline
        assert shared.client.get(address).status_code == 200
    assert shared.client.get("/openapi.json").json()["info"]["title"] == "roadprint"
