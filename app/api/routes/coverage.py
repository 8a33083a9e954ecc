"""Where to drive next."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request
from pydantic import BaseModel, Field
from starlette.responses import Response

from app.api.box import BBOX, bounds_of_query
from app.api.content import GEOJSON, prefers_json
from app.api.coverage import coverage_document
from app.api.openapi import problems, reference
from app.api.replies import unless_same
from app.api.schemas.coverage import CoverageCollection
from app.api.state import EngineOf
from app.services.coverage import survey_coverage

router = APIRouter(prefix="/v1/coverage", tags=["maps"])


class CoverageQuery(BaseModel):
    """Which stretches to list."""

    bbox: str | None = BBOX
    version: int | None = Field(
        default=None, ge=1, le=2**31 - 1, description="Another map than the active one."
    )
    limit: int = Field(default=1000, ge=1, le=1000)
    cursor: str | None = None


@router.get(
    "",
    response_model=CoverageCollection,
    responses={
        200: {"content": {GEOJSON: {"schema": reference(CoverageCollection)}}},
        **problems(404, 406, 422),
    },
)
def get_coverage(
    request: Request,
    engine: EngineOf,
    query: Annotated[CoverageQuery, Query()],
    json: Annotated[bool, Depends(prefers_json)],
) -> Response:
    """
    What is known of the surveys along every stretch, and where the next drive helps most.

    GeoJSON, also under the name of JSON. One line a sub-segment, and one a road that the map does
    not have yet; the summary is of all of them, whatever the page.
    """
    found = survey_coverage(
        engine,
        version=query.version,
        bbox=bounds_of_query(query.bbox) if query.bbox else None,
        limit=query.limit,
        cursor=query.cursor or None,
    )
    tag = f"coverage-{found.version}"
    return unless_same(request, tag, coverage_document(found), geojson=not json)
