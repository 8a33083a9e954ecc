"""Windows in, fixes out."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.api.problems import ProblemDocument
from app.api.schemas.explanation import ExplanationDocument
from app.api.schemas.fields import STRICT, CellIds, Numbers, Rows

MAX_DISTANCE_ERROR = 0.1  # beyond it nothing is left of an odometer


class LocateRequest(BaseModel):
    """
    What a vehicle heard over its last metres, oldest sample first.

    The way is told by `distance_m`, or by `time_s` and `speed_mps` together.
    """

    model_config = STRICT

    cells: CellIds = Field(description="Cell ids, one a column of `rsrp_dbm`.")
    rsrp_dbm: Rows
    distance_m: Numbers | None = Field(
        default=None, description="Travelled distance, metres, non-decreasing, any origin."
    )
    time_s: Numbers | None = Field(
        default=None, description="Seconds, non-decreasing, any origin; needs `speed_mps`."
    )
    speed_mps: float | Numbers | None = Field(
        default=None, description="Speed, one number for the window or one a sample."
    )
    distance_error: Annotated[float, Field(ge=0, le=MAX_DISTANCE_ERROR)] | None = Field(
        default=None,
        description=(
            "Share by which the way may be told too long or too short, one standard deviation: "
            "0.01 for an odometer good to 1 %, 0 for an exact one. Absent or null: nobody knows."
        ),
    )
    confidence: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.68, description="Confidence that `accuracy_m` is given at."
    )
    max_candidates: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Most candidates answered; absent or null: all of them."
    )
    explain: bool = Field(
        default=False,
        description="Adds `explanation`: what decided, the runner-up, and every sample's residual.",
    )
    state: str | None = Field(
        default=None,
        description=(
            "Tracks the vehicle: null or empty with its first window, then the `state` of the "
            "answer to its window before. Absent: this window is located by itself."
        ),
    )
    travelled_m: Annotated[float, Field(ge=0)] | None = Field(
        default=None,
        description=(
            "With `state`: metres from the last sample of the window before to this one's. Absent "
            "or null: by `distance_m` (or `time_s`) where it runs on from that window; else the "
            "windows follow one another back to back."
        ),
    )


class FixRoad(BaseModel):
    """The most probable road."""

    id: str
    posterior: float


class FixSegment(BaseModel):
    """The most probable sub-segment, as a stretch of chainage."""

    index: int
    posterior: float
    start_m: float
    end_m: float


class FixPosition(BaseModel):
    """Where the window's last sample was."""

    lon: float
    lat: float
    chainage_m: float = Field(description="Metres along the road's line.")
    direction: Literal["forward", "backward"] = Field(
        description="Of travel; `forward` is the way of the road's line."
    )
    heading_deg: float = Field(description="Of travel, clockwise from north.")


class FixCandidate(BaseModel):
    """One sub-segment and direction that the window may end in."""

    road_id: str
    segment_index: int
    direction: Literal["forward", "backward"]
    posterior: float
    lon: float
    lat: float
    chainage_m: float


class FixDocument(BaseModel):
    """
    The answer to a window.

    The posteriors of all candidates and `off_map_posterior` sum to 1 (unless `max_candidates` cut
    the list). `off_map` answers carry no road, segment, position or accuracy.
    """

    status: Literal["located", "off_map"]
    map_version: int
    road: FixRoad | None
    segment: FixSegment | None
    position: FixPosition | None
    accuracy_m: float | None = Field(
        description="Radius about the position that holds `confidence` of the posterior, metres."
    )
    confidence: float
    candidates: list[FixCandidate]
    off_map_posterior: float
    device_offset_db: float = Field(description="How much louder this device hears than the map.")
    samples_used: int
    cells_used: int
    cells_unknown: list[str] = Field(description="Cells of the window that the map does not have.")
    state: str = Field(
        default="",
        description="Only when the request named `state`: send it with the vehicle's next window.",
    )
    explanation: ExplanationDocument | None = Field(
        default=None, description="Only when the request asked to `explain`."
    )


class BatchRequest(BaseModel):
    """Many windows at once."""

    model_config = STRICT

    windows: list[LocateRequest]


class BatchAnswer(BaseModel):
    """One entry a window, in order: a fix, or the problem of that window alone."""

    fixes: list[FixDocument | ProblemDocument]
