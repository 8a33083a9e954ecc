"""`roadprint roads`: networks of every known format come in once, and are listed."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.commands.networks import BadNetwork, read_network
from app.numerics.lines import length_m

STREET = [[-118.49, 34.01], [-118.488, 34.01], [-118.486, 34.01]]
NODES = {  # a crossing at 3; 1-3-5 is the street, 2-3-4 the avenue
    1: (-118.490, 34.010), 2: (-118.488, 34.012), 3: (-118.488, 34.010),
    4: (-118.488, 34.008), 5: (-118.486, 34.010), 6: (-118.484, 34.010), 7: (-118.484, 34.013),
}  # fmt: skip
WAYS = {
    11: ("Main Street", "residential", [1, 3]),
    12: ("Main Street", "residential", [5, 3]),
    13: ("Avenue", "tertiary", [2, 3, 4]),
    14: ("Main Street", "residential", [5, 6]),
    15: ("Foot Path", "footway", [6, 7]),
    16: (None, "service", [4, 1]),
    17: ("Closed", "residential", [6, 7]),
}
CLOSED = {17}


def tags_of(number: int) -> dict[str, str]:
    name, kind, _ = WAYS[number]
    tags = {"highway": kind} | ({"name": name} if name else {})
    return tags | ({"access": "private"} if number in CLOSED else {})


def overpass(*, geometry: bool) -> dict:
    ways = [
        {"type": "way", "id": number, "nodes": nodes, "tags": tags_of(number)}
        for number, (_, _, nodes) in WAYS.items()
    ]
    if geometry:
        for way in ways:
            way["geometry"] = [{"lon": NODES[n][0], "lat": NODES[n][1]} for n in way["nodes"]]
        return {"version": 0.6, "elements": ways}
    nodes = [{"type": "node", "id": n, "lon": x, "lat": y} for n, (x, y) in NODES.items()]
    return {"version": 0.6, "elements": [*ways, *nodes]}


def extract(path):
    """An extract of OpenStreetMap with the same ways."""
    osmium = pytest.importorskip("osmium", reason="the extra `osm` is not installed")
    with osmium.SimpleWriter(str(path)) as writer:
        for number, place in NODES.items():
            writer.add_node(osmium.osm.mutable.Node(id=number, location=place))
        for number, (_, _, nodes) in WAYS.items():
            writer.add_way(osmium.osm.mutable.Way(id=number, nodes=nodes, tags=tags_of(number)))
    return path


def run(*words: object):
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.mark.parametrize("kind", ["geometry", "nodes", "osm.pbf", "osm"])
def test_ways_become_streets(tmp_path, kind):
    """Pieces of a street are one road over its crossing; foot paths and closed ways are none."""
    if kind.startswith("osm"):
        path = extract(tmp_path / f"town.{kind}")
    else:
        path = tmp_path / "town.json"
        path.write_text(json.dumps(overpass(geometry=kind == "geometry")))
    roads = {road.road_id: road for road in read_network(path)}
    assert {road_id: road.name for road_id, road in roads.items()} == {
        "osm-11": "Main Street",
        "osm-13": "Avenue",
    }
    lon = roads["osm-11"].line.lon
    assert sorted(lon.tolist()) == [-118.490, -118.488, -118.486, -118.484]
    assert np.all(np.diff(lon) > 0) or np.all(np.diff(lon) < 0)


def test_the_order_of_the_ways_moves_no_id(tmp_path):
    """A file with its elements the other way round has the same roads."""
    one, other = tmp_path / "one.json", tmp_path / "other.json"
    document = overpass(geometry=True)
    one.write_text(json.dumps(document))
    document["elements"].reverse()
    other.write_text(json.dumps(document))
    assert [road.road_id for road in read_network(one)] == [
        road.road_id for road in read_network(other)
    ]


def test_a_way_round_a_corner_is_cut_at_the_crossing(tmp_path):
    """Where other streets meet it, a sharp turn within a way ends the road."""
    nodes = {1: (0.0, 0.0), 2: (0.002, 0.0), 3: (0.002, 0.002), 4: (0.004, 0.0)}
    ways = {21: [1, 2, 3], 22: [2, 4]}
    elements = [{"type": "node", "id": n, "lon": x, "lat": y} for n, (x, y) in nodes.items()]
    elements += [
        {"type": "way", "id": n, "nodes": w, "tags": {"highway": "residential", "name": "Main"}}
        for n, w in ways.items()
    ]
    path = tmp_path / "corner.json"
    path.write_text(json.dumps({"elements": elements}))
    roads = {road.road_id: road.line.lat.max() for road in read_network(path)}
    assert roads == {"osm-21": 0.0, "osm-21.1": 0.002}


def geojson(path, *geometries, **properties):
    features = [
        {"type": "Feature", "properties": properties, "geometry": geometry}
        for geometry in geometries
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def test_geojson_lines_are_roads_as_they_are_drawn(tmp_path):
    """Ids and names are theirs; the parts of a MultiLineString are numbered."""
    many = {"type": "MultiLineString", "coordinates": [STREET[:2], STREET[1:]]}
    path = geojson(tmp_path / "roads.geojson", many, id="a", name="High Street")
    assert [(road.road_id, road.name) for road in read_network(path)] == [
        ("a-1", "High Street"),
        ("a-2", "High Street"),
    ]


def test_a_line_that_was_cut_at_the_antimeridian_is_one_road(tmp_path):
    """Parts that meet on 180 degrees are joined; others of a MultiLineString are roads each."""
    parts = [[[179.999, -16.85], [180.0, -16.8505]], [[-180.0, -16.8505], [-179.998, -16.851]],
             [[-179.9, -16.85], [-179.8, -16.85]]]  # fmt: skip
    cut = {"type": "Feature", "properties": {"road_id": "main"},
           "geometry": {"type": "MultiLineString", "coordinates": parts}}  # fmt: skip
    path = tmp_path / "taveuni.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [cut]}))
    found = {road.road_id: road.line for road in read_network(path)}
    assert found["main-1"].lon.tolist() == [179.999, -179.998]
    assert length_m(found["main-1"]) == pytest.approx(338.0, abs=2.0)
    assert found["main-2"].lon.tolist() == [-179.9, -179.8]


def test_a_line_without_an_id_gets_one_of_its_own(tmp_path):
    """The same line has the same id in every file, another line another."""
    line = {"type": "LineString", "coordinates": STREET}
    other = {"type": "LineString", "coordinates": STREET[:2]}
    once = read_network(geojson(tmp_path / "one.json", line, other))
    (again,) = read_network(geojson(tmp_path / "two.json", line))
    assert once[0].road_id == again.road_id != once[1].road_id


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"not json", "neither"),
        (b"{}", "neither"),
        (b'{"features": [{"geometry": null}]}', "/features/0"),
        (b'{"features": [{"geometry": {"type": "LineString", "coordinates": [[1, 2]]}}]}', "two"),
        (b'{"features": [{"geometry": {"type": "LineString", "coordinates": [[500, 2], [1, 2]]}}]}',
         "degrees"),
        (b'{"elements": [{"type": "way", "tags": {"highway": "road"}}]}', "/elements"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_with_the_place(tmp_path, content, words):
    """Nothing of it is taken in."""
    path = tmp_path / "wrong.json"
    path.write_bytes(content)
    with pytest.raises(BadNetwork, match=words):
        read_network(path)


def test_a_broken_extract_is_refused(tmp_path):
    """A file that is called an extract and is none is named."""
    pytest.importorskip("osmium", reason="the extra `osm` is not installed")
    path = tmp_path / "town.osm.pbf"
    path.write_bytes(b"no extract at all")
    with pytest.raises(BadNetwork, match=r"town\.osm\.pbf"):
        read_network(path)


def test_roads_are_imported_and_listed(tmp_path):
    """Twice is as once; the list has the drawn length before any survey came."""
    line = {"type": "LineString", "coordinates": STREET}
    path = geojson(tmp_path / "roads.geojson", line, id="high-street", name="High Street")
    packed = tmp_path / "roads.geojson.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    for file in (path, packed):
        done = run("roads", "import", file, "--data", tmp_path / "store")
        assert done.exit_code == 0, done.output
    listed = run("roads", "list", "--data", tmp_path / "store")
    (road,) = read_network(path)
    assert listed.exit_code == 0, listed.output
    assert "High Street" in listed.stdout
    assert f"{length_m(road.line):.0f}" in listed.stdout
    assert "1 roads" in listed.stdout


def test_a_file_without_roads_is_refused(tmp_path):
    """Points alone are no network."""
    path = geojson(tmp_path / "points.json", {"type": "Point", "coordinates": [1.0, 2.0]})
    done = run("roads", "import", path, "--data", tmp_path / "store")
    assert done.exit_code == 1
