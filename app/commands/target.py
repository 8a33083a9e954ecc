"""What the client-side commands talk to: a service over HTTP, or a data folder directly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any, Protocol

import numpy as np

from app.domain import Road, Trace, Window
from app.errors import RoadprintError

TERMINAL = frozenset({"successful", "failed", "dismissed"})

Document = dict[str, Any]


class Refused(RoadprintError):
    """The other side refused a request; ``code`` is its word for why, ``detail`` its sentence."""

    def __init__(self, code: str, detail: str) -> None:
        super().__init__(f"{code}: {detail}")
        self.code = code
        self.detail = detail


class Unreachable(RoadprintError):
    """Nobody answers there."""

    code = "unreachable"
    title = "The service does not answer"

    def __init__(self, url: str, reason: object) -> None:
        super().__init__(f"{url} does not answer ({reason}); is `roadprint serve` running there?")


@dataclass(frozen=True, slots=True)
class Posted:
    """What became of a survey: stored now, or ``replayed``: stored by an earlier import."""

    survey_id: str
    roads: tuple[str, ...]
    replayed: bool


@dataclass(frozen=True, slots=True)
class BuildView:
    """A build as a command shows it; ``failed_roads`` has a sentence a road."""

    build_id: str
    status: str
    roads_done: int
    roads_total: int
    map_version: int | None
    failed_roads: tuple[str, ...]
    problem: str | None

    @property
    def finished(self) -> bool:
        """Nothing more will happen to it."""
        return self.status in TERMINAL


@dataclass(frozen=True, slots=True)
class RoadView:
    """A road as a command lists it; ``length_m`` is None while nobody drew or built it."""

    road_id: str
    name: str | None
    length_m: float | None
    survey_count: int
    pass_count: int


class Target(Protocol):
    """Everything the commands ask for. Every method may raise `Refused` or `Unreachable`."""

    def put_road(self, road: Road) -> None:
        """Create a road, or set its name and line."""

    def list_roads(self) -> Iterator[RoadView]:
        """All roads by id, as the active map has them."""

    def post_survey(self, document: Document, key: str | None) -> Posted:
        """Store one survey, without building. ``key`` makes a second post of it harmless."""

    def post_trace(self, trace: Trace, key: str | None) -> Posted:
        """Store one survey whose values are sound already, without building."""

    def request_build(self, road_ids: Sequence[str] | None) -> BuildView:
        """Ask for a build of these roads, of all when None."""

    def follow(self, build_id: str) -> Iterator[BuildView]:
        """The build's states as they change; the last one is finished."""

    def reliability(self, version: int) -> Document:
        """How far a map version can be trusted, as ``GET /v1/maps/{version}/reliability``."""

    def coverage(
        self, *, bbox: str | None, version: int | None, cursor: str | None = None
    ) -> Document:
        """A page of stretches and the summary of all, as ``GET /v1/coverage``."""

    def locate(self, document: Document) -> Document:
        """The fix of one window."""


def survey_document(trace: Trace) -> Document:
    """A trace in the shape of ``POST /v1/surveys``; NaN becomes None."""
    document: Document = {
        "cells": list(trace.cells),
        "time_s": trace.time_s.tolist(),
        "lon": trace.lon.tolist(),
        "lat": trace.lat.tolist(),
        "rsrp_dbm": _rows(trace.rsrp_dbm),
    }
    told = {
        "road_id": trace.road_id,
        "device": trace.device,
        "recorded_at": trace.recorded_at.isoformat() if trace.recorded_at else None,
        "reference_cell": trace.reference_cell,
        "global_ids": dict(trace.global_ids) or None,
    }
    return document | {name: value for name, value in told.items() if value is not None}


def window_document(window: Window) -> Document:
    """A window in the shape of ``POST /v1/locate``; NaN becomes None."""
    return {
        "cells": list(window.cells),
        "distance_m": window.distance_m.tolist(),
        "rsrp_dbm": _rows(window.rsrp_dbm),
    }


def road_document(road: Road) -> Document:
    """A road in the shape of ``PUT /v1/roads/{road_id}``."""
    document: Document = {}
    if road.name is not None:
        document["name"] = road.name
    if road.line is not None:
        coordinates = np.stack([road.line.lon, road.line.lat], axis=1).tolist()
        document["line"] = {"type": "LineString", "coordinates": coordinates}
    return document


def _rows(rsrp_dbm: np.ndarray) -> list[list[float | None]]:
    rounded = np.round(rsrp_dbm.astype(float), 4)  # a float32 of 140 dB holds no more decimals
    return [[None if isnan(level) else level for level in row] for row in rounded.tolist()]
