"""The outermost layer: request id, metrics, log, and the answer when everything else failed."""

from __future__ import annotations

import re
from itertools import count
from secrets import token_hex
from time import perf_counter

import structlog
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.errors import unexpected_problem
from app.api.metrics import Metrics
from app.api.problems import problem_response

REQUEST_ID = re.compile(rb"[A-Za-z0-9._:-]{1,128}")  # what may be echoed into headers and logs
CLIENT_LEFT = 499  # nginx's number for an answer that nobody waited for
READS = frozenset({"GET", "HEAD", "OPTIONS"})
NO_ROUTE = "none"  # one label for all unknown paths, or any scanner would fill the memory

# Random once a process and counted from there: a random one each costs 5 microseconds.
PROCESS_ID = token_hex(8).encode()
_numbers = count()

_log = structlog.get_logger()


def request_id_of(headers: list[tuple[bytes, bytes]]) -> bytes:
    """The client's ``X-Request-ID`` when it is fit to echo, else a fresh one of 32 hex digits."""
    for name, value in headers:
        if name == b"x-request-id" and REQUEST_ID.fullmatch(value):
            return value
    return b"%s%016x" % (PROCESS_ID, next(_numbers))


class Envelope:
    """Wraps every request: gives it an id, counts and times it, and never lets a defect leak."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = perf_counter()
        request_id = request_id_of(scope["headers"])
        status, ended = 0, False

        async def send_with_id(message: Message) -> None:
            nonlocal status, ended
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message["headers"], (b"x-request-id", request_id)]
            else:
                ended = not message.get("more_body", False)
            await send(message)

        try:
            await self.app(scope, receive, send_with_id)
        except ClientDisconnect:
            status = CLIENT_LEFT
        except Exception:
            _log.exception("defect", request_id=request_id.decode(), path=scope["path"])
            if not status:
                answer = problem_response(unexpected_problem(scope["path"]))
                await answer(scope, receive, send_with_id)
            elif not ended:  # half an answer is out: only closing the connection tells the client
                raise
        finally:
            self._record(scope, request_id, status, perf_counter() - started)

    def _record(self, scope: Scope, request_id: bytes, status: int, duration_s: float) -> None:
        route = getattr(scope.get("route"), "path", NO_ROUTE)
        method = scope["method"]
        self.metrics.request(method, route, status, duration_s)
        if method in READS or route.startswith("/v1/locate"):
            return  # thousands a second: the metrics have them, and a line each would cost a tenth
        _log.info(
            "request",
            request_id=request_id.decode(),
            method=method,
            path=scope["path"],
            status=status,
            duration_ms=round(duration_s * 1000, 3),
        )
