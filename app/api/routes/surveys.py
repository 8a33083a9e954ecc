"""Survey passes in, and looking after them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Path, Query, Request
from pydantic import BaseModel, Field
from starlette.responses import Response

from app.api.content import CSV, JSON, body_media_type
from app.api.csv_survey import trace_of_csv
from app.api.documents import accepted_document, samples_document, survey_document
from app.api.openapi import body_of, problems
from app.api.replies import reply
from app.api.schemas.fields import Id, Moment, Name, RoadId
from app.api.schemas.surveys import (
    Radio,
    SurveyAccepted,
    SurveyDeleted,
    SurveyDocument,
    SurveyPage,
    SurveyRequest,
    SurveySamples,
)
from app.api.state import EngineOf
from app.api.surveys import Described, trace_of_json
from app.services.ingest import accept_survey
from app.services.surveys import delete_survey, get_survey, list_surveys, survey_trace

router = APIRouter(prefix="/v1/surveys", tags=["surveys"])

CSV_EXAMPLE = "time_s,lon,lat,cell_id,rsrp_dbm\n0.0,-118.4919,34.0136,850:293,-110.6\n"
CSV_BODY = {CSV: {"schema": {"type": "string"}, "example": CSV_EXAMPLE}}

SurveyId = Annotated[Id, Path()]


@dataclass(frozen=True, slots=True)
class Posted:
    """A survey as it arrived, not parsed yet."""

    media_type: str
    raw: bytes
    described: Described
    idempotency_key: str | None


class DescriptionQuery(BaseModel):
    """What the query may say of a survey; a CSV body has no other place for it."""

    road_id: RoadId | None = None
    device: Name | None = None
    recorded_at: Moment | None = None
    reference_cell: Name | None = None
    radio: Radio | None = None
    build: bool = Field(default=True, description="False stores the survey and builds nothing.")


async def _posted(
    request: Request,
    query: Annotated[DescriptionQuery, Query()],
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=200)] = None,
) -> Posted:
    media_type = body_media_type(request.scope["headers"], (JSON, CSV))
    described = Described(**query.model_dump(exclude={"build"}))
    return Posted(media_type, await request.body(), described, idempotency_key)


@router.post(
    "",
    status_code=202,
    response_model=SurveyAccepted,
    openapi_extra=body_of(SurveyRequest, **CSV_BODY),
    responses=problems(400, 409, 413, 415, 422),
)
def post_survey(
    posted: Annotated[Posted, Depends(_posted)],
    query: Annotated[DescriptionQuery, Query()],
    engine: EngineOf,
) -> Response:
    """
    Stores one survey pass and queues the build of its roads; `Location` names the build.

    `text/csv` holds tidy rows (`time_s,lon,lat,cell_id,rsrp_dbm[,serving]`, columns found by name;
    rows of one time and place are one sample) and is described in the query. The same survey twice
    is 409, or with the same `Idempotency-Key` the first answer again.
    """
    trace = (trace_of_csv if posted.media_type == CSV else trace_of_json)(
        posted.raw, posted.described
    )
    accepted = accept_survey(
        engine, trace, idempotency_key=posted.idempotency_key, build=query.build
    )
    place = f"builds/{accepted.build_id}" if accepted.build_id else f"surveys/{accepted.survey_id}"
    headers = {"Location": f"/v1/{place}"}
    if accepted.replayed:
        headers["Idempotency-Replayed"] = "true"
    return reply(accepted_document(accepted), 202, headers=headers)


@router.get("", response_model=SurveyPage, responses=problems(404, 422))
def get_surveys(
    engine: EngineOf,
    road_id: Annotated[RoadId | None, Query()] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    cursor: str | None = None,
) -> Response:
    """Surveys in the order of their arrival, of one road or of all."""
    page = list_surveys(engine, road_id=road_id, limit=limit, cursor=cursor)
    surveys = [survey_document(survey) for survey in page.items]
    return reply({"surveys": surveys, "next_cursor": page.next_cursor})


@router.get("/{survey_id}", response_model=SurveyDocument, responses=problems(404))
def get_one_survey(survey_id: SurveyId, engine: EngineOf) -> Response:
    """One survey without its samples."""
    return reply(survey_document(get_survey(engine, survey_id)))


@router.get("/{survey_id}/samples", response_model=SurveySamples, responses=problems(404))
def get_samples(survey_id: SurveyId, engine: EngineOf) -> Response:
    """A survey's samples as they were accepted, in the shape they can be posted in."""
    return reply(samples_document(survey_trace(engine, survey_id)))


@router.delete("/{survey_id}", response_model=SurveyDeleted, responses=problems(404))
def remove_survey(survey_id: SurveyId, engine: EngineOf, *, build: bool = True) -> Response:
    """Forgets a survey and, unless `build=false`, queues the build that takes it out of the map."""
    build_id = delete_survey(engine, survey_id, build=build)
    headers = {"Location": f"/v1/builds/{build_id}"} if build_id else {}
    return reply({"survey_id": survey_id, "build_id": build_id}, headers=headers)
