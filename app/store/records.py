"""Frozen answers of the store that are no radio nouns: summaries, builds, versions, pages."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Generic, Literal, NamedTuple, TypeVar

from app.domain import Calibration, Line

T = TypeVar("T")

BuildStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]
Placing = Literal["given", "waiting", "found", "lost"]
UNFINISHED: tuple[BuildStatus, ...] = ("accepted", "running")


@dataclass(frozen=True, slots=True)
class Page(Generic[T]):
    """Some of a list in a stable order; ``next_cursor`` fetches what follows, None at the end."""

    items: tuple[T, ...]
    next_cursor: str | None


@dataclass(frozen=True, slots=True)
class Bounds:
    """A box in degrees; ``west > east`` when it holds the antimeridian."""

    west: float
    south: float
    east: float
    north: float


@dataclass(frozen=True, slots=True)
class SurveySummary:
    """A stored survey without its samples; ``roads`` are the roads it runs along."""

    survey_id: str
    roads: tuple[str, ...]
    device: str | None
    recorded_at: datetime | None
    received_at: datetime
    reference_cell: str | None
    cells: tuple[str, ...]
    samples: int
    dropped: dict[str, int]
    build_id: str | None


class RoadOutcome(NamedTuple):
    """How one road of a build ended: ``built``, ``gone`` (no surveys any more) or ``failed``."""

    state: Literal["built", "gone", "failed"]
    code: str | None = None
    detail: str | None = None


class FailedRoad(NamedTuple):
    """A road of a build that has no new model, and why."""

    road_id: str
    code: str
    detail: str


@dataclass(frozen=True, slots=True)
class BuildState:
    """
    A build as it stands.

    ``progress`` is ``roads_done / roads_total`` (1.0 when finished); ``problem`` is an RFC 9457
    object without status, only of a failed build.
    """

    id: str
    status: BuildStatus
    progress: float
    roads_done: int
    roads_total: int
    map_version: int | None
    problem: dict[str, Any] | None
    failed_roads: tuple[FailedRoad, ...]
    activate: bool
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None


@dataclass(frozen=True, slots=True)
class MapVersion:
    """A published map; ``activated_at`` is the last time it became the active one."""

    version: int
    created_at: datetime
    activated_at: datetime | None
    active: bool
    road_count: int
    build_id: str
    calibration: Calibration = field(default_factory=Calibration)


@dataclass(frozen=True, slots=True)
class RoadSummary:
    """
    A road as a list shows it.

    ``line`` is the one that was set, else its model's; None before either. The counts of passes
    and segments and ``length_m`` are its model's in the map version asked for (0, 0 and None
    without one); ``survey_count`` counts what is stored now. ``model_version`` is the map version
    whose build made the model.
    """

    road_id: str
    name: str | None
    line: Line | None
    length_m: float | None
    pass_count: int
    survey_count: int
    segment_count: int
    model_version: int | None
    cells: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CellSummary:
    """Where a cell is mapped in one map version; levels are of the fitted curves, dBm."""

    cell: str
    road_count: int
    segment_count: int
    min_rsrp_dbm: float | None
    max_rsrp_dbm: float | None
    mean_rsrp_dbm: float | None
