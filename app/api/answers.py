"""From a fix to the document that clients read."""

from __future__ import annotations

from typing import Any

from app.api.explanations import explanation_document
from app.api.schemas.locate import LocateRequest
from app.api.state import Limits
from app.api.tracks import is_tracked, track
from app.api.windows import window_of
from app.domain import Candidate, Fix
from app.numerics.index import MapIndex
from app.services.locate import locate


def fix_document(fix: Fix, max_candidates: int | None) -> dict[str, Any]:
    """Plain values in the shape of `FixDocument`; all candidates when that is None."""
    return {
        "status": "off_map" if fix.off_map else "located",
        "map_version": fix.map_version,
        **_place(fix),
        "confidence": fix.confidence,
        "candidates": [_candidate(candidate) for candidate in fix.candidates[:max_candidates]],
        "off_map_posterior": fix.off_map_posterior,
        "device_offset_db": fix.device_offset_db,
        "samples_used": fix.samples_used,
        "cells_used": fix.cells_used,
        "cells_unknown": fix.cells_unknown,
    }


def _place(fix: Fix) -> dict[str, Any]:
    if fix.off_map:
        return {"road": None, "segment": None, "position": None, "accuracy_m": None}
    return {
        "road": {"id": fix.road_id, "posterior": fix.road_posterior},
        "segment": {
            "index": fix.segment_index,
            "posterior": fix.segment_posterior,
            "start_m": fix.segment_start_m,
            "end_m": fix.segment_end_m,
        },
        "position": {
            "lon": fix.lon,
            "lat": fix.lat,
            "chainage_m": fix.chainage_m,
            "direction": fix.direction,
            "heading_deg": fix.heading_deg,
        },
        "accuracy_m": fix.accuracy_m,
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "road_id": candidate.road_id,
        "segment_index": candidate.segment_index,
        "direction": candidate.direction,
        "posterior": candidate.posterior,
        "lon": candidate.lon,
        "lat": candidate.lat,
        "chainage_m": candidate.chainage_m,
    }


def located_document(
    index: MapIndex, request: LocateRequest, limits: Limits, state_key: bytes
) -> tuple[Fix, dict[str, Any]]:
    """
    The fix of a request and its document, tracked and explained when the request asks for that.

    Raises:
        InvalidInput: With every fault of the window, or that of its state.
    """
    window = window_of(request, limits)
    if not is_tracked(request):
        fix = locate(index, window, confidence=request.confidence)
        document = fix_document(fix, request.max_candidates)
    else:
        tracked = track(index, request, window, state_key)
        fix = tracked.fix
        document = {**fix_document(fix, request.max_candidates), "state": tracked.state}
    if request.explain:
        document["explanation"] = explanation_document(index, window, fix)
    return fix, document
