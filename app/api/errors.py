"""From errors to problem documents: one table for ours, and handlers that every endpoint shares."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from typing import cast

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.routing import iter_route_contexts
from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException
from starlette.responses import Response

from app.api.faults import faults_of
from app.api.problems import problem, problem_response
from app.errors import (
    CannotBuildRoad,
    Conflict,
    DuplicateSurvey,
    InvalidInput,
    NoMap,
    NotFound,
    RoadprintError,
)

STATUS_OF: dict[type[RoadprintError], int] = {
    InvalidInput: 422,
    CannotBuildRoad: 422,
    NotFound: 404,
    Conflict: 409,
    NoMap: 503,
    RoadprintError: 500,
}
"""A type's status is that of its nearest ancestor here."""

RETRY_AFTER_S = "5"  # a build of one road takes about that long

CODE_OF_STATUS = {
    400: "bad-request",
    404: "no-such-path",
    405: "method-not-allowed",
    406: "not-acceptable",
    413: "body-too-large",
    415: "unsupported-media-type",
}


class Refusal(HTTPException):
    """A request refused for its form, before anybody looked at what it says."""

    def __init__(
        self, status: int, code: str, detail: str, headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(status, detail, dict(headers or {}))
        self.code = code


def status_of(error: RoadprintError) -> int:
    """The HTTP status that an error's type has in the table."""
    return next(STATUS_OF[kind] for kind in type(error).__mro__ if kind in STATUS_OF)


def _headers_of(error: RoadprintError) -> dict[str, str]:
    if isinstance(error, NoMap):
        return {"Retry-After": RETRY_AFTER_S}
    if isinstance(error, DuplicateSurvey):
        return {"Location": f"/v1/surveys/{error.survey_id}"}
    return {}


def _summary(error: InvalidInput) -> str:
    first, rest = error.faults[0], len(error.faults) - 1
    where = f"{first.pointer}: " if first.pointer else ""
    return f"{where}{first.detail}" + (f" (and {rest} more, see errors)" if rest else "")


def problem_of(error: RoadprintError, instance: str) -> dict[str, object]:
    """The problem document of one of our errors."""
    faults = error.faults if isinstance(error, InvalidInput) else []
    detail = _summary(error) if isinstance(error, InvalidInput) and faults else str(error)
    return problem(
        status_of(error), error.code, error.title, detail, instance=instance, faults=faults
    )


async def on_roadprint_error(request: Request, error: Exception) -> Response:
    """The answer to one of our errors."""
    ours = cast("RoadprintError", error)
    return problem_response(problem_of(ours, request.url.path), _headers_of(ours))


async def on_http_exception(request: Request, error: Exception) -> Response:
    """The answer to a refusal of ours or the framework's."""
    refused = cast("HTTPException", error)
    path, status, headers = request.url.path, refused.status_code, refused.headers
    code = getattr(refused, "code", None) or CODE_OF_STATUS.get(status, "http-error")
    detail = refused.detail
    if code == "no-such-path":
        detail = f"no such path: {path}"
    if code == "method-not-allowed":
        headers = {"Allow": ", ".join(_allowed_methods(request))}
        detail = f"{request.method} is not for {path}, but {headers['Allow']}"
    document = problem(status, code, HTTPStatus(status).phrase, detail, instance=path)
    return problem_response(document, headers)


def _allowed_methods(request: Request) -> list[str]:
    """The methods of every route with this path (the framework names those of the first one)."""
    found: set[str] = set()
    for context in iter_route_contexts(request.app.routes):
        regex = getattr(context.original_route, "path_regex", None)
        if regex is not None and regex.match(request.url.path):
            found |= context.methods or set()
    return sorted(found)


async def _on_request_validation(request: Request, error: Exception) -> Response:
    """FastAPI says in the first step of a location where the value stood."""
    errors = []
    for found in cast("RequestValidationError", error).errors():
        place, *steps = found["loc"]
        if place != "body":
            msg = f"{place} parameter {steps[0]}: {found['msg']}"
            errors.append({**found, "loc": (), "msg": msg})
        elif found["type"] == "json_invalid":
            msg = f"Invalid JSON: {found['ctx']['error']} at character {steps[0]}"
            errors.append({**found, "loc": (), "msg": msg})
        else:
            errors.append({**found, "loc": tuple(steps)})
    faults = faults_of(errors)
    return problem_response(problem_of(faults.error(), request.url.path))


async def _on_store_failure(request: Request, error: Exception) -> Response:
    structlog.get_logger().error("store unavailable", path=request.url.path, error=str(error))
    document = problem(
        503,
        "store-unavailable",
        "The store does not answer",
        "the store is busy or out of reach; the request was not carried out",
        instance=request.url.path,
    )
    return problem_response(document, {"Retry-After": RETRY_AFTER_S})


def unexpected_problem(path: str) -> dict[str, object]:
    """What a client sees of a defect: that it happened, and nothing of the inside."""
    return problem(
        500,
        "internal-error",
        "roadprint failed",
        "a defect in roadprint stopped this request; the log holds it under the request's id",
        instance=path,
    )


async def _on_defect(request: Request, _error: Exception) -> Response:
    return problem_response(unexpected_problem(request.url.path))


def install(app: FastAPI) -> None:
    """Every handler on the application."""
    app.add_exception_handler(RoadprintError, on_roadprint_error)
    app.add_exception_handler(HTTPException, on_http_exception)
    app.add_exception_handler(RequestValidationError, _on_request_validation)
    for failure in (OperationalError, InterfaceError, PoolTimeout):
        app.add_exception_handler(failure, _on_store_failure)
    app.add_exception_handler(Exception, _on_defect)
