"""Windows in, fixes out: the hot path, in memory only."""

from __future__ import annotations

import asyncio
from time import perf_counter
from typing import Annotated, Any, cast

import orjson
from fastapi import APIRouter, Depends, Request
from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.answers import located_document
from app.api.content import raw_body, require_json
from app.api.errors import problem_of
from app.api.faults import Faults, invalid_input
from app.api.hot import HotResponse, HotRoute
from app.api.openapi import body_of, problems
from app.api.schemas.locate import BatchAnswer, BatchRequest, FixDocument, LocateRequest
from app.api.state import Limits, State, StateOf, current_map
from app.domain import Fix
from app.errors import Fault, InvalidInput
from app.numerics.index import MapIndex

hot_router = APIRouter(prefix="/v1", tags=["locate"], route_class=HotRoute)
router = APIRouter(prefix="/v1", tags=["locate"])

_window_adapter = TypeAdapter(LocateRequest)


@hot_router.post("/locate", response_model=FixDocument, responses=problems(413, 415, 422, 503))
async def locate_window(body: LocateRequest, request: Request) -> Response:
    """
    Locates one window: the answer is the position at its LAST sample.

    `status` is `off_map` when the window fits no mapped road. `Server-Timing` tells how long the
    matching took. Naming `state` tracks the vehicle: null with its first window, then the answer's
    `state` with each next one; nothing is kept here.
    `explain` adds why: which cells decided, what the runner-up was, every sample's residual.
    """
    state = cast("State", request.scope["state"])
    index = current_map(state)
    started = perf_counter()
    if body.explain:  # takes milliseconds: in a thread others are answered meanwhile
        fix, document = await run_in_threadpool(_located, index, body, state)
    else:
        fix, document = _located(index, body, state)
    matched_ms = (perf_counter() - started) * 1000
    state["metrics"].fix("off_map" if fix.off_map else "located")
    return HotResponse(
        orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY),
        (b"server-timing", b"match;dur=%.3f" % matched_ms),
    )


@router.post(
    "/locate/batch",
    response_model=BatchAnswer,
    openapi_extra=body_of(BatchRequest),
    responses=problems(413, 415, 422, 503),
    dependencies=[Depends(require_json)],
)
async def locate_batch(raw: Annotated[bytes, Depends(raw_body)], state: StateOf) -> Response:
    """
    Locates many windows; `fixes` holds one entry a window, in order.

    A bad window has a problem document in its place and spoils no other.
    """
    index = current_map(state)
    windows = await run_in_threadpool(_windows, raw, state["limits"])
    fixes = []
    for place, window in enumerate(windows):
        if isinstance(window, dict) and window.get("explain") is True:
            answer = await run_in_threadpool(_fix_or_problem, index, window, place, state)
        else:
            answer = _fix_or_problem(index, window, place, state)
        fixes.append(answer)
        # Between two windows whoever waits on the event loop gets it: a thread would hold the
        # interpreter for 5 ms at a time, this holds it for one window.
        await asyncio.sleep(0)
    return Response(
        orjson.dumps({"fixes": fixes}, option=orjson.OPT_SERIALIZE_NUMPY),
        media_type="application/json",
    )


def hot_route() -> HotRoute:
    """The route of the hot path, for the layer that stands before the framework."""
    route = hot_router.routes[0]
    assert isinstance(route, HotRoute)  # noqa: S101 - the router makes no other kind
    return route


def _windows(raw: bytes, limits: Limits) -> list[Any]:
    """The list of windows, none of them looked at yet."""
    try:
        body = from_json(raw)
    except ValueError as error:
        faults = Faults()
        faults.add("", f"Invalid JSON: {error}")
        raise faults.error() from None
    faults = Faults()
    if not isinstance(body, dict):
        faults.add("", "the body is no object")
        raise faults.error()
    for name in body.keys() - {"windows"}:
        faults.add(f"/{name}", f"unknown field {name!r}")
    windows = body.get("windows")
    if not isinstance(windows, list):
        faults.add("/windows", "a list of windows is missing")
    elif len(windows) > limits.max_batch_windows:
        faults.add("/windows", f"{len(windows)} windows; {limits.max_batch_windows} are the most")
    faults.raise_if_any()
    return cast("list[Any]", windows)


def _located(index: MapIndex, body: LocateRequest, state: State) -> tuple[Fix, dict[str, Any]]:
    return located_document(index, body, state["limits"], state["state_key"])


def _fix_or_problem(index: MapIndex, window: object, place: int, state: State) -> dict[str, Any]:
    try:
        try:
            body = _window_adapter.validate_python(window)
        except ValidationError as error:
            raise invalid_input(error) from None
        fix, document = _located(index, body, state)
    except InvalidInput as error:
        state["metrics"].fix("refused")
        return problem_of(_within(error, f"/windows/{place}"), "/v1/locate/batch")
    state["metrics"].fix("off_map" if fix.off_map else "located")
    return document


def _within(error: InvalidInput, prefix: str) -> InvalidInput:
    """The same faults, their pointers into the batch's body."""
    return InvalidInput([Fault(prefix + fault.pointer, fault.detail) for fault in error.faults])
