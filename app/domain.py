"""
The nouns: frozen values that every room passes to the next.

Arrays are numpy; shapes and units stand beside each field. Missing is NaN in arrays and None in
scalars. Nothing here knows of files, databases or HTTP. `docs/glossary.md` defines the words.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

FEATURE_KINDS = ("mean_gradient", "mean", "variance", "mean_difference", "range")
FEATURE_UNITS = ("dB/m", "dBm", "dB^2", "dB", "dB")

LTE_RSRP_RANGE_DBM = (-140.0, -44.0)  # 3GPP TS 36.133 table 9.1.4-1, edges included
NR_RSRP_RANGE_DBM = (-156.0, -31.0)  # 3GPP TS 38.133 table 10.1.6.1-1


class Direction(enum.StrEnum):
    """Direction of travel along a road; ``FORWARD`` is the way of its LineString."""

    FORWARD = "forward"
    BACKWARD = "backward"

    @property
    def sign(self) -> int:
        """+1 when chainage grows along the drive, -1 when it falls."""
        return 1 if self is Direction.FORWARD else -1


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A road's centre line, WGS 84 degrees, in the direction of growing chainage."""

    lon: Float[np.ndarray, " vertices"]
    lat: Float[np.ndarray, " vertices"]


@dataclass(frozen=True, slots=True)
class Road:
    """A road as it is known before any model: ``line`` is None until somebody sets it."""

    road_id: str
    name: str | None = None
    line: Line | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """
    One survey pass as measured, oldest sample first.

    Attributes:
        cells: Opaque cell ids, one a column of ``rsrp_dbm``.
        time_s: Seconds from the first sample, non-decreasing. Shape ``(samples,)``.
        lon, lat: WGS 84 degrees. Shape ``(samples,)``.
        rsrp_dbm: Received power, float32. Shape ``(samples, cells)``; NaN = not heard.
        global_ids: Worldwide names of some cells (``mcc-mnc-eci``); nothing is matched by them.
    """

    cells: tuple[str, ...]
    time_s: Float[np.ndarray, " samples"]
    lon: Float[np.ndarray, " samples"]
    lat: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    road_id: str | None = None
    device: str | None = None
    recorded_at: datetime | None = None
    reference_cell: str | None = None
    global_ids: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Salience:
    """
    Which features tell this road or sub-segment from the others.

    Attributes:
        mask: The diagonal of the paper's W (Eq. 7). Shape ``(5, cells)``, rows `FEATURE_KINDS`.
        gain_bits: Information gain (Eq. 6) of the chosen features.
        full_gain_bits: The same of all features; ``gain_bits`` is within a stated tolerance of it.
        search: ``exhaustive``, ``branch-and-bound`` (both exact) or ``greedy``.
    """

    mask: Bool[np.ndarray, "kinds cells"]
    gain_bits: float
    full_gain_bits: float
    search: str


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """B-spline of one cell's RSRP over a sub-segment: scipy's, from chainage in metres to dBm."""

    cell: str
    knots_m: Float[np.ndarray, " knots"]
    coefficients_dbm: Float[np.ndarray, " coefficients"]
    degree: int
    residual_db: float
    pass_count: int


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """
    A sub-segment: a stretch of road within which the signals' trend holds.

    ``features`` are as the road's, NaN where a cell is not heard; ``curves`` one a heard cell.
    """

    index: int
    start_m: float
    end_m: float
    mid_lon: float
    mid_lat: float
    features: Float[np.ndarray, "kinds cells"]
    salience: Salience
    curves: tuple[Curve, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RoadModel:
    """
    Everything that the surveys of one road say: immutable, and complete for matching.

    The grid arrays sample the curves at chainages ``0, step_m, ...``: serving needs no spline code.

    Attributes:
        mean_dbm: Expected RSRP. Shape ``(grid, cells)``, float32; NaN where the cell is not mapped.
        spread_db: Standard deviation of a new sample about it, same shape, float32.
        heard: Probability that a sample of its carrier hears the cell, mapped or not, same shape.
        heard_on: Cells heard on each survey day (ISO date, or ``""``), shape ``(cells,)`` each.
        features: The road-scale features (Eq. 3). Shape ``(5, cells)``.
        evidence: Windows of its passes, see `app.numerics.evidence_table`; float32.
        unseen: The grid arrays without the passes of each fold, at nodes; float16.
    """

    road_id: str
    line: Line
    length_m: float
    cells: tuple[str, ...]
    step_m: float
    mean_dbm: Float[np.ndarray, "grid cells"]
    spread_db: Float[np.ndarray, "grid cells"]
    heard: Float[np.ndarray, "grid cells"]
    features: Float[np.ndarray, "kinds cells"]
    salience: Salience
    segments: tuple[Segment, ...]
    pass_count: int
    sample_count: int
    evidence: Float[np.ndarray, "windows columns"]
    unseen: Float[np.ndarray, "folds 3 nodes cells"]
    heard_on: Mapping[str, Bool[np.ndarray, " cells"]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Reliability:
    """
    How often a map's probabilities came true on windows that its curves had not seen.

    Attributes:
        measured_count: Of the windows, those of other days than their curves; the rest are drawn.
        road_right: Share whose most probable road was the true one.
        ece: Expected calibration error of the road's posterior (Naeini et al. 2015).
        curve: Of ten bins of the road's posterior: its mean, share right, windows.
        coverage: Pairs of confidence and share of windows whose radius held the truth.
        segment_right, segment_ece: Of the sub-segment that holds the position, as of the road.
        refused: Share answered as off the map though they were on it.
        strangers_refused: Of windows in the map without their road; see ``off_map_auroc``.
    """

    window_count: int = 0
    measured_count: int = 0
    road_right: float | None = None
    ece: float | None = None
    curve: tuple[tuple[float, float, int], ...] = ()
    coverage: tuple[tuple[float, float], ...] = ()
    median_m: float | None = None
    p90_m: float | None = None
    refused: float | None = None
    strangers_refused: float | None = None
    off_map_auroc: float | None = None
    segment_right: float | None = None
    segment_ece: float | None = None


@dataclass(frozen=True, slots=True)
class Calibration:
    """
    What held-out windows say of a whole map's probabilities. Plain numbers, stored as JSON.

    Attributes:
        information_once, information_each: A window whose samples weigh ``w`` says as much as
            ``information_once + information_each w`` independent ones, and no more than it has.
        offset_sd_db: Spread of the survey devices' offsets.
        position_sd_m: Error of surveyed positions along the road, as radii need it.
        segment_sd_m: The likeliest such error, which blurs the boundaries of sub-segments.
        off_map: Log odds of being on the map, see `app.numerics.offmap.off_map_terms`.
    """

    information_once: float = 0.0
    information_each: float = 1.0
    offset_sd_db: float = 1.0
    position_sd_m: float = 0.0
    segment_sd_m: float = 0.0
    off_map: tuple[float, ...] = (4.0, 2.0, 0.0, 0.0)
    window_count: int = 0
    reliability: Reliability = Reliability()

    def temperature(self, weight: float, samples: int) -> float:
        """What the scores of a window are divided by."""
        return max(weight, 1e-3) / self.information(weight, samples)

    def information(self, weight: float, samples: int) -> float:
        """How many independent samples the window is worth."""
        weight = max(weight, 1e-3)
        return min(self.information_once + self.information_each * weight, float(samples))


@dataclass(frozen=True, slots=True, eq=False)
class RadioMap:
    """A map version: one model a road, and the calibration of them together."""

    version: int
    models: tuple[RoadModel, ...]
    calibration: Calibration


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """
    What a vehicle heard over its last metres, oldest sample first.

    Attributes:
        distance_m: Travelled, non-decreasing, any origin. Shape ``(samples,)``.
        rsrp_dbm: Shape ``(samples, cells)``; NaN = not heard.
        distance_error: Standard deviation of what they are multiplied by; None = nobody knows.
    """

    cells: tuple[str, ...]
    distance_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    distance_error: float | None = None


class Candidate(NamedTuple):
    """One sub-segment and direction a window may end in, with the best place within it."""

    road_id: str
    segment_index: int
    direction: Direction
    posterior: float
    chainage_m: float
    lon: float
    lat: float


@dataclass(frozen=True, slots=True)
class Fix:
    """
    The answer to a window: where its last sample was.

    Attributes:
        candidates: Every candidate, most probable first; their posteriors and
            ``off_map_posterior`` sum to 1.
        road_posterior: Summed over the best road's candidates.
        segment_posterior: Summed over the directions of the best sub-segment.
        accuracy_m: Radius about the position that holds ``confidence`` of the on-map posterior.
        off_map: True when the window fits no mapped road; the position fields are then the best
            candidate's all the same, and callers must not report them as a position.
    """

    map_version: int
    off_map: bool
    road_id: str
    road_posterior: float
    segment_index: int
    segment_posterior: float
    segment_start_m: float
    segment_end_m: float
    lon: float
    lat: float
    chainage_m: float
    direction: Direction
    heading_deg: float
    accuracy_m: float
    confidence: float
    off_map_posterior: float
    device_offset_db: float
    samples_used: int
    cells_used: int
    cells_unknown: tuple[str, ...]
    candidates: tuple[Candidate, ...] = field(default=())
