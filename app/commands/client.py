"""A roadprint service over HTTP."""

from __future__ import annotations

import gzip
import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote, urlencode

import httpx
import numpy as np
import orjson

from app.commands.target import (
    BuildView,
    Document,
    Posted,
    Refused,
    RoadView,
    Unreachable,
    road_document,
    survey_document,
)
from app.domain import Line, Road, Trace
from app.numerics.lines import length_m

TIMEOUT_S = 60.0  # storing a long drive on a busy disk
POLL_S = 0.5
PATIENCE_S = 30.0  # for a service that is started again while a build goes on
PACKED_FROM_BYTES = 4096  # smaller bodies cost more to pack than to send


class HttpTarget:
    """A service at ``url``. Use as a context manager."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self._client = httpx.Client(base_url=self.url, timeout=TIMEOUT_S)

    def __enter__(self) -> Self:
        """Open for requests."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the connections."""
        self._client.close()

    def put_road(self, road: Road) -> None:
        """Create a road, or set its name and line."""
        self._send("PUT", f"/v1/roads/{quote(road.road_id, safe='')}", road_document(road))

    def list_roads(self) -> Iterator[RoadView]:
        """All roads by id, as the active map has them."""
        cursor: str | None = None
        while True:
            place = "" if cursor is None else f"&cursor={quote(cursor, safe='')}"
            page = self._send("GET", f"/v1/roads?limit=1000{place}").json()
            for road in page["roads"]:
                line = road["line"]
                at = np.array(line["coordinates"] if line else [], dtype=float)
                drawn_m = length_m(Line(at[:, 0], at[:, 1])) if len(at) else None
                yield RoadView(
                    road["id"],
                    road["name"],
                    drawn_m if road["length_m"] is None else road["length_m"],
                    road["survey_count"],
                    road["pass_count"],
                )
            cursor = page["next_cursor"]
            if cursor is None:
                return

    def post_survey(self, document: Document, key: str | None) -> Posted:
        """Store one survey, without building."""
        headers = {} if key is None else {"Idempotency-Key": key}
        answer = self._send("POST", "/v1/surveys?build=false", document, headers)
        stored = answer.json()
        replayed = "idempotency-replayed" in answer.headers
        return Posted(stored["survey_id"], tuple(stored["roads"]), replayed)

    def post_trace(self, trace: Trace, key: str | None) -> Posted:
        """Store one survey whose values are sound already, without building."""
        return self.post_survey(survey_document(trace), key)

    def request_build(self, road_ids: Sequence[str] | None) -> BuildView:
        """Ask for a build of these roads, of all when None."""
        body = {"road_ids": None if road_ids is None else list(road_ids)}
        return _view(self._send("POST", "/v1/builds", body).json())

    def follow(self, build_id: str) -> Iterator[BuildView]:
        """The build's states by server-sent events; asked for anew when the stream breaks."""
        while True:
            for view in self._events(build_id):
                yield view
                if view.finished:
                    return
            view = self._asked_again(build_id)  # a proxy cut the stream, or the service restarts
            yield view
            if view.finished:
                return

    def reliability(self, version: int) -> Document:
        """How far a map version can be trusted."""
        found: Document = self._send("GET", f"/v1/maps/{version}/reliability").json()
        return found

    def coverage(
        self, *, bbox: str | None, version: int | None, cursor: str | None = None
    ) -> Document:
        """A page of stretches and the summary of all."""
        asked = {"bbox": bbox, "version": version, "cursor": cursor}
        query = urlencode({name: value for name, value in asked.items() if value is not None})
        page: Document = self._send("GET", f"/v1/coverage?{query}").json()
        return page

    def locate(self, document: Document) -> Document:
        """The fix of one window."""
        fix: Document = self.locate_response(document).json()
        return fix

    def locate_response(self, document: Document) -> httpx.Response:
        """The whole answer to one window: its body is the fix, its headers tell the timing."""
        return self._send("POST", "/v1/locate", document)

    def is_ready(self) -> bool:
        """Whether the service takes requests; False while nobody answers."""
        try:
            return self._client.get("/readyz").is_success
        except httpx.TransportError:
            return False

    def served_version(self) -> int | None:
        """The map version that the answering process has in memory."""
        version: int | None = self._send("GET", "/readyz").json()["map_version"]
        return version

    def _events(self, build_id: str) -> Iterator[BuildView]:
        try:
            with self._client.stream("GET", f"/v1/builds/{build_id}/events") as stream:
                if not stream.is_success:
                    return
                for line in stream.iter_lines():
                    if line.startswith("data:"):
                        yield _view(orjson.loads(line[5:]))
        except httpx.TransportError:
            return

    def _asked_again(self, build_id: str) -> BuildView:
        """The build as it stands, from a service that may be away for a moment."""
        deadline_s = time.monotonic() + PATIENCE_S
        while True:
            time.sleep(POLL_S)
            try:
                return _view(self._send("GET", f"/v1/builds/{build_id}").json())
            except Unreachable:
                if time.monotonic() > deadline_s:
                    raise

    def _send(
        self, method: str, path: str, body: Any = None, headers: dict[str, str] | None = None
    ) -> httpx.Response:
        sent = dict(headers or {})
        content = None if body is None else orjson.dumps(body)
        if content is not None:
            sent["Content-Type"] = "application/json"
            if len(content) >= PACKED_FROM_BYTES and method == "POST" and "/locate" not in path:
                content = gzip.compress(content, compresslevel=1)
                sent["Content-Encoding"] = "gzip"
        try:
            answer = self._client.request(method, path, content=content, headers=sent)
        except httpx.TransportError as error:
            raise Unreachable(self.url, error) from error
        if answer.is_success:
            return answer
        raise _refusal(answer)


def _refusal(answer: httpx.Response) -> Refused:
    """What a problem document says; the bare status when there is none."""
    try:
        problem = answer.json()
        places = [f"{each['pointer'] or '/'}: {each['detail']}" for each in problem["errors"]]
        return Refused(problem["code"], "; ".join(places) or problem["detail"])
    except (ValueError, KeyError, TypeError):
        return Refused(f"http-{answer.status_code}", answer.text[:200] or answer.reason_phrase)


def _view(document: Document) -> BuildView:
    problem = document.get("problem") or {}
    failed = document.get("failed_roads") or []
    return BuildView(
        build_id=document["id"],
        status=document["status"],
        roads_done=document["roads_done"],
        roads_total=document["roads_total"],
        map_version=document["map_version"],
        failed_roads=tuple(f"{each['road_id']}: {each['detail']}" for each in failed),
        problem=problem.get("detail"),
    )
