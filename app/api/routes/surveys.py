"""Survey passes in, and looking after them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Header, Path, Query, Request
from pydantic import BaseModel, Field
from starlette.responses import Response

from app.api.content import CSV, JSON, KML, TEXT, body_media_type
from app.api.csv_survey import trace_of_csv
from app.api.documents import (
    accepted_document,
    samples_document,
    several_accepted_document,
    survey_document,
)
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
from app.api.upload import Upload, drives_of, is_own, store_drives
from app.formats.account import Account
from app.services.ingest import Accepted, accept_survey
from app.services.surveys import delete_survey, get_survey, list_surveys, survey_trace

router = APIRouter(prefix="/v1/surveys", tags=["surveys"])

CSV_EXAMPLE = "time_s,lon,lat,cell_id,rsrp_dbm\n0.0,-118.4919,34.0136,850:293,-110.6\n"
FILE_BODY: dict[str, Any] = {"schema": {"type": "string"}}
OTHER_BODIES: dict[str, dict[str, Any]] = {
    CSV: {**FILE_BODY, "example": CSV_EXAMPLE},
    TEXT: FILE_BODY,
    KML: FILE_BODY,
}

FileFormat = Literal[
    "tidy", "gnettrack", "gnettrack-kml", "opencellid", "geosubmit", "network-survey",
    "network-survey-json", "romes", "survey-json",
]  # fmt: skip

SurveyId = Annotated[Id, Path()]


@dataclass(frozen=True, slots=True)
class Posted:
    """What arrived, not parsed yet."""

    upload: Upload
    idempotency_key: str | None


class DescriptionQuery(BaseModel):
    """What the query may say of a survey; a CSV body has no other place for it."""

    road_id: RoadId | None = None
    device: Name | None = None
    recorded_at: Moment | None = None
    reference_cell: Name | None = None
    radio: Radio | None = None
    build: bool = Field(default=True, description="False stores the survey and builds nothing.")
    format: FileFormat | None = Field(
        default=None, description="Of a survey tool's file; absent: found by its content."
    )
    time_zone: Name = Field(default="UTC", description="Of times that a file writes without one.")
    keep_going: bool = Field(
        default=False, description="Takes the sound rows of a file that is broken in part."
    )


async def _posted(
    request: Request,
    query: Annotated[DescriptionQuery, Query()],
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=200)] = None,
) -> Posted:
    media_type = body_media_type(request.scope["headers"], (JSON, CSV, TEXT, KML))
    described = Described(**query.model_dump(include=set(Described.__slots__)))
    raw = await request.body()
    upload = Upload(media_type, raw, described, query.format, query.time_zone, query.keep_going)
    return Posted(upload, idempotency_key)


@router.post(
    "",
    status_code=202,
    response_model=SurveyAccepted,
    openapi_extra=body_of(SurveyRequest, **OTHER_BODIES),
    responses=problems(400, 409, 413, 415, 422),
)
def post_survey(
    posted: Annotated[Posted, Depends(_posted)],
    query: Annotated[DescriptionQuery, Query()],
    engine: EngineOf,
) -> Response:
    """
    Stores a survey pass, or every drive of a survey tool's file, and queues the build.

    `application/json` is one pass in columns. `text/csv` holds tidy rows
    (`time_s,lon,lat,cell_id,rsrp_dbm[,serving]`, columns found by name; rows of one time and place
    are one sample) and is described in the query. Files of survey tools are known by their content
    (`format` overrides): `text/csv` or `text/plain` for tables, `application/json` for geosubmit
    and Network Survey, KML. `Location` names the build. The same survey twice is 409, or with the
    same `Idempotency-Key` the first answer again.
    """
    upload, account = posted.upload, Account()
    if is_own(upload):
        read = trace_of_csv if upload.media_type == CSV else trace_of_json
        trace = read(upload.raw, upload.described)
        accepted = accept_survey(
            engine, trace, idempotency_key=posted.idempotency_key, build=query.build
        )
        return _answer([accepted], account)
    drives = drives_of(upload, account)
    several = store_drives(
        engine, drives, account, idempotency_key=posted.idempotency_key, build=query.build
    )
    return _answer(several, account)


def _answer(several: list[Accepted], account: Account) -> Response:
    """202 with the fixed fields, and one entry a drive when there are several."""
    if len(several) == 1:
        document = accepted_document(several[0])
    else:
        document = several_accepted_document(several, account.dropped)
    build_id = document["build_id"]
    place = f"builds/{build_id}" if build_id else f"surveys/{document['survey_id']}"
    headers = {"Location": f"/v1/{place}"}
    if all(accepted.replayed for accepted in several):
        headers["Idempotency-Replayed"] = "true"
    return reply(document, 202, headers=headers)


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
