"""
Real drives as surveys to learn from and drives to test on; split by pass and day, never by sample.

Two layouts: passes along known streets (`app.evaluation.dataset`), and whole drives of one route
(``drives_index.csv`` and ``drives.csv.gz``), whose centre line the survey's drives give.
"""

from __future__ import annotations

import csv
import gzip
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.domain import Direction, Line, Road, Trace
from app.evaluation.dataset import BadDataset, is_dataset, read_index, read_roads, stream_passes
from app.evaluation.passes import Drive, drive_of
from app.evaluation.tidy import Account, read_passes
from app.numerics.geodesy import distance_m

DRIVES_INDEX, DRIVES = "drives_index.csv", "drives.csv.gz"
ROUTE = "route"
SMOOTHED_SAMPLES = 9  # positions are rounded to some 11 m: single ones make a line of zigzags
VERTEX_M = 25.0


@dataclass(frozen=True, slots=True, eq=False)
class RealData:
    """Survey passes, each with its road, and test drives of other sessions."""

    roads: tuple[Road, ...]
    survey: tuple[Trace, ...]
    tests: tuple[Drive, ...]


def load(folder: Path) -> RealData:
    """
    Read a folder of either layout.

    Raises:
        BadDataset: It has neither, or a session is in the survey and in the test.
    """
    if is_dataset(folder):
        return _streets(folder)
    if (folder / DRIVES_INDEX).is_file() and (folder / DRIVES).is_file():
        return _route(folder)
    raise BadDataset(f"{folder} has neither passes along roads nor drives of a route")


def _streets(folder: Path) -> RealData:
    roads = {road.road_id: road for road in read_roads(folder)}
    index = read_index(folder)
    sessions = {
        role: {entry.session for entry in index.values() if entry.role == role and entry.session}
        for role in ("survey", "test")
    }
    both = sessions["survey"] & sessions["test"]
    if both:
        raise BadDataset(f"{folder}: sessions {sorted(both)} are in the survey and in the test")
    survey, tests = [], []
    for each in stream_passes(folder, Account()):
        entry = index.get(each.pass_id)
        if entry is None:
            continue
        line = roads[entry.road_id].line if entry.road_id in roads else None
        if line is None:
            raise BadDataset(f"pass {entry.pass_id} is on road {entry.road_id}, which has no line")
        trace = replace(each.trace, road_id=entry.road_id)
        if entry.role == "survey":
            survey.append(trace)
        else:
            tests.append(drive_of(trace, entry.road_id, line, entry.direction))
    driven = {trace.road_id for trace in survey}
    known = tuple(road for road in roads.values() if road.road_id in driven)
    on_map = tuple(one for one in tests if one.road_id in driven)
    return RealData(known, tuple(survey), on_map)


def _route(folder: Path) -> RealData:
    with (folder / DRIVES_INDEX).open(encoding="utf-8", newline="") as file:
        roles = {row["trace_id"]: row["role"] for row in csv.DictReader(file)}
    traces = {each.pass_id: each.trace for each in read_passes(_as_passes(folder), Account())}
    survey = [
        replace(trace, road_id=ROUTE)
        for name, trace in traces.items()
        if roles.get(name) == "survey"
    ]
    if not survey:
        raise BadDataset(f"{folder}: no drive has the role survey")
    line = _route_line(survey)
    tests = tuple(
        _along(replace(trace, road_id=ROUTE), line)
        for name, trace in traces.items()
        if roles.get(name) == "test"
    )
    return RealData((Road(ROUTE, ROUTE, line),), tuple(survey), tests)


def _route_line(survey: list[Trace]) -> Line:
    """
    The way of the survey drive of median length in time, smoothed.

    Drives of a long route that meets itself cannot be averaged by place.
    """
    typical = sorted(survey, key=lambda trace: float(trace.time_s[-1]))[len(survey) // 2]
    even = np.ones(SMOOTHED_SAMPLES) / SMOOTHED_SAMPLES
    lon = np.convolve(typical.lon, even, mode="valid")
    lat = np.convolve(typical.lat, even, mode="valid")
    kept = [0]
    for i in range(1, len(lon)):
        if distance_m(lon[kept[-1]], lat[kept[-1]], lon[i], lat[i]) >= VERTEX_M:
            kept.append(i)
    return Line(lon[kept], lat[kept])


def _along(trace: Trace, line: Line) -> Drive:
    one = drive_of(trace, ROUTE, line, Direction.FORWARD)
    if one.chainage_m[-1] >= one.chainage_m[0]:
        return one
    return drive_of(trace, ROUTE, line, Direction.BACKWARD)


def _as_passes(folder: Path) -> Iterator[str]:
    """The table's lines with its drives named as passes."""
    with gzip.open(folder / DRIVES, "rt", encoding="utf-8", newline="") as file:
        yield next(file).replace("trace_id", "pass_id", 1)
        yield from file
