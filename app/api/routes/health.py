"""What machines ask: alive, ready, metrics."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST

from app.api.openapi import problems
from app.api.replies import reply
from app.api.schemas.health import Alive, Ready
from app.api.state import StateOf
from app.services.maps import active_version

router = APIRouter(tags=["operations"])


@router.get("/livez", response_model=Alive)
async def livez() -> Response:
    """The process answers; nothing else is looked at."""
    return reply({"status": "alive"})


@router.get("/readyz", response_model=Ready, responses=problems(503))
def readyz(state: StateOf) -> Response:
    """
    The store can be reached, so surveys can be posted; 503 when not.

    Ready without a map too: a new service has none. `map_version` is the one in memory here,
    `active_map_version` the one that the store names; they differ while a new map is loading.
    """
    index = state["maps"].current
    return reply(
        {
            "status": "ready",
            "map_version": index.version if index else None,
            "active_map_version": active_version(state["engine"]),
        }
    )


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}, "description": "Prometheus text format"}},
)
def metrics(state: StateOf) -> Response:
    """Prometheus metrics, over all API processes."""
    index = state["maps"].current
    body = state["metrics"].render(index.version if index else None)
    return Response(body, media_type=CONTENT_TYPE_LATEST)
