"""What goes into the finding of roads and what comes out: values without any numerics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Line


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """
    Positions of a drive.

    Attributes:
        drive_id: Its name.
        lon, lat: WGS 84 degrees. Shape ``(samples,)``.
        time_s: Non-decreasing. Shape ``(samples,)``.
        new: Its roads are not known yet.
    """

    drive_id: str
    lon: Float[np.ndarray, " samples"]
    lat: Float[np.ndarray, " samples"]
    time_s: Float[np.ndarray, " samples"]
    new: bool


@dataclass(frozen=True, slots=True, eq=False)
class KnownRoad:
    """
    A road with its line.

    Attributes:
        given: It stays as it is; others, found in drives, may grow or move.
        sure: Drives that are not new run along it: where no new drive comes near, it stays.
        raw: The line is but the positions of a drive.
    """

    road_id: str
    line: Line
    given: bool
    sure: bool = True
    raw: bool = False


@dataclass(frozen=True, slots=True)
class RoadStretch:
    """Samples ``first_sample:end_sample`` of a drive run along a road."""

    road_id: str
    first_sample: int
    end_sample: int


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """
    What drives say of roads.

    Attributes:
        lines: Found roads that are new or have a new line, by id.
        gone: Found roads that no drive runs along any more.
        passes: Passes of every drive that was looked at, by drive id.
    """

    lines: Mapping[str, Line]
    gone: frozenset[str]
    passes: Mapping[str, tuple[RoadStretch, ...]]
