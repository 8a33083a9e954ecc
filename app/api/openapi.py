"""What FastAPI cannot see: problem documents, and bodies that endpoints parse themselves."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from app.api.problems import PROBLEM_MEDIA_TYPE, ProblemDocument

SCHEMAS = "#/components/schemas/"
FASTAPI_ONLY = ("HTTPValidationError", "ValidationError")  # its own 422, which ours replaces

_named_only: dict[str, type[BaseModel]] = {"ProblemDocument": ProblemDocument}
"""Models that routes name by reference, which FastAPI therefore does not meet."""


def _problem(description: str) -> dict[str, Any]:
    schema = reference(ProblemDocument)
    return {"description": description, "content": {PROBLEM_MEDIA_TYPE: {"schema": schema}}}


def reference(model: type[BaseModel]) -> dict[str, Any]:
    """A reference to a model's schema, which will be among the components."""
    _named_only[model.__name__] = model
    return {"$ref": SCHEMAS + model.__name__}


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The ``responses`` argument of a route that may refuse with these statuses."""
    return {status: _problem(HTTPStatus(status).phrase) for status in statuses}


def body_of(model: type[BaseModel], **other_types: dict[str, Any]) -> dict[str, Any]:
    """The ``openapi_extra`` argument of a route that parses its JSON body (or another) itself."""
    content: dict[str, Any] = {"application/json": {"schema": reference(model)}}
    return {"requestBody": {"required": True, "content": content | other_types}}


def openapi_document(app: FastAPI) -> dict[str, Any]:
    """The OpenAPI document of the application."""
    document = get_openapi(
        title=app.title,
        version=app.version,
        description=app.description,
        routes=app.routes,
        tags=app.openapi_tags,
    )
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    models = [(model, "validation") for model in _named_only.values()]
    _, added = models_json_schema(models, ref_template=SCHEMAS + "{model}")  # type: ignore[arg-type]
    schemas.update(added["$defs"])
    for name in FASTAPI_ONLY:
        schemas.pop(name, None)
    for path in document["paths"].values():
        for operation in path.values():
            _use_problems(operation["responses"])
    document["components"]["schemas"] = dict(sorted(schemas.items()))
    return document


def _use_problems(responses: dict[str, Any]) -> None:
    if "422" in responses:
        responses["422"] = _problem(HTTPStatus(422).phrase)
    responses["default"] = _problem("Any other refusal or failure")
