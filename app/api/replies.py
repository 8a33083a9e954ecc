"""Answers other than the hot one: JSON from plain values, GeoJSON beside it, and ETags."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from zlib import crc32

import orjson
from fastapi import Request
from starlette.responses import Response

from app.api.content import GEOJSON, JSON

OPTIONS = orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_UTC_Z


def reply(
    document: object,
    status: int = 200,
    *,
    headers: Mapping[str, str] | None = None,
    media_type: str = JSON,
) -> Response:
    """Plain values, arrays and moments as JSON."""
    body = orjson.dumps(document, option=OPTIONS)
    return Response(body, status, headers=dict(headers or {}), media_type=media_type)


def unless_known(
    request: Request, tag: str, make: Callable[[], object], *, geojson: bool = False
) -> Response:
    """
    304 when the client holds what ``tag`` stands for, without making it; else what ``make`` makes.

    The tag is weak: it tells documents apart, not bytes.
    """
    etag = f'W/"{tag}{"-geojson" if geojson else ""}"'
    headers = {"ETag": etag, "Vary": "Accept", "Cache-Control": "no-cache"}
    if holds(request, etag):
        return Response(status_code=304, headers=headers)
    return reply(make(), headers=headers, media_type=GEOJSON if geojson else JSON)


def unless_same(request: Request, tag: str, document: Any, *, geojson: bool = False) -> Response:
    """The same for documents that also change without a new map: their sum is part of the tag."""
    body_sum = crc32(orjson.dumps(document, option=OPTIONS))
    return unless_known(request, f"{tag}-{body_sum:08x}", lambda: document, geojson=geojson)


def holds(request: Request, etag: str) -> bool:
    """Whether ``If-None-Match`` names this tag (RFC 9110, section 13.1.2: weak comparison)."""
    wanted = [tag.strip() for tag in request.headers.get("if-none-match", "").split(",")]
    bare = etag.removeprefix("W/")
    return any(tag == "*" or tag.removeprefix("W/") == bare for tag in wanted if tag)
