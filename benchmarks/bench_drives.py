"""
Whole drives in, roads out, windows located: `python benchmarks/bench_drives.py FOLDER [OTHER]`.

FOLDER holds ``drives.csv.gz`` and ``drives_index.csv`` (docs/datasets.md), and beside them, where
they are known, ``roads.geojson`` and hand-cut passes. The map is made of the survey drives alone.

Windows: cut from the test drives, anywhere (across turns too) and within one street. A drive's way
is its cleaned one; the truth is the receiver's own position, which is some metres off itself.
"""

from __future__ import annotations

import csv
import gzip
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
import shapely
from jaxtyping import Float

from app.domain import Calibration, RadioMap, Road, RoadModel, Trace, Window
from app.evaluation import realdata
from app.evaluation.dataset import is_dataset, read_roads
from app.evaluation.passes import cut_windows, load_test_drives
from app.evaluation.tidy import read_passes
from app.formats.account import Account
from app.numerics.calibration import calibrate
from app.numerics.geodesy import LocalFrame, distance_m
from app.numerics.index import MapIndex
from app.numerics.lines import length_m, point_at
from app.numerics.matching import locate
from app.numerics.network.cleaning import clean
from app.numerics.network.finding import find_roads
from app.numerics.network.following import OFF_ROAD, Network
from app.numerics.network.nouns import Driven, Findings
from app.numerics.network.steps import STEP_M
from app.numerics.roadfit import fit_road

WINDOW_M = 200.0
WINDOWS, SEED = 400, 2024


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """A window of a drive, where its last sample was, and whether it runs along one found road."""

    window: Window
    lon: float
    lat: float
    roads: int


def main(folders: Sequence[Path]) -> None:
    """Print the figures of each folder."""
    for folder in folders:
        drives = list(read_drives(folder))
        survey = [trace for role, trace in drives if role == "survey"]
        began_s = time.perf_counter()
        found = find(survey)
        took_s = time.perf_counter() - began_s
        lengths_m = sorted(round(length_m(line)) for line in found.lines.values())
        print(f"{folder.name}: {len(survey)} survey drives, {took_s:.1f} s")
        print(f"  {len(found.lines)} roads, metres: {lengths_m}")
        print(f"  farther than 25 m from any drive: {phantom_m(found, survey):.0f} m of road")
        if is_dataset(folder):
            print_streets(folder, found)
        index = map_of(found, survey)
        for word, asked in windows_of(found, [t for role, t in drives if role == "test"]).items():
            print_errors(f"{WINDOW_M:.0f} m windows, {word}", index, asked)
        if is_dataset(folder):
            print_hand_cut(folder, index)


def read_drives(folder: Path) -> Iterator[tuple[str, Trace]]:
    """Role and trace of each drive."""
    with (folder / "drives_index.csv").open(encoding="utf-8", newline="") as file:
        roles = {row["trace_id"]: row["role"] for row in csv.DictReader(file)}
    with gzip.open(folder / "drives.csv.gz", "rt", encoding="utf-8", newline="") as file:
        header = next(file).replace("trace_id", "pass_id", 1)
        for each in read_passes(_with(header, file), Account()):
            yield roles.get(each.pass_id, ""), each.trace


def _with(header: str, lines: Iterator[str]) -> Iterator[str]:
    yield header
    yield from lines


def find(survey: Sequence[Trace]) -> Findings:
    """The roads of drives, all at once."""
    driven = [
        Driven(str(number), trace.lon, trace.lat, trace.time_s, new=True)
        for number, trace in enumerate(survey)
    ]
    return find_roads(driven, [], (f"road-{number:02d}" for number in count()))


def map_of(found: Findings, survey: Sequence[Trace]) -> MapIndex:
    """The map of the found roads, as a build makes it."""
    passes: dict[str, list[Trace]] = defaultdict(list)
    for number, trace in enumerate(survey):
        for each in found.passes[str(number)]:
            passes[each.road_id].append(cut(trace, each.first_sample, each.end_sample))
    models = [
        fit_road(Road(road_id, None, found.lines[road_id]), along)
        for road_id, along in passes.items()
    ]
    return index_of(models)


def index_of(models: Sequence[RoadModel]) -> MapIndex:
    """A map of models, calibrated."""
    calibration: Calibration = calibrate(models)
    return MapIndex.build(RadioMap(1, tuple(models), calibration))


def cut(trace: Trace, first: int, end: int) -> Trace:
    """Samples ``first:end`` of a trace."""
    part = slice(first, end)
    return Trace(
        trace.cells, trace.time_s[part], trace.lon[part], trace.lat[part], trace.rsrp_dbm[part],
        recorded_at=trace.recorded_at,
    )  # fmt: skip


def phantom_m(found: Findings, survey: Sequence[Trace]) -> float:
    """Metres of found roads that no position of a drive comes near."""
    frame = LocalFrame(float(survey[0].lon[0]), float(survey[0].lat[0]))
    at = [frame.to_xy(trace.lon, trace.lat) for trace in survey]
    driven = np.concatenate([np.stack([xy.x_m, xy.y_m], axis=1) for xy in at])
    tree = shapely.STRtree(np.asarray(shapely.points(driven)))
    alone = 0
    for line in found.lines.values():
        places = point_at(line, np.arange(0.0, length_m(line), STEP_M))
        xy = frame.to_xy(places.lon, places.lat)
        points = np.asarray(shapely.points(np.stack([xy.x_m, xy.y_m], axis=1)))
        near = tree.query(points, predicate="dwithin", distance=25.0)[0]
        alone += len(points) - len(np.unique(near))
    return alone * STEP_M


