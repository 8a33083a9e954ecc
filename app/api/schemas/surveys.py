"""Surveys in, and what is known of them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AwareDatetime, BaseModel, Field

from app.api.schemas.fields import (
    NO_CONTROL_CHARACTERS,
    STRICT,
    CellId,
    Moment,
    Name,
    Numbers,
    RoadId,
    Rows,
)

SurveyCell = Annotated[CellId, Field(pattern=NO_CONTROL_CHARACTERS)]
Radio = Literal["lte", "nr"]


class SurveyRequest(BaseModel):
    """One survey pass, oldest sample first: one row a sample in every list."""

    model_config = STRICT

    road_id: RoadId | None = Field(
        default=None, description="The road that was driven; absent: the service finds it."
    )
    device: Name | None = Field(default=None, examples=["pixel4a"])
    recorded_at: Moment | None = Field(
        default=None,
        description="When the first sample was taken, with its zone.",
        examples=["2021-05-08T10:12:00Z"],
    )
    reference_cell: SurveyCell | None = Field(
        default=None, description="The macro cell; one of `cells`."
    )
    radio: Radio | None = Field(
        default=None,
        description="Narrows the plausible RSRP to LTE's -140..-44 or NR's -156..-31 dBm; "
        "absent: -156..-31.",
    )
    cells: list[SurveyCell] = Field(
        fail_fast=True, description="Cell ids, one a column of `rsrp_dbm`."
    )
    global_ids: dict[SurveyCell, SurveyCell] | None = Field(
        default=None,
        description="What some of `cells` are called worldwide; kept, not matched.",
        examples=[{"850:293": "310-410-26385408"}],
    )
    time_s: Numbers = Field(description="Seconds, non-decreasing, any origin.")
    lon: Numbers = Field(description="WGS 84, degrees east.")
    lat: Numbers = Field(description="WGS 84, degrees north.")
    rsrp_dbm: Rows


class OneSurveyAccepted(BaseModel):
    """A survey is stored, and its build is queued unless `build=false` asked for none."""

    survey_id: str
    build_id: str | None
    roads: list[str] = Field(
        description="Those it certainly runs along; a build finds the rest of a loose drive."
    )
    samples: int
    dropped: dict[str, int] = Field(description="Rows left out, by reason.")


class SurveyAccepted(OneSurveyAccepted):
    """
    What was posted is stored, and its build is queued unless `build=false` asked for none.

    Of a file that holds several drives each is a survey: `survey_id` is then the first one,
    `build_id` the last one's, `roads`, `samples` and `dropped` are those of the whole file.
    """

    surveys: list[OneSurveyAccepted] | None = Field(
        default=None, description="One a drive; absent unless the file holds several."
    )


class SurveyDocument(BaseModel):
    """What is known of a stored survey."""

    id: str
    roads: list[str] = Field(description="Roads that it runs along.")
    device: str | None
    recorded_at: AwareDatetime | None
    received_at: AwareDatetime
    reference_cell: str | None
    cells: list[str]
    samples: int
    dropped: dict[str, int] = Field(description="Samples left out, by reason.")
    build_id: str | None = Field(description="The build that takes it in; null: none was asked.")


class SurveyPage(BaseModel):
    """Some surveys in the order of their arrival."""

    surveys: list[SurveyDocument]
    next_cursor: str | None = Field(
        description="Send as `cursor` for the next page; null: the end."
    )


class SurveyDeleted(BaseModel):
    """A survey is gone, and the build that takes it out of the map is queued."""

    survey_id: str
    build_id: str | None


class SurveySamples(BaseModel):
    """A survey as it was accepted, in the shape it can be posted in."""

    road_id: str | None
    device: str | None
    recorded_at: AwareDatetime | None
    reference_cell: str | None
    cells: list[str]
    global_ids: dict[str, str] = Field(description="What some of `cells` are called worldwide.")
    time_s: list[float]
    lon: list[float]
    lat: list[float]
    rsrp_dbm: list[list[float | None]]
