"""Problem documents (RFC 9457): the one shape of every refusal and failure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import orjson
from pydantic import BaseModel, Field
from starlette.responses import Response

from app.errors import Fault

PROBLEM_MEDIA_TYPE = "application/problem+json"
TYPE_PREFIX = "urn:roadprint:problem:"


class FaultDocument(BaseModel):
    """One thing wrong, and where."""

    pointer: str = Field(
        description="JSON pointer (RFC 6901) into the body; empty when it is the body itself, a "
        "query parameter or a header; `/lines/7/rsrp_dbm` in a CSV body.",
        examples=["/rsrp_dbm/17/2"],
    )
    detail: str = Field(examples=["-200 dBm is outside -156..-31 dBm"])


class ProblemDocument(BaseModel):
    """RFC 9457 problem details, with `code` for programs and `errors` for every fault found."""

    type: str = Field(examples=["urn:roadprint:problem:invalid-input"])
    title: str = Field(description="The same for every occurrence of this code.")
    status: int = Field(ge=400, le=599)
    detail: str = Field(description="What went wrong this time, with the numbers.")
    instance: str = Field(description="The path that was asked.")
    code: str = Field(examples=["invalid-input"])
    errors: list[FaultDocument] = Field(default=[])


def problem(
    status: int,
    code: str,
    title: str,
    detail: str,
    *,
    instance: str,
    faults: Iterable[Fault] = (),
) -> dict[str, Any]:
    """The document as plain values, in the order people read it."""
    return {
        "type": TYPE_PREFIX + code,
        "title": title,
        "status": status,
        "detail": detail,
        "instance": instance,
        "code": code,
        "errors": [{"pointer": fault.pointer, "detail": fault.detail} for fault in faults],
    }


def problem_response(
    document: Mapping[str, Any], headers: Mapping[str, str] | None = None
) -> Response:
    """The answer that carries a problem document under its own media type."""
    return Response(
        orjson.dumps(document),
        status_code=document["status"],
        headers=dict(headers or {}),
        media_type=PROBLEM_MEDIA_TYPE,
    )
