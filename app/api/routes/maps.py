"""Map versions: which there are, which is served, and changing that."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Path, Request
from sqlalchemy import Engine
from starlette.responses import Response

from app.api.content import require_json
from app.api.documents import map_document
from app.api.openapi import problems
from app.api.reliability import reliability_document
from app.api.replies import reply, unless_same
from app.api.schemas.builds import MapChoice, MapDocument, MapList
from app.api.schemas.reliability import ReliabilityDocument
from app.api.state import EngineOf, StateOf
from app.errors import NoMap, NotFound
from app.services.maps import activate, active_version, get_map, list_maps

router = APIRouter(prefix="/v1/maps", tags=["maps"])

HIGHEST = 2**31 - 1  # what every database's integer holds

VersionOf = Annotated[
    str, Path(description="Number of a map version, or `active`.", examples=["active", "7"])
]


@router.get("", response_model=MapList)
def get_maps(request: Request, engine: EngineOf) -> Response:
    """All map versions, newest first."""
    versions = list_maps(engine)
    active = next((version.version for version in versions if version.active), None)
    document = {"maps": [map_document(version) for version in versions]}
    return unless_same(request, f"map-{active}", document)


@router.get("/active", response_model=MapDocument, responses=problems(503))
def get_active_map(request: Request, state: StateOf) -> Response:
    """The map version that is served."""
    engine = state["engine"]
    version = active_version(engine)
    if version is None:
        raise NoMap
    state["maps"].keep_word(engine, version)
    return unless_same(request, f"map-{version}", map_document(get_map(engine, version)))


@router.put(
    "/active",
    response_model=MapDocument,
    responses=problems(404, 415, 422),
    dependencies=[Depends(require_json)],
)
def put_active_map(body: MapChoice, state: StateOf) -> Response:
    """
    Serves another version, older ones included.

    This process serves it when the answer comes; other processes follow within the poll interval.
    """
    chosen = activate(state["engine"], body.version)
    state["maps"].refresh(state["engine"])
    return reply(map_document(chosen))


@router.get(
    "/{version}/reliability", response_model=ReliabilityDocument, responses=problems(404, 503)
)
def get_reliability(version: VersionOf, request: Request, engine: EngineOf) -> Response:
    """
    How often a version's probabilities came true on windows held out when it was built.

    Versions made before this was measured, or from too little, have nulls and a `note`.
    """
    found = get_map(engine, _number(engine, version))
    return unless_same(request, f"map-{found.version}", reliability_document(found))


def _number(engine: Engine, version: str) -> int:
    """
    Of the version that a path names.

    Raises:
        NotFound: It is no number that a version can have.
        NoMap: The active one was asked for, and there is none.
    """
    if version == "active":
        active = active_version(engine)
        if active is None:
            raise NoMap
        return active
    if not (version.isascii() and version.isdigit()) or len(version) > len(str(HIGHEST)):
        raise NotFound("map version", version)
    if int(version) > HIGHEST:
        raise NotFound("map version", version)
    return int(version)
