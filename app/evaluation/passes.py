"""Windows cut from whole passes along known roads, real or simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from app.domain import Direction, Line, Trace, Window
from app.evaluation.dataset import BadDataset, read_index, read_roads, stream_passes
from app.evaluation.truth import Labelled, Truth
from app.formats.account import Account
from app.numerics.lines import point_at, project


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """
    A pass along a road, seen as a vehicle would know it.

    Attributes:
        chainage_m: Where each sample lies along the road; NaN where that is not known.
        travelled_m: The way so far, non-decreasing: of the vehicle's odometer where there is one.
            Else the progress along the road stands in, without the steps back that position noise
            makes while the car stands.
    """

    trace: Trace
    road_id: str
    line: Line
    direction: Direction
    chainage_m: Float[np.ndarray, " samples"]
    travelled_m: Float[np.ndarray, " samples"]

    def with_odometer(self, travelled_m: Float[np.ndarray, " samples"]) -> Drive:
        """The same drive as a vehicle's own odometer tells it."""
        return replace(self, travelled_m=travelled_m)


def drive_of(trace: Trace, road_id: str, line: Line, direction: Direction) -> Drive:
    """The pass with each position dropped on the line, its progress in place of an odometer."""
    chainage_m = project(line, trace.lon, trace.lat).chainage_m
    progress_m = direction.sign * (chainage_m - chainage_m[0])
    travelled_m = np.maximum.accumulate(progress_m)
    return Drive(trace, road_id, line, direction, chainage_m, travelled_m)


def cut_windows(
    drives: Sequence[Drive], count: int, *, length_m: float, seed: int
) -> list[Labelled]:
    """
    Windows of a length that end anywhere on the drives.

    An end is drawn evenly over the driven way, so that a standing car is not drawn more often. A
    window holds the samples of its last ``length_m``; its truth is where its last sample lies.

    Raises:
        ValueError: No drive is as long as a window.
    """
    room_m = np.array([max(0.0, float(each.travelled_m[-1]) - length_m) for each in drives])
    if not room_m.any():
        raise ValueError(f"none of {len(drives)} drives is longer than {length_m} m")
    bounds_m = np.cumsum(room_m)
    rng = np.random.Generator(np.random.PCG64(seed))
    windows = []
    for at_m in rng.uniform(0.0, bounds_m[-1], size=count):
        which = int(np.searchsorted(bounds_m, at_m, side="right"))
        end_m = length_m + at_m - (bounds_m[which - 1] if which else 0.0)
        windows.append(_window_ending_at(drives[which], float(end_m), length_m))
    return windows


def load_test_drives(folder: Path) -> list[Drive]:
    """
    The test passes of a data set (`app.evaluation.dataset`) as drives.

    Raises:
        BadDataset: The folder is no data set, or a pass names a road that it lacks.
    """
    lines = {road.road_id: road.line for road in read_roads(folder)}
    index = read_index(folder)
    drives = []
    for each in stream_passes(folder, Account()):
        entry = index.get(each.pass_id)
        if entry is None or entry.role != "test":
            continue
        line = lines.get(entry.road_id)
        if line is None:
            raise BadDataset(f"pass {entry.pass_id} is on road {entry.road_id}, which has no line")
        drives.append(drive_of(each.trace, entry.road_id, line, entry.direction))
    return drives


def _window_ending_at(drive: Drive, end_m: float, length_m: float) -> Labelled:
    """The window whose last sample is the last one within ``end_m`` of the drive's start."""
    last = int(np.searchsorted(drive.travelled_m, end_m, side="right")) - 1
    first = int(np.searchsorted(drive.travelled_m, drive.travelled_m[last] - length_m))
    return window_of(drive, first, last)


def window_of(drive: Drive, first: int, last: int) -> Labelled:
    """The window of samples ``first`` to ``last``, with where the last was taken."""
    part = slice(first, last + 1)
    rsrp_dbm = drive.trace.rsrp_dbm[part].astype(float)
    heard = np.isfinite(rsrp_dbm).any(axis=0)
    cells = tuple(cell for cell, there in zip(drive.trace.cells, heard, strict=True) if there)
    travelled_m = drive.travelled_m[part] - drive.travelled_m[first]
    chainage_m = float(drive.chainage_m[last])
    place = point_at(drive.line, chainage_m)
    truth = Truth(drive.road_id, chainage_m, drive.direction, float(place.lon), float(place.lat))
    return Labelled(Window(cells, travelled_m, rsrp_dbm[:, heard]), truth)
