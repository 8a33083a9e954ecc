"""From a map version's coverage to its document."""

from __future__ import annotations

from typing import Any

from app.api.documents import geometry_document
from app.domain import Line
from app.numerics.expectation import WINDOW_M
from app.services.coverage import Advice, Coverage, CoverageSummary, Stretch

Document = dict[str, Any]

COUNTS = ("forward", "backward", "days", "devices", "cells")
PASSES = {"never": "0", "once": "1", "twice": "2", "more": "3+", "unknown": "unknown"}
PERCENTILES = ("p10", "p50", "p90")


def coverage_document(found: Coverage) -> Document:
    """A `CoverageCollection`."""
    return {
        "type": "FeatureCollection",
        "features": [_feature(stretch) for stretch in found.page.items],
        "map_version": found.version,
        "window_m": WINDOW_M,
        "summary": {
            **_summary(found.summary),
            "most_worth_a_drive": [_worth(*one) for one in found.most_worth],
        },
        "next_cursor": found.page.next_cursor,
    }


def _feature(one: Stretch) -> Document:
    whole = one.segment_index is None
    return {
        "type": "Feature",
        "id": one.road_id if whole else f"{one.road_id}/{one.segment_index}",
        "geometry": geometry_document(one.line),
        "properties": {
            "road_id": one.road_id,
            "name": one.name,
            "segment_index": one.segment_index,
            "start_m": one.start_m,
            "end_m": one.end_m,
            "length_m": one.end_m - one.start_m,
            "passes": one.passes,
            **_counts(one),
            "road_right": one.road_right,
            "expected_error_m": one.expected_error_m,
        },
    }


def _counts(one: Stretch) -> Document:
    counts = one.counts
    if counts is None:  # nobody drove, or nobody counted
        nothing = None if one.passes is None else 0
        told: Document = dict.fromkeys(COUNTS, nothing)
        return {**told, "cells_per_sample": nothing, "last_surveyed_at": None, "spread_db": None}
    return {
        **{name: getattr(counts, name) for name in COUNTS},
        "cells_per_sample": counts.cells_heard,
        "last_surveyed_at": counts.last_surveyed_at,
        "spread_db": counts.spread_db,
    }


def _summary(found: CoverageSummary) -> Document:
    return {
        "length_m": found.length_m,
        "length_m_by_passes": {name: found.by_passes_m[key] for name, key in PASSES.items()},
        "both_directions": found.both_directions,
        "several_days": found.several_days,
        "expected_error_m": {name: found.error_m.get(name) for name in PERCENTILES},
    }


def _worth(one: Advice, line: Line | None) -> Document:
    return {
        "road_id": one.road_id,
        "start_m": one.start_m,
        "end_m": one.end_m,
        "length_m": one.end_m - one.start_m,
        "gain_m": one.gain_m,
        "expected_error_m": one.expected_error_m,
        "reason": one.reason,
        "geometry": geometry_document(line),
    }
