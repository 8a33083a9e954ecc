"""The same service on PostgreSQL."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.api.conftest import assert_problem, serving, survey_json, window_json
from tests.factories import line_at, trace_along

pytestmark = pytest.mark.postgresql


def test_a_service_on_postgresql_does_what_one_on_sqlite_does(tmp_path: Path, postgres_url: str):
    """Post, build, read, locate, refuse and forget, with nothing but the URL changed."""
    with serving(tmp_path, database_url=postgres_url) as service:
        client = service.client
        survey = survey_json(trace_along(line_at(), seed=1, road_id="r"))
        posted = client.post("/v1/surveys?build=false", json=survey).json()
        assert_problem(client.post("/v1/surveys", json=survey), 409, "duplicate-survey")
        service.wait_for_map(service.build())
        assert client.post("/v1/locate", json=window_json()).json()["map_version"] == 1
        box = {"bbox": "-119,34,-118,35"}
        assert [road["id"] for road in client.get("/v1/roads", params=box).json()["roads"]] == ["r"]
        assert client.get("/v1/roads/r/segments/0").json()["fits"]
        assert len(client.get("/v1/cells").json()["cells"]) == 3
        assert_problem(client.get("/v1/surveys/%00"), 422, "invalid-input")
        assert_problem(client.get("/v1/roads?cursor=AA"), 422, "invalid-input")
        assert client.delete(f"/v1/surveys/{posted['survey_id']}").status_code == 200
        assert client.get("/v1/surveys").json()["surveys"] == []
