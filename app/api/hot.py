"""
The route of the hot path: raw bytes validated once, no per-request framework work.

The endpoint keeps its typed signature, so the OpenAPI document is that of a plain route, and so are
the answers; skipped are dependency solving, exit stacks and the second serialisation: some 40 % of
a plain route's time (`benchmarks/bench_http.py` measures what is left).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fastapi import Request
from fastapi.routing import APIRoute
from pydantic import TypeAdapter, ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.content import body_media_type
from app.api.errors import on_http_exception, on_roadprint_error
from app.api.faults import invalid_input
from app.errors import RoadprintError


class HotRoute(APIRoute):
    """
    A POST route for ``async def endpoint(body: Model, request: Request) -> Response``.

    Overrides `handle`, which both a direct route and an included router call, so that including it
    cannot bypass it in silence.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        super().__init__(path, endpoint, **options)
        if self.dependant.dependencies or self.body_field is None:
            raise TypeError(f"{path}: a hot route has one body and no dependencies")
        model: Any = self.body_field.field_info.annotation
        self._validator = TypeAdapter(model).validator

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Reads, validates, calls, answers; anything but POST goes the usual way (405)."""
        if scope["method"] != "POST":
            await super().handle(scope, receive, send)
            return
        body_media_type(scope["headers"])
        raw = await read_body(receive)
        try:
            body = self._validator.validate_json(raw)
        except ValidationError as error:
            raise invalid_input(error) from None
        response = await self.endpoint(body, Request(scope))
        await response(scope, receive, send)


class HotPath:
    """
    Hands requests for one `HotRoute` to it before the framework looks at them.

    Saves the exception and exit-stack layers and the search for the route, some 20 microseconds of
    a fix; the route's own refusals become problems here as they would there.
    """

    def __init__(self, app: ASGIApp, route: HotRoute) -> None:
        self.app = app
        self.route = route

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        hot = (
            scope["type"] == "http"
            and scope["method"] == "POST"
            and scope["path"] == self.route.path
        )
        if not hot:
            await self.app(scope, receive, send)
            return
        scope["route"] = self.route
        try:
            await self.route.handle(scope, receive, send)
        except RoadprintError as error:
            response = await on_roadprint_error(Request(scope), error)
            await response(scope, receive, send)
        except HTTPException as refusal:
            response = await on_http_exception(Request(scope), refusal)
            await response(scope, receive, send)


class HotResponse(Response):
    """A JSON answer whose headers are written down, not negotiated."""

    def __init__(self, body: bytes, *headers: tuple[bytes, bytes]) -> None:
        self.status_code = 200
        self.background = None
        self.body = body
        length = (b"content-length", b"%d" % len(body))
        self.raw_headers = [(b"content-type", b"application/json"), length, *headers]


async def read_body(receive: Receive) -> bytes:
    """
    The whole body; one message and no copy in the usual case.

    Raises:
        ClientDisconnect: The client left before it was complete.
    """
    message = await receive()
    if message["type"] == "http.request" and not message.get("more_body", False):
        return bytes(message.get("body", b""))
    chunks: list[bytes] = []
    while message["type"] == "http.request":
        chunks.append(message.get("body", b""))
        if not message.get("more_body", False):
            return b"".join(chunks)
        message = await receive()
    raise ClientDisconnect
