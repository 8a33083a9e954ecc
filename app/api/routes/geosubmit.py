"""Ichnaea's geosubmit, so that survey apps that know it upload straight in."""

from __future__ import annotations

import io
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header
from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import Response

from app.api.content import raw_body, require_json
from app.api.openapi import body_of, problems
from app.api.replies import reply
from app.api.state import EngineOf
from app.api.surveys import Described
from app.api.upload import read_all, store_drives
from app.errors import DuplicateSurvey
from app.formats.account import Account, EmptyFile
from app.formats.options import Options
from app.formats.sniff import GEOSUBMIT, Sniffed

router = APIRouter(prefix="/v2", tags=["surveys"])


class GeosubmitReport(BaseModel):
    """One position with what was heard there; Ichnaea's documentation has every field."""

    model_config = ConfigDict(extra="allow")

    timestamp: float | None = Field(default=None, description="Unix milliseconds.")
    position: dict[str, Any] | None = None
    cellTowers: list[dict[str, Any]] | None = None  # noqa: N815 - the interface's own name


class GeosubmitRequest(BaseModel):
    """Reports of one device, in any order."""

    items: list[GeosubmitReport]


class GeosubmitAnswer(BaseModel):
    """Nothing: the reports were taken."""


@router.post(
    "/geosubmit",
    response_model=GeosubmitAnswer,
    openapi_extra=body_of(GeosubmitRequest),
    responses=problems(400, 413, 415, 422),
    dependencies=[Depends(require_json)],
)
def post_geosubmit(
    raw: Annotated[bytes, Depends(raw_body)],
    engine: EngineOf,
    x_nickname: Annotated[str | None, Header(max_length=200)] = None,
    user_agent: Annotated[str | None, Header()] = None,
    key: str | None = None,  # noqa: ARG001 - Ichnaea's API key: taken and not looked at
) -> Response:
    """
    Takes reports as `POST /v2/geosubmit` of Ichnaea does; `{}` when they are taken.

    Reports in a row make a drive, which is stored as a survey with the build that it calls for;
    reports that make none (a single one, wifi only) are taken and left out. The device is
    `X-Nickname`, else the user agent. The same reports again are answered like the first time.
    """
    account = Account()
    options = Options(device=x_nickname or (user_agent or "")[:200] or None)
    try:
        drives = read_all(
            io.BytesIO(raw), Sniffed(GEOSUBMIT), options, account, Described(), keep_going=True
        )
        store_drives(engine, drives, account, idempotency_key=None, build=True)
    except (EmptyFile, DuplicateSurvey):
        pass  # nothing new, and nothing that the client could mend
    return reply({})