def print_streets(folder: Path, found: Findings) -> None:
    """How much of each known street lies within 12 m of found roads, and of how many."""
    complete = 0
    for street in read_roads(folder):
        assert street.line is not None  # noqa: S101 - a data set's roads have lines
        frame = LocalFrame(float(street.line.lon[0]), float(street.line.lat[0]))
        places = point_at(street.line, np.arange(0.0, length_m(street.line), STEP_M))
        xy = frame.to_xy(places.lon, places.lat)
        points = shapely.points(np.stack([xy.x_m, xy.y_m], axis=1))
        shares = {}
        covered = np.zeros(len(xy.x_m), dtype=bool)
        for road_id, line in found.lines.items():
            at = frame.to_xy(line.lon, line.lat)
            path = shapely.LineString(np.stack([at.x_m, at.y_m], axis=1))
            near = np.asarray(shapely.distance(path, points) <= 12.0)
            if near.sum() * STEP_M > 60.0:
                shares[road_id] = f"{near.mean():.2f}"
                covered |= near
        complete += bool(covered.mean() >= 0.9)
        print(f"  {street.road_id}: {covered.mean():.3f} by {shares}")
    print(f"  streets found over 90 % of their length: {complete}")


def windows_of(found: Findings, tests: Sequence[Trace]) -> dict[str, list[Asked]]:
    """Windows of the test drives by what they run along."""
    frame = LocalFrame(float(tests[0].lon[0]), float(tests[0].lat[0]))
    lines = [frame.to_xy(line.lon, line.lat) for line in found.lines.values()]
    network = Network([np.stack([xy.x_m, xy.y_m], axis=1) for xy in lines])
    rng = np.random.Generator(np.random.PCG64(SEED))
    asked: list[Asked] = []
    pieces = []
    for trace in tests:
        xy = frame.to_xy(trace.lon, trace.lat)
        for piece in clean(0, np.stack([xy.x_m, xy.y_m], axis=1), trace.time_s):
            under = network.follow(piece.xy_m).road
            pieces += [(trace, piece, under)] if piece.length_m > WINDOW_M else []
    room_m = np.array([piece.length_m - WINDOW_M for _, piece, _ in pieces])
    for _ in range(WINDOWS * 2):
        trace, piece, road = pieces[rng.choice(len(pieces), p=room_m / room_m.sum())]
        end = int(rng.uniform(WINDOW_M, piece.length_m) / STEP_M)
        first = end - int(WINDOW_M / STEP_M)
        along = set(road[first : end + 1].tolist())
        one = _window(trace, piece.sample, first, end, len(along - {OFF_ROAD}))
        if OFF_ROAD not in along and one is not None:
            asked.append(one)
    return {
        "anywhere": asked[:WINDOWS],
        "along one road": [one for one in asked[:WINDOWS] if one.roads == 1],
        "across turns": [one for one in asked[:WINDOWS] if one.roads > 1],
    }


def _window(
    trace: Trace, sample: Float[np.ndarray, " steps"], first: int, end: int, roads: int
) -> Asked | None:
    low, high = int(np.ceil(sample[first])), int(np.floor(sample[end]))
    part = slice(low, high + 1)
    rsrp_dbm = trace.rsrp_dbm[part].astype(float)
    heard = np.isfinite(rsrp_dbm).any(axis=0)
    if high - low < 3 or not heard.any():
        return None
    way_m = np.interp(np.arange(low, high + 1), sample, np.arange(len(sample)) * STEP_M)
    cells = tuple(cell for cell, there in zip(trace.cells, heard, strict=True) if there)
    window = Window(cells, way_m - way_m[0], rsrp_dbm[:, heard])
    return Asked(window, float(trace.lon[high]), float(trace.lat[high]), roads)


def print_errors(word: str, index: MapIndex, asked: Sequence[Asked]) -> None:
    """Distances of the answers from where the windows ended."""
    if not asked:
        print(f"  {word}: none")
        return
    error_m = []
    began_s = time.process_time()
    for one in asked:
        fix = locate(index, one.window)
        error_m.append(float(distance_m(fix.lon, fix.lat, one.lon, one.lat)))
    took_ms = 1e3 * (time.process_time() - began_s) / len(asked)
    p50, p90 = np.quantile(error_m, [0.5, 0.9])
    print(f"  {word}: {len(asked)} windows, median {p50:.1f} m, p90 {p90:.0f} m, "
          f"within 50 m {np.mean(np.array(error_m) < 50.0):.3f}, {took_ms:.1f} ms")  # fmt: skip


def print_hand_cut(folder: Path, index: MapIndex) -> None:
    """The same windows of hand-cut test passes on the found map and on the hand-cut one."""
    labelled = cut_windows(load_test_drives(folder), 300, length_m=WINDOW_M, seed=SEED)
    asked = [Asked(one.window, one.truth.lon, one.truth.lat, 1) for one in labelled]
    print_errors("windows of hand-cut passes on the found map", index, asked)
    data = realdata.load(folder)
    passes: dict[str, list[Trace]] = defaultdict(list)
    for trace in data.survey:
        passes[str(trace.road_id)].append(trace)
    known = {road.road_id: road for road in data.roads}
    models = [fit_road(known[road_id], along) for road_id, along in passes.items()]
    print_errors("the same on the hand-cut map", index_of(models), asked)


if __name__ == "__main__":
    main([Path(word) for word in sys.argv[1:]])
