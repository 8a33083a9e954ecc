"""
Real drives as surveys to learn from and drives to test on; split by pass and day, never by sample.

Two layouts: passes along known streets (`app.evaluation.dataset`), and whole drives of one route
(``drives_index.csv`` and ``drives.csv.gz``), whose centre line the survey's drives give and along
which every drive is followed from end to end (`app.evaluation.route`).
"""

from __future__ import annotations

import csv
import gzip
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.domain import Line, Road, Trace
from app.evaluation.dataset import BadDataset, is_dataset, read_index, read_roads, stream_passes
from app.evaluation.passes import Drive, drive_of
from app.evaluation.route import follow, odometer_m
from app.evaluation.route_line import draw_line
from app.evaluation.tidy import read_passes
from app.formats.account import Account
from app.numerics.geodesy import Floats
from app.numerics.lines import point_at

DRIVES_INDEX, DRIVES = "drives_index.csv", "drives.csv.gz"
ROUTE = "route"


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
    drives: dict[str, list[tuple[Trace, Floats | None]]] = {"survey": [], "test": []}
    for each in read_passes(_as_passes(folder), Account()):
        if roles.get(each.pass_id) in drives:
            trace = replace(each.trace, road_id=ROUTE)
            told = not np.isnan(each.speed_mps).any()
            odometer = odometer_m(trace.time_s, each.speed_mps) if told else None
            drives[roles[each.pass_id]].append((trace, odometer))
    if not drives["survey"]:
        raise BadDataset(f"{folder}: no drive has the role survey")
    line = draw_line(*zip(*drives["survey"], strict=True))
    laid = (_surveyed(line, trace, odometer) for trace, odometer in drives["survey"])
    survey = tuple(trace for trace in laid if len(trace.time_s))
    tests = tuple(_driven(line, trace, odometer) for trace, odometer in drives["test"])
    return RealData((Road(ROUTE, ROUTE, line),), survey, tests)


def _surveyed(line: Line, trace: Trace, travelled_m: Floats | None) -> Trace:
    """A survey drive with its positions on the line; samples of no known place left out."""
    chainage_m = follow(line, trace, travelled_m).chainage_m
    known = ~np.isnan(chainage_m)
    place = point_at(line, chainage_m[known])
    return replace(
        trace,
        time_s=trace.time_s[known],
        lon=place.lon,
        lat=place.lat,
        rsrp_dbm=trace.rsrp_dbm[known],
    )


def _driven(line: Line, trace: Trace, travelled_m: Floats | None) -> Drive:
    """A test drive with its odometer; without one, its progress along the line stands in."""
    direction, chainage_m = follow(line, trace, travelled_m)
    if travelled_m is None:
        known = np.flatnonzero(~np.isnan(chainage_m))
        steady_m = np.interp(np.arange(len(chainage_m)), known, chainage_m[known])
        travelled_m = np.maximum.accumulate(direction.sign * (steady_m - steady_m[0]))
    return Drive(trace, ROUTE, line, direction, chainage_m, travelled_m)


def _as_passes(folder: Path) -> Iterator[str]:
    """The table's lines with its drives named as passes."""
    with gzip.open(folder / DRIVES, "rt", encoding="utf-8", newline="") as file:
        yield next(file).replace("trace_id", "pass_id", 1)
        yield from file
