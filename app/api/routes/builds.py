"""Builds: asking for them, watching them, calling them off."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Path, Query
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response, StreamingResponse

from app.api.content import require_json
from app.api.documents import build_document
from app.api.events import TERMINAL, build_events
from app.api.openapi import problems
from app.api.replies import reply
from app.api.schemas.builds import BuildDocument, BuildPage, BuildRequest
from app.api.schemas.fields import Id
from app.api.state import EngineOf, StateOf
from app.services.builds import dismiss_build, get_build, list_builds, request_build

router = APIRouter(prefix="/v1/builds", tags=["builds"])

BuildId = Annotated[Id, Path()]


@router.post(
    "",
    status_code=202,
    response_model=BuildDocument,
    responses=problems(404, 409, 415, 422),
    dependencies=[Depends(require_json)],
)
def post_build(body: BuildRequest, engine: EngineOf) -> Response:
    """Queues a build of these roads, or of all of them; `Location` names it."""
    build = request_build(engine, body.road_ids, activate=body.activate)
    return reply(build_document(build), 202, headers={"Location": f"/v1/builds/{build.id}"})


@router.get("", response_model=BuildPage, responses=problems(422))
def get_builds(
    engine: EngineOf,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    cursor: str | None = None,
) -> Response:
    """Builds, newest first."""
    page = list_builds(engine, limit=limit, cursor=cursor)
    builds = [build_document(build) for build in page.items]
    return reply({"builds": builds, "next_cursor": page.next_cursor})


@router.get("/{build_id}", response_model=BuildDocument, responses=problems(404))
def get_one_build(build_id: BuildId, state: StateOf) -> Response:
    """A build as it stands; when it has made the active map, that map is served already."""
    build = get_build(state["engine"], build_id)
    state["maps"].keep_word(state["engine"], build.map_version)
    return reply(build_document(build))


@router.delete("/{build_id}", response_model=BuildDocument, responses=problems(404))
def remove_build(build_id: BuildId, engine: EngineOf) -> Response:
    """Dismisses a build that is not finished; a finished one stays as it is."""
    return reply(build_document(dismiss_build(engine, build_id)))


@router.get(
    "/{build_id}/events",
    responses={
        200: {"content": {"text/event-stream": {}}, "description": "One event a change."},
        204: {"description": "A reconnecting reader has seen the end already."},
        **problems(404),
    },
    response_class=StreamingResponse,
)
async def get_events(
    build_id: BuildId,
    state: StateOf,
    last_event_id: Annotated[str | None, Header()] = None,
) -> Response:
    """
    Streams a build as server-sent events: `data` is the build, the `id` its status.

    The stream ends with the build. A browser that reconnects after the end gets 204 and stops.
    """
    build = await run_in_threadpool(get_build, state["engine"], build_id)
    if last_event_id == build.status and build.status in TERMINAL:
        return Response(status_code=204)
    return StreamingResponse(
        build_events(state, build),
        media_type="text/event-stream",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )
