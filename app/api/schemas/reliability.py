"""How far a map's probabilities can be trusted."""

from __future__ import annotations

from pydantic import BaseModel, Field


class ReliabilityPoint(BaseModel):
    """A bin of windows by the posterior of their road."""

    posterior: float = Field(description="Mean of the answers' `road.posterior`, on-map share.")
    right: float = Field(description="Share of them whose road was the true one.")
    windows: int


class CoveragePoint(BaseModel):
    """How often a radius held the truth."""

    confidence: float = Field(description="That the radius was asked at.")
    share: float = Field(description="Of windows whose true place lay within it.")


class RoadReliability(BaseModel):
    """Of the road and its posterior."""

    right: float | None = Field(description="Share of windows whose most probable road was right.")
    ece: float | None = Field(
        description="Expected calibration error: mean distance of `right` from `posterior`, 0..1."
    )
    curve: list[ReliabilityPoint] = Field(description="Ten bins; those without windows left out.")


class SegmentReliability(BaseModel):
    """Of the sub-segment that holds the position; null in versions made before it was measured."""

    right: float | None = Field(description="Share of windows whose truth lay in it.")
    ece: float | None = Field(
        description="Expected calibration error of `segment.posterior`, on-map share; as of the "
        "road: mean distance of `right` from it over ten bins, 0..1."
    )


class PositionReliability(BaseModel):
    """Of the position and its radius."""

    median_m: float | None = Field(description="Distance from the truth: half lie within it.")
    p90_m: float | None = Field(description="Nine in ten lie within it.")
    coverage: list[CoveragePoint]


class OffMapReliability(BaseModel):
    """Of being off the map."""

    refused: float | None = Field(description="Share of windows of the map's roads refused.")
    strangers_refused: float | None = Field(
        description="Share of windows refused in the map without their road, as they should be."
    )
    auroc: float | None = Field(description="How well the two are told apart: 0.5 not, 1 always.")


class CalibrationParameter(BaseModel):
    """A number that the held-out windows chose, or its default."""

    value: float | list[float]
    unit: str
    meaning: str


class ReliabilityDocument(BaseModel):
    """
    What a map version answered to windows that its curves had not seen, when it was built.

    All figures are null, and the lists empty, where nothing was measured; `note` says why.
    """

    map_version: int
    note: str | None = Field(description="What to know before believing the figures.")
    window_count: int = Field(description="Held-out windows asked for.")
    measured_count: int = Field(
        description=(
            "Of these, driven: on another day than their curves or, where all passes of a road are "
            "of one day, in another pass; the rest are drawn."
        )
    )
    road: RoadReliability
    segment: SegmentReliability
    position: PositionReliability
    off_map: OffMapReliability
    calibration: dict[str, CalibrationParameter]
