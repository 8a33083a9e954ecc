"""From a version's calibration to the document on how far it can be trusted."""

from __future__ import annotations

from typing import Any

from app.domain import Calibration, Reliability
from app.services.maps import MapVersion

Document = dict[str, Any]

NOT_MEASURED = (
    "This version was made before maps measured their reliability; build again to have it measured."
)
TOO_FEW = (
    "Too few held-out windows to measure anything: the probabilities follow the defaults below, "
    "which are those of real streets driven once. A second pass, best on another day, changes that."
)
ALL_DRAWN = (
    "No road was driven twice: the windows are drawn from the model itself, and say nothing "
    "of other days and devices. Expect real windows to do worse."
)
SOME_DRAWN = (
    "Windows of roads driven once are drawn from the model itself; they make the figures better "
    "than real windows would."
)

OFF_MAP = (
    "Log odds of being on the map: intercept, then what a unit of fit (nats a reading), of the "
    "logarithm of the window's information (independent samples), and of their product add."
)

PARAMETERS = {
    "information_once": ("samples", "What a window says however long it is, as so many samples."),
    "information_each": ("samples a weight", "What each further weight of samples (10 m) adds."),
    "offset_sd_db": ("dB", "Spread of the survey devices' offsets."),
    "position_sd_m": ("m", "Error of surveyed positions along the road, as radii need it."),
    "segment_sd_m": ("m", "The most probable one: how far places reach over boundaries."),
    "off_map": ("nats", OFF_MAP),
}
"""Unit and meaning of every number of `app.domain.Calibration` that answers depend on."""


def reliability_document(version: MapVersion) -> Document:
    """A `ReliabilityDocument`."""
    found = version.calibration.reliability
    return {
        "map_version": version.version,
        "note": _note(version.calibration, found),
        "window_count": found.window_count,
        "measured_count": found.measured_count,
        "road": {"right": found.road_right, "ece": found.ece, "curve": _curve(found)},
        "segment": {"right": found.segment_right, "ece": found.segment_ece},
        "position": {
            "median_m": found.median_m,
            "p90_m": found.p90_m,
            "coverage": [
                {"confidence": confidence, "share": share} for confidence, share in found.coverage
            ],
        },
        "off_map": {
            "refused": found.refused,
            "strangers_refused": found.strangers_refused,
            "auroc": found.off_map_auroc,
        },
        "calibration": _parameters(version.calibration),
    }


def _curve(found: Reliability) -> list[Document]:
    return [
        {"posterior": posterior, "right": right, "windows": int(windows)}
        for posterior, right, windows in found.curve
    ]


def _note(calibration: Calibration, found: Reliability) -> str | None:
    if not found.window_count:
        return NOT_MEASURED if calibration.window_count else TOO_FEW
    if not found.measured_count:
        return ALL_DRAWN
    return SOME_DRAWN if found.measured_count < found.window_count else None


def _parameters(calibration: Calibration) -> Document:
    return {
        name: {"value": getattr(calibration, name), "unit": unit, "meaning": meaning}
        for name, (unit, meaning) in PARAMETERS.items()
    }
