"""The interface's document: fresh, whole, and true to what is answered."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from app.main import create_app
from app.settings import Settings

COMMITTED = Path(__file__).resolve().parents[2] / "openapi" / "openapi.json"

INTERFACE = {
    "/v1/surveys": {"get", "post"},
    "/v1/surveys/{survey_id}": {"get", "delete"},
    "/v2/geosubmit": {"post"},
    "/v1/surveys/{survey_id}/samples": {"get"},
    "/v1/builds": {"get", "post"},
    "/v1/builds/{build_id}": {"get", "delete"},
    "/v1/builds/{build_id}/events": {"get"},
    "/v1/maps": {"get"},
    "/v1/maps/active": {"get", "put"},
    "/v1/maps/{version}/reliability": {"get"},
    "/v1/coverage": {"get"},
    "/v1/roads": {"get"},
    "/v1/roads/{road_id}": {"get", "put"},
    "/v1/roads/{road_id}/segments": {"get"},
    "/v1/roads/{road_id}/segments/{index}": {"get"},
    "/v1/cells": {"get"},
    "/v1/locate": {"post"},
    "/v1/locate/batch": {"post"},
    "/livez": {"get"},
    "/readyz": {"get"},
    "/metrics": {"get"},
}


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    return create_app(Settings()).openapi()


def test_the_committed_document_is_fresh(document: dict[str, Any]):
    """`make openapi` has nothing to change."""
    assert json.loads(COMMITTED.read_text(encoding="utf-8")) == document


def test_every_path_is_described(document: dict[str, Any]):
    """The document holds the interface, no more and no less."""
    assert {path: set(methods) for path, methods in document["paths"].items()} == INTERFACE


def test_every_reference_leads_somewhere(document: dict[str, Any]):
    """No schema is named that is not there, and none is there that nobody names."""
    named = set(re.findall(r'"#/components/schemas/([^"]+)"', json.dumps(document)))
    assert named == set(document["components"]["schemas"])


def test_every_operation_describes_its_refusals(document: dict[str, Any]):
    """All of them are problem documents, FastAPI's own 422 among none of them."""
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            assert operation["summary"], (method, path)
            assert operation["description"], (method, path)
            for status, response in operation["responses"].items():
                if status == "default" or status.startswith(("4", "5")):
                    assert list(response["content"]) == ["application/problem+json"]


def test_bodies_that_endpoints_parse_themselves_are_described(document: dict[str, Any]):
    """The hot route and the raw bodies keep their schemas."""
    bodies = {
        "/v1/locate": {"application/json": "LocateRequest"},
        "/v1/locate/batch": {"application/json": "BatchRequest"},
        "/v1/surveys": {
            "application/json": "SurveyRequest",
            "text/csv": None,
            "text/plain": None,
            "application/vnd.google-earth.kml+xml": None,
        },
        "/v2/geosubmit": {"application/json": "GeosubmitRequest"},
    }
    for path, kinds in bodies.items():
        content = document["paths"][path]["post"]["requestBody"]["content"]
        assert set(content) == set(kinds)
        for media_type, name in kinds.items():
            if name:
                assert content[media_type]["schema"]["$ref"].endswith(f"/{name}")
