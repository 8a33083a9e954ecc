"""Roads, their segments and the cells heard along them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.api.schemas.fields import STRICT, Name

MAX_VERTICES = 100_000

Position = Annotated[
    list[float], Field(min_length=2, max_length=3, description="Lon, lat, and a height, ignored.")
]


class LineStringRequest(BaseModel):
    """A GeoJSON LineString (RFC 7946) in the direction of growing chainage."""

    model_config = STRICT

    type: Literal["LineString"]
    coordinates: list[Position] = Field(
        min_length=2,
        max_length=MAX_VERTICES,
        fail_fast=True,
        examples=[[[-118.4964, 34.0129], [-118.4842, 34.0226]]],
    )


class RoadRequest(BaseModel):
    """A road's name and line; what is absent or null stays as it is."""

    model_config = STRICT

    name: Name | None = None
    line: LineStringRequest | None = None


class LineString(BaseModel):
    """A GeoJSON LineString."""

    type: Literal["LineString"] = "LineString"
    coordinates: list[tuple[float, float]]


class MultiLineString(BaseModel):
    """A line that crosses the antimeridian, cut there (RFC 7946, 3.1.9); its parts in order."""

    type: Literal["MultiLineString"] = "MultiLineString"
    coordinates: list[list[tuple[float, float]]]


class RoadDocument(BaseModel):
    """
    A road as the map has it.

    `line` is the one that was set, else its model's. Length and the counts of passes and segments
    are its model's; `survey_count` counts what is stored now.
    """

    id: str
    name: str | None
    line: LineString | None
    length_m: float | None
    pass_count: int
    survey_count: int
    segment_count: int
    model_version: int | None = Field(description="The map version whose build made its model.")
    cells: list[str]


class RoadPage(BaseModel):
    """Some roads by id."""

    map_version: int | None
    roads: list[RoadDocument]
    next_cursor: str | None


class MidPoint(BaseModel):
    """Halfway along a segment."""

    lon: float
    lat: float


class FeatureDocument(BaseModel):
    """One kind of feature; one value and one mask a cell, in the order of `cells`."""

    unit: str
    values: list[float | None] = Field(description="null where the cell is not heard.")
    mask: list[bool] = Field(description="true where the feature is salient (the diagonal of W).")


class FitDocument(BaseModel):
    """A cell's B-spline of RSRP in chainage along a segment."""

    cell: str
    knots_m: list[float]
    coefficients_dbm: list[float]
    degree: int
    residual_db: float
    pass_count: int


class SegmentDocument(BaseModel):
    """A stretch of road within which the signals' trend holds."""

    index: int
    start_m: float
    end_m: float
    midpoint: MidPoint
    geometry: LineString | None
    cells: list[str] = Field(description="The columns of `values` and `mask`.")
    features: dict[str, FeatureDocument] = Field(
        description="`mean_gradient`, `mean`, `variance`, `mean_difference`, `range`."
    )
    information_gain_bits: float = Field(description="Of the salient features.")
    full_information_gain_bits: float = Field(description="Of all features.")
    selection: str = Field(description="`exhaustive` or `branch-and-bound` (exact), or `greedy`.")
    fits: list[FitDocument]
    pass_count: int = Field(description="Survey passes that the road's model was made from.")


class SegmentList(BaseModel):
    """All segments of a road, in order."""

    road_id: str
    map_version: int | None
    segments: list[SegmentDocument]


class CellDocument(BaseModel):
    """Where a cell is mapped; levels are of the fitted curves."""

    cell: str
    road_count: int
    segment_count: int
    min_rsrp_dbm: float | None
    max_rsrp_dbm: float | None
    mean_rsrp_dbm: float | None


class CellList(BaseModel):
    """Every mapped cell, by id."""

    map_version: int | None
    cells: list[CellDocument]


class Feature(BaseModel):
    """A GeoJSON Feature; its properties are the JSON document without the geometry."""

    type: Literal["Feature"] = "Feature"
    id: str
    geometry: LineString | MultiLineString | None
    properties: dict[str, Any]


class FeatureCollection(BaseModel):
    """A GeoJSON FeatureCollection; paging and the map version stand beside its features."""

    type: Literal["FeatureCollection"] = "FeatureCollection"
    features: list[Feature]
    map_version: int | None
    next_cursor: str | None = None
