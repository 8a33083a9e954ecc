"""
Data sets on disk: a folder with ``roads.geojson``, ``passes_index.csv`` and ``passes.csv.gz``.

`docs/datasets.md` describes the files. Real measurements and simulated ones share the layout.
"""

from __future__ import annotations

import csv
import gzip
import io
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np

from app.domain import Direction, Line, Road, Trace
from app.errors import RoadprintError
from app.evaluation.tidy import Pass, read_passes
from app.formats.account import Account
from app.numerics.lines import length_m

ROADS = "roads.geojson"
INDEX = "passes_index.csv"
PASSES = "passes.csv.gz"
READING_COLUMNS = ("pass_id", "timestamp_s", "lat", "lon", "cell_id", "rsrp_dbm", "serving")

Role = Literal["survey", "test"]


class BadDataset(RoadprintError):
    """A folder is no data set; the message says what is missing or wrong, and where."""

    code = "bad-dataset"
    title = "The folder is no data set"


@dataclass(frozen=True, slots=True)
class PassEntry:
    """A row of the index: one pass along one road; ``session`` tells drives apart."""

    pass_id: str
    road_id: str
    role: Role
    direction: Direction
    session: str


def is_dataset(folder: Path) -> bool:
    """Whether the folder has the three files."""
    return all((folder / name).is_file() for name in (ROADS, INDEX, PASSES))


def read_roads(folder: Path) -> list[Road]:
    """
    The roads of a data set.

    Raises:
        BadDataset: The file is no collection of LineStrings with a ``road_id``.
    """
    path = folder / ROADS
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        return [_road(feature) for feature in document["features"]]
    except (ValueError, KeyError, TypeError) as error:
        raise BadDataset(f"{path}: no GeoJSON collection of LineStrings: {error!r}") from error


def read_index(folder: Path) -> dict[str, PassEntry]:
    """
    The index by pass id, in the file's order.

    Raises:
        BadDataset: A column is missing, or a value is none of those it may be.
    """
    path = folder / INDEX
    entries: dict[str, PassEntry] = {}
    with path.open(encoding="utf-8", newline="") as file:
        for number, row in enumerate(csv.DictReader(file), start=2):
            try:
                entries[row["pass_id"]] = _entry(row)
            except (KeyError, ValueError) as error:
                raise BadDataset(f"{path}:{number}: {error}") from error
    return entries


def stream_passes(folder: Path, account: Account) -> Iterator[Pass]:
    """
    The passes of a data set, one in memory at a time; those that the index lacks included.

    Raises:
        BadTable: The table's columns or order are wrong.
        BadDataset: The file is no gzip, or ends early.
    """
    path = folder / PASSES
    try:
        with gzip.open(path, "rt", encoding="utf-8", newline="") as file:
            yield from read_passes(file, account)
    except (EOFError, gzip.BadGzipFile) as error:
        raise BadDataset(f"{path}: {error}") from error


def write_dataset(
    folder: Path, roads: Iterable[Road], passes: Iterable[tuple[PassEntry, Trace]]
) -> None:
    """Write a data set; traces must have ``recorded_at``. Files of an earlier one are replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    features = [_feature(road) for road in roads]
    document = {"type": "FeatureCollection", "features": features}
    (folder / ROADS).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    with (
        (folder / INDEX).open("w", encoding="utf-8", newline="") as index_file,
        _open_reproducible(folder / PASSES) as passes_file,
    ):
        index, readings = csv.writer(index_file), csv.writer(passes_file)
        index.writerow(each.name for each in fields(PassEntry))
        readings.writerow(READING_COLUMNS)
        for entry, trace in passes:
            index.writerow(astuple(entry))
            readings.writerows(_rows(entry.pass_id, trace))


@contextmanager
def _open_reproducible(path: Path) -> Iterator[TextIO]:
    """A gzip text file without name and time, so that the same passes make the same bytes."""
    with (
        path.open("wb") as raw,
        gzip.GzipFile("", "wb", compresslevel=6, fileobj=raw, mtime=0) as packed,
        io.TextIOWrapper(packed, encoding="utf-8", newline="") as text,
    ):
        yield text


def _road(feature: dict[str, Any]) -> Road:
    properties = feature.get("properties") or {}
    road_id = str(properties.get("road_id", feature.get("id", "")))
    if not road_id or feature["geometry"]["type"] != "LineString":
        raise ValueError(f"feature {road_id or feature} is no LineString with a road_id")
    lon, lat = np.array([point[:2] for point in feature["geometry"]["coordinates"]], float).T
    return Road(road_id, properties.get("name"), Line(lon, lat))


def _feature(road: Road) -> dict[str, Any]:
    if road.line is None:
        raise BadDataset(f"road {road.road_id} has no line to write")
    coordinates = np.round(np.stack([road.line.lon, road.line.lat], axis=1), 9).tolist()
    return {
        "type": "Feature",
        "id": road.road_id,
        "properties": {"road_id": road.road_id, "length_m": round(length_m(road.line), 3)},
        "geometry": {"type": "LineString", "coordinates": coordinates},
    }


def _entry(row: dict[str, str]) -> PassEntry:
    role = row["role"]
    if role not in {"survey", "test"}:
        raise ValueError(f"role {role!r} is neither survey nor test")
    return PassEntry(
        row["pass_id"],
        row["road_id"],
        "survey" if role == "survey" else "test",
        Direction(row["direction"]),
        row.get("session", ""),
    )


def _rows(pass_id: str, trace: Trace) -> Iterator[tuple[str, ...]]:
    if trace.recorded_at is None:
        raise BadDataset(f"pass {pass_id} has no recorded_at to write its times from")
    start_s = trace.recorded_at.timestamp()
    for i, levels_dbm in enumerate(trace.rsrp_dbm):
        heard = np.flatnonzero(np.isfinite(levels_dbm))
        strongest = int(np.nanargmax(levels_dbm)) if heard.size else -1
        place = (f"{start_s + trace.time_s[i]:.3f}", f"{trace.lat[i]:.8f}", f"{trace.lon[i]:.8f}")
        for k in heard.tolist():
            level = f"{levels_dbm[k]:.7g}"
            yield (pass_id, *place, trace.cells[k], level, str(int(k == strongest)))
