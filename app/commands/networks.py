"""Files of drawn roads: GeoJSON, Overpass JSON, and extracts of OpenStreetMap."""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from app.domain import Line, Road
from app.errors import RoadprintError
from app.numerics.network.ways import Way, roads_of_ways

# Roads for cars (OpenStreetMap's key "highway"); service ways are drive ways and car parks.
DRIVEABLE = frozenset(
    {"motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential",
     "living_street", "road", "motorway_link", "trunk_link", "primary_link", "secondary_link",
     "tertiary_link"}
)  # fmt: skip
CLOSED = frozenset({"no", "private"})
OSM_SUFFIXES = (".osm.pbf", ".pbf", ".osm", ".osm.bz2", ".osm.gz")


class BadNetwork(RoadprintError):
    """The file is no network of roads; the message says what is wrong, and where."""

    code = "bad-network"
    title = "The file is no network of roads"


def read_network(path: Path) -> list[Road]:
    """
    The roads of a file, each with its line and a stable id.

    Roads of GeoJSON are taken as they are drawn; ways of OpenStreetMap are joined to streets.

    Raises:
        BadNetwork: It is none of the known formats, or broken.
    """
    if path.name.lower().endswith(OSM_SUFFIXES):
        return roads_of_ways(_ways_of_extract(path), "osm-")
    try:
        plain = path.read_bytes()
        packed = plain.startswith(b"\x1f\x8b")
        document = orjson.loads(gzip.decompress(plain) if packed else plain)
    except (ValueError, EOFError, gzip.BadGzipFile) as error:
        raise BadNetwork(
            f"{path}: neither an extract of OpenStreetMap nor JSON: {error}"
        ) from error
    if isinstance(document, dict) and isinstance(document.get("elements"), list):
        return roads_of_ways(_ways_of_overpass(path, document["elements"]), "osm-")
    if isinstance(document, dict) and isinstance(document.get("features"), list):
        return _roads_of_geojson(path, document["features"])
    raise BadNetwork(f"{path}: neither GeoJSON (features) nor an Overpass answer (elements)")


def _roads_of_geojson(path: Path, features: list[Any]) -> list[Road]:
    roads: dict[str, Road] = {}
    for number, feature in enumerate(features):
        try:
            for road in _roads_of_feature(feature):
                if road.road_id in roads:
                    raise ValueError(f"the id {road.road_id} stands twice")
                roads[road.road_id] = road
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise BadNetwork(f"{path}: /features/{number}: {error!r}") from error
    return list(roads.values())


def _roads_of_feature(feature: dict[str, Any]) -> Iterator[Road]:
    geometry, properties = feature["geometry"], feature.get("properties") or {}
    kind = geometry["type"]
    if kind not in {"LineString", "MultiLineString"}:
        return  # points and areas stand beside roads in many files
    parts = [geometry["coordinates"]] if kind == "LineString" else geometry["coordinates"]
    named = properties.get("road_id", feature.get("id", properties.get("id")))
    name = properties.get("name")
    parts = _rejoined(parts)
    for number, coordinates in enumerate(parts):
        line = _line(coordinates)
        road_id = str(named) if named not in {None, ""} else _id_of(line)
        suffix = f"-{number + 1}" if len(parts) > 1 else ""
        yield Road(road_id + suffix, str(name) if name else None, line)


def _rejoined(parts: list[Any]) -> list[Any]:
    """Parts of one line that was cut at the antimeridian, as RFC 7946 wants it, in one again."""
    whole = parts[:1]
    for part in parts[1:]:
        (lon, lat), (next_lon, next_lat) = whole[-1][-1][:2], part[0][:2]
        if abs(lon) == 180.0 and next_lon == -lon and lat == next_lat:
            whole[-1] = [*whole[-1][:-1], *part[1:]]  # the seam is no vertex of the road's
        else:
            whole.append(part)
    return whole


def _line(coordinates: Any) -> Line:
    at = np.array([point[:2] for point in coordinates], dtype=float)
    if at.ndim != 2 or len(at) < 2:
        raise ValueError("a line needs two positions")
    lon, lat = at.T
    if not (np.all(np.abs(lon) <= 180.0) and np.all(np.abs(lat) <= 90.0)):
        raise ValueError("positions must be WGS 84 degrees, longitude first")
    return Line(lon.copy(), lat.copy())


def _id_of(line: Line) -> str:
    """An id of what the line is, for lines that have none."""
    places = np.round(np.column_stack([line.lon, line.lat]), 7)
    return f"line-{hashlib.sha256(places.tobytes()).hexdigest()[:12]}"


def _ways_of_overpass(path: Path, elements: list[Any]) -> Iterator[Way]:
    try:
        nodes = {
            one["id"]: (float(one["lon"]), float(one["lat"]))
            for one in elements
            if one["type"] == "node"
        }
        for one in elements:
            if one["type"] == "way" and _is_driveable(one.get("tags") or {}):
                way = _way_of_overpass(one, nodes)
                if way is not None:
                    yield way
    except (KeyError, TypeError, ValueError) as error:
        raise BadNetwork(f"{path}: /elements: {error!r}; ask with `out geom` or `(._;>;); out`"
                         ) from error  # fmt: skip


def _way_of_overpass(one: dict[str, Any], nodes: dict[int, tuple[float, float]]) -> Way | None:
    ids = [int(node) for node in one["nodes"]]
    if "geometry" in one:
        drawn = zip(ids, one["geometry"], strict=True)
        places = [(node, float(p["lon"]), float(p["lat"])) for node, p in drawn if p is not None]
    else:
        places = [(node, *nodes[node]) for node in ids if node in nodes]
    if len(places) < 2:
        return None
    kept, lon, lat = zip(*places, strict=True)
    name = (one.get("tags") or {}).get("name")
    return Way(int(one["id"]), name, tuple(kept), np.array(lon), np.array(lat))


def _ways_of_extract(path: Path) -> Iterator[Way]:
    try:
        import osmium  # noqa: PLC0415 - an extra: only who imports extracts needs it
    except ImportError as error:
        raise BadNetwork(f"{path}: extracts need `pip install roadprint[osm]`") from error
    try:
        ways = osmium.FileProcessor(str(path)).with_locations()
        for one in ways.with_filter(osmium.filter.KeyFilter("highway")):
            if isinstance(one, osmium.osm.Way) and _is_driveable(dict(one.tags)):
                places = [(n.ref, n.lon, n.lat) for n in one.nodes if n.location.valid()]
                if len(places) > 1:
                    kept, lon, lat = zip(*places, strict=True)
                    name = one.tags.get("name")
                    yield Way(one.id, name, tuple(kept), np.array(lon), np.array(lat))
    except RuntimeError as error:
        raise BadNetwork(f"{path}: {error}") from error


def _is_driveable(tags: dict[str, str]) -> bool:
    if tags.get("highway") not in DRIVEABLE or tags.get("area") == "yes":
        return False
    access = next((tags[k] for k in ("motor_vehicle", "vehicle", "access") if k in tags), "yes")
    return access not in CLOSED
