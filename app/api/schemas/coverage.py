"""Coverage: what is known of the surveys along each stretch, and where to drive next."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

from app.api.schemas.roads import LineString, MultiLineString


class CoverageProperties(BaseModel):
    """
    The surveys along one sub-segment, or along a whole road that the map does not have yet.

    Counts are those of the map's build. All are null of a map that was built before coverage was
    kept.
    """

    road_id: str
    name: str | None
    segment_index: int | None = Field(description="null: a whole road without a model.")
    start_m: float = Field(description="Chainage.")
    end_m: float
    length_m: float
    passes: int | None
    forward: int | None = Field(description="Passes in the direction of the road's line.")
    backward: int | None
    days: int | None = Field(description="Different dates; passes without one count as one day.")
    devices: int | None = Field(description="Different devices; unnamed ones count as one.")
    cells: int | None = Field(description="Cells mapped on it.")
    cells_per_sample: float | None = Field(description="Cells that one sample is expected to hear.")
    last_surveyed_at: datetime | None
    spread_db: float | None = Field(description="Of a new reading about the fitted curves.")
    road_right: float | None = Field(
        description="Share of windows that found their road in tests with so many passes."
    )
    expected_error_m: float | None = Field(
        description="Median error to expect of a window of `window_m` that ends here."
    )


class CoverageFeature(BaseModel):
    """A GeoJSON Feature (RFC 7946)."""

    type: Literal["Feature"] = "Feature"
    id: str
    geometry: LineString | MultiLineString | None = Field(
        description="null: nobody drew or drove the road yet."
    )
    properties: CoverageProperties


class LengthByPasses(BaseModel):
    """Metres of road by the number of passes along them."""

    never: float
    once: float
    twice: float
    more: float = Field(description="Three times and more.")
    unknown: float = Field(description="Built before coverage was kept.")


class ErrorPercentiles(BaseModel):
    """Of the expected error over the driven length; null when nothing was driven."""

    p10: float | None
    p50: float | None
    p90: float | None


class WorthADrive(BaseModel):
    """Neighbouring stretches of one road on which a drive helps."""

    road_id: str
    start_m: float
    end_m: float
    length_m: float
    gain_m: float = Field(description="What one drive takes off the error, wrong roads included.")
    expected_error_m: float | None
    reason: str
    geometry: LineString | MultiLineString | None


class CoverageSummary(BaseModel):
    """All stretches that were asked for, those of other pages included."""

    length_m: float
    length_m_by_passes: LengthByPasses
    both_directions: float | None = Field(description="Share of the driven length, 0..1.")
    several_days: float | None = Field(description="The same of driven on two days or more.")
    expected_error_m: ErrorPercentiles
    most_worth_a_drive: list[WorthADrive] = Field(description="The best first, ten at most.")


class CoverageCollection(BaseModel):
    """A GeoJSON FeatureCollection (RFC 7946) with a page's needs and a summary beside it."""

    type: Literal["FeatureCollection"] = "FeatureCollection"
    features: list[CoverageFeature]
    map_version: int | None
    window_m: float = Field(description="Length of the windows that the expected error is of.")
    summary: CoverageSummary
    next_cursor: str | None
