"""Builds and the map versions that they make."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import AwareDatetime, BaseModel, Field

from app.api.schemas.fields import STRICT, RoadId


class BuildRequest(BaseModel):
    """Which roads to build anew; `null` means all."""

    model_config = STRICT

    road_ids: list[RoadId] | None = None
    activate: bool = Field(default=True, description="Make the new map version the active one.")


class FailedRoadDocument(BaseModel):
    """A road of a build that got no new model, and why; the others are not touched by it."""

    road_id: str
    code: str
    detail: str


class BuildDocument(BaseModel):
    """A build as it stands."""

    id: str
    status: Literal["accepted", "running", "successful", "failed", "dismissed"]
    progress: float = Field(ge=0, le=1)
    roads_done: int
    roads_total: int
    map_version: int | None = Field(description="The version it made; null until it is successful.")
    problem: dict[str, Any] | None = Field(description="Why it failed, as RFC 9457 members.")
    failed_roads: list[FailedRoadDocument]
    activate: bool
    created_at: AwareDatetime
    started_at: AwareDatetime | None
    finished_at: AwareDatetime | None


class BuildPage(BaseModel):
    """Some builds, newest first."""

    builds: list[BuildDocument]
    next_cursor: str | None


class MapDocument(BaseModel):
    """A published map version."""

    version: int
    active: bool
    created_at: AwareDatetime
    activated_at: AwareDatetime | None
    road_count: int
    build_id: str


class MapList(BaseModel):
    """All map versions, newest first."""

    maps: list[MapDocument]


class MapChoice(BaseModel):
    """The version to serve; an older one is the way back."""

    model_config = STRICT

    version: int = Field(ge=1, le=2**31 - 1)
