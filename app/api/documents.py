"""From stored nouns to the documents that clients read, plain values that orjson writes fast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from app.domain import FEATURE_KINDS, FEATURE_UNITS, Curve, Line, Segment, Trace
from app.numerics.lines import parts_in_range, slice_line
from app.services.builds import BuildState
from app.services.ingest import Accepted
from app.services.maps import MapVersion
from app.services.roads import CellSummary, RoadSummary
from app.services.surveys import SurveySummary

Document = dict[str, Any]


def survey_document(survey: SurveySummary) -> Document:
    """A `SurveyDocument`."""
    return {
        "id": survey.survey_id,
        "roads": list(survey.roads),
        "device": survey.device,
        "recorded_at": survey.recorded_at,
        "received_at": survey.received_at,
        "reference_cell": survey.reference_cell,
        "cells": list(survey.cells),
        "samples": survey.samples,
        "dropped": dict(survey.dropped),
        "build_id": survey.build_id,
    }


def accepted_document(accepted: Accepted) -> Document:
    """A `SurveyAccepted`."""
    return {
        "survey_id": accepted.survey_id,
        "build_id": accepted.build_id,
        "roads": list(accepted.roads),
        "samples": accepted.samples,
        "dropped": dict(accepted.dropped),
    }


def several_accepted_document(several: Sequence[Accepted], dropped: Mapping[str, int]) -> Document:
    """A `SurveyAccepted` of a file that held several drives: their sum, and each of them."""
    roads = dict.fromkeys(road for accepted in several for road in accepted.roads)
    builds = [accepted.build_id for accepted in several if accepted.build_id is not None]
    return {
        "survey_id": several[0].survey_id,
        "build_id": builds[-1] if builds else None,
        "roads": list(roads),
        "samples": sum(accepted.samples for accepted in several),
        "dropped": dict(dropped),
        "surveys": [accepted_document(accepted) for accepted in several],
    }


def samples_document(trace: Trace) -> Document:
    """A `SurveySamples`; NaN becomes null."""
    return {
        "road_id": trace.road_id,
        "device": trace.device,
        "recorded_at": trace.recorded_at,
        "reference_cell": trace.reference_cell,
        "cells": list(trace.cells),
        "global_ids": dict(trace.global_ids),
        "time_s": np.ascontiguousarray(trace.time_s),
        "lon": np.ascontiguousarray(trace.lon),
        "lat": np.ascontiguousarray(trace.lat),
        "rsrp_dbm": np.ascontiguousarray(trace.rsrp_dbm),
    }


def build_document(build: BuildState) -> Document:
    """A `BuildDocument`."""
    document = {name: getattr(build, name) for name in BuildState.__slots__}
    document["failed_roads"] = [
        {"road_id": road_id, "code": code, "detail": detail}
        for road_id, code, detail in build.failed_roads
    ]
    return document


def map_document(version: MapVersion) -> Document:
    """A `MapDocument`."""
    return {
        "version": version.version,
        "active": version.active,
        "created_at": version.created_at,
        "activated_at": version.activated_at,
        "road_count": version.road_count,
        "build_id": version.build_id,
    }


def cell_document(cell: CellSummary) -> Document:
    """A `CellDocument`."""
    return asdict(cell)


def line_document(line: Line | None) -> Document | None:
    """A GeoJSON LineString, or None."""
    if line is None:
        return None
    return {"type": "LineString", "coordinates": np.column_stack([line.lon, line.lat])}


def geometry_document(line: Line | None) -> Document | None:
    """A line as GeoJSON draws it: in two parts where it crosses the antimeridian."""
    parts = [] if line is None else parts_in_range(line)
    if len(parts) < 2:
        return line_document(parts[0]) if parts else None
    coordinates = [np.column_stack([part.lon, part.lat]) for part in parts]
    return {"type": "MultiLineString", "coordinates": coordinates}


def road_document(road: RoadSummary) -> Document:
    """A `RoadDocument`."""
    return {
        "id": road.road_id,
        "name": road.name,
        "line": line_document(road.line),
        "length_m": road.length_m,
        "pass_count": road.pass_count,
        "survey_count": road.survey_count,
        "segment_count": road.segment_count,
        "model_version": road.model_version,
        "cells": list(road.cells),
    }


def segment_document(road: RoadSummary, segment: Segment) -> Document:
    """A `SegmentDocument`."""
    line = road.line and slice_line(road.line, segment.start_m, segment.end_m)
    salience = segment.salience
    return {
        "index": segment.index,
        "start_m": segment.start_m,
        "end_m": segment.end_m,
        "midpoint": {"lon": segment.mid_lon, "lat": segment.mid_lat},
        "geometry": line_document(line),
        "cells": list(road.cells),
        "features": {
            kind: {
                "unit": FEATURE_UNITS[row],
                "values": np.ascontiguousarray(segment.features[row]),
                "mask": np.ascontiguousarray(salience.mask[row]),
            }
            for row, kind in enumerate(FEATURE_KINDS)
        },
        "information_gain_bits": salience.gain_bits,
        "full_information_gain_bits": salience.full_gain_bits,
        "selection": salience.search,
        "fits": [_fit_document(curve) for curve in segment.curves],
        "pass_count": road.pass_count,
    }


def _fit_document(curve: Curve) -> Document:
    return {
        "cell": curve.cell,
        "knots_m": np.ascontiguousarray(curve.knots_m),
        "coefficients_dbm": np.ascontiguousarray(curve.coefficients_dbm),
        "degree": curve.degree,
        "residual_db": curve.residual_db,
        "pass_count": curve.pass_count,
    }


def feature(identity: str, document: Document, geometry: str) -> Document:
    """A GeoJSON Feature of a document whose member ``geometry`` holds its line."""
    properties = {name: value for name, value in document.items() if name != geometry}
    drawn = document[geometry]
    return {
        "type": "Feature",
        "id": identity,
        "geometry": drawn and geometry_document(Line(*drawn["coordinates"].T)),
        "properties": properties,
    }


def road_feature(road: RoadSummary) -> Document:
    """A road as a GeoJSON Feature."""
    return feature(road.road_id, road_document(road), "line")


def segment_feature(road: RoadSummary, segment: Segment) -> Document:
    """A segment as a GeoJSON Feature."""
    document = {"road_id": road.road_id, **segment_document(road, segment)}
    return feature(f"{road.road_id}/{segment.index}", document, "geometry")


def feature_collection(
    features: Sequence[Document], map_version: int | None, next_cursor: str | None = None
) -> Document:
    """A GeoJSON FeatureCollection with what a page needs beside its features."""
    return {
        "type": "FeatureCollection",
        "features": list(features),
        "map_version": map_version,
        "next_cursor": next_cursor,
    }
