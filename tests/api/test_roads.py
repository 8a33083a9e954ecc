"""Roads, segments and cells, as JSON and GeoJSON, with ETags."""

from __future__ import annotations

from typing import Any

import pytest

from app.api.schemas import roads as shapes
from tests.api.conftest import Service, assert_problem, survey_json
from tests.factories import CELLS, line_at, trace_along

GEOJSON = {"Accept": "application/geo+json"}
READS: list[tuple[str, Any, Any]] = [
    ("/v1/roads", shapes.RoadPage, shapes.FeatureCollection),
    ("/v1/roads/north", shapes.RoadDocument, shapes.Feature),
    ("/v1/roads/north/segments", shapes.SegmentList, shapes.FeatureCollection),
    ("/v1/roads/north/segments/1", shapes.SegmentDocument, shapes.Feature),
]


@pytest.mark.parametrize(("path", "plain", "geo"), READS)
def test_every_read_comes_in_both_forms(shared: Service, path: str, plain: Any, geo: Any):
    """JSON by default, GeoJSON when it is preferred, both in their documented shape."""
    for accept in (None, "application/json", "*/*", "application/*;q=0.5, text/html"):
        headers = {"Accept": accept} if accept else {}
        answer = shared.client.get(path, headers=headers)
        assert answer.headers["content-type"] == "application/json"
        plain.model_validate(answer.json(), extra="forbid")
    for accept in (
        "application/geo+json",
        "application/geo+json, */*;q=0.1",
        "application/json;q=0.2, application/*",
    ):
        answer = shared.client.get(path, headers={"Accept": accept})
        assert answer.headers["content-type"] == "application/geo+json"
        geo.model_validate(answer.json(), extra="forbid")


@pytest.mark.parametrize("path", [path for path, _, _ in READS])
@pytest.mark.parametrize("accept", ["text/html", "application/json;q=0", "image/*"])
def test_other_forms_are_not_acceptable(shared: Service, path: str, accept: str):
    """406 names what there is."""
    answer = shared.client.get(path, headers={"Accept": accept})
    assert "application/geo+json" in assert_problem(answer, 406, "not-acceptable")["detail"]


@pytest.mark.parametrize(
    ("path", "headers"),
    [(path, headers) for path, _, _ in READS for headers in ({}, GEOJSON)]
    + [("/v1/maps", {}), ("/v1/maps/active", {}), ("/v1/cells", {})],
)
def test_what_is_known_is_not_sent_again(shared: Service, path: str, headers: dict[str, str]):
    """`If-None-Match` with the answer's ETag gets 304 and no body; another tag gets all of it."""
    first = shared.client.get(path, headers=headers)
    etag = first.headers["etag"]
    for known in (etag, etag.removeprefix("W/"), f'"other", {etag}', "*"):
        again = shared.client.get(path, headers={**headers, "If-None-Match": known})
        assert (again.status_code, again.content) == (304, b"")
        assert again.headers["etag"] == etag
    other = shared.client.get(path, headers={**headers, "If-None-Match": 'W/"other"'})
    assert other.json() == first.json()


def test_the_two_forms_have_two_tags(shared: Service):
    """A cache must not answer one form with the other."""
    plain, geo = shared.client.get("/v1/roads"), shared.client.get("/v1/roads", headers=GEOJSON)
    assert plain.headers["etag"] != geo.headers["etag"]
    assert plain.headers["vary"] == "Accept"


def test_a_new_map_and_a_new_name_change_the_tag(service: Service):
    """A tag lives as long as what it stands for."""
    trace = trace_along(line_at(), seed=1, road_id="r")
    service.client.post("/v1/surveys?build=false", json=survey_json(trace))
    tags = [service.client.get("/v1/roads/r").headers["etag"]]
    service.build()
    tags.append(service.client.get("/v1/roads/r").headers["etag"])
    service.client.put("/v1/roads/r", json={"name": "Main Street"})
    tags.append(service.client.get("/v1/roads/r").headers["etag"])
    assert len(set(tags)) == 3


def test_a_segment_says_all_that_is_known_of_it(shared: Service):
    """Stretch, place, features with units and mask, information gain, fits and passes."""
    segment = shared.client.get("/v1/roads/north/segments/1").json()
    assert segment["start_m"] < segment["end_m"]
    assert segment["geometry"]["type"] == "LineString"
    units = {kind: feature["unit"] for kind, feature in segment["features"].items()}
    assert units == {
        "mean_gradient": "dB/m",
        "mean": "dBm",
        "variance": "dB^2",
        "mean_difference": "dB",
        "range": "dB",
    }
    assert segment["cells"] == sorted(CELLS)
    for feature in segment["features"].values():
        assert len(feature["values"]) == len(feature["mask"]) == len(CELLS)
        assert all(isinstance(flag, bool) for flag in feature["mask"])
    assert segment["information_gain_bits"] <= segment["full_information_gain_bits"]
    assert {fit["cell"] for fit in segment["fits"]} == set(CELLS)
    assert all(fit["residual_db"] > 0 and fit["knots_m"] for fit in segment["fits"])
    assert segment["pass_count"] == 2


def test_geojson_features_carry_the_document(shared: Service):
    """A feature is the JSON document with its line as the geometry."""
    road = shared.client.get("/v1/roads/north").json()
    feature = shared.client.get("/v1/roads/north", headers=GEOJSON).json()
    assert feature["geometry"] == road["line"]
    assert {**feature["properties"], "line": feature["geometry"]} == road
    segment = shared.client.get("/v1/roads/north/segments/0").json()
    feature = shared.client.get("/v1/roads/north/segments/0", headers=GEOJSON).json()
    assert feature["id"] == "north/0"
    assert {**feature["properties"], "geometry": feature["geometry"]} == {
        "road_id": "north",
        **segment,
    }


def test_pages_of_roads_follow_one_another(shared: Service):
    """A cursor leads from page to page, in both forms."""
    first = shared.client.get("/v1/roads?limit=1").json()
    assert [road["id"] for road in first["roads"]] == ["north"]
    query = {"limit": 1, "cursor": first["next_cursor"]}
    second = shared.client.get("/v1/roads", params=query, headers=GEOJSON).json()
    assert [feature["id"] for feature in second["features"]] == ["south"]
    assert second["next_cursor"] is None


def test_a_box_keeps_the_roads_that_touch_it(shared: Service):
    """`bbox` is west, south, east, north; an empty one is none."""
    lon, lat = shared.client.get("/v1/roads/south").json()["line"]["coordinates"][0]
    small = f"{lon - 1e-5},{lat - 1e-5},{lon + 1e-5},{lat + 1e-5}"
    for bbox, wanted in ((small, ["south"]), ("0,0,1,1", []), ("", ["north", "south"]),
                         ("100,-80,-100,80", ["north", "south"])):  # fmt: skip
        page = shared.client.get("/v1/roads", params={"bbox": bbox}).json()
        assert [road["id"] for road in page["roads"]] == wanted, bbox


BAD_QUERIES = [
    "bbox=1,2,3",
    "bbox=1,2,3,x",
    "bbox=nan,0,1,1",
    "bbox=0,2,1,1",
    "bbox=-181,0,1,1",
    "limit=0",
    "limit=1001",
    "limit=many",
    "cursor=%25%25",
    "cursor=AA",
    "map_version=0",
    "map_version=99999999999999999999",
]


@pytest.mark.parametrize("query", BAD_QUERIES)
def test_a_bad_query_is_refused(shared: Service, query: str):
    """Parameters are validated like bodies, and named."""
    document = assert_problem(shared.client.get(f"/v1/roads?{query}"), 422, "invalid-input")
    assert query.split("=", maxsplit=1)[0] in document["detail"]


@pytest.mark.parametrize(
    "path",
    [
        "/v1/roads/none",
        "/v1/roads/none/segments",
        "/v1/roads/none/segments/0",
        "/v1/roads/north/segments/99",
        "/v1/roads?map_version=99",
        "/v1/cells?map_version=99",
    ],
)
def test_what_is_not_there_is_not_found(shared: Service, path: str):
    """Unknown roads, segments and versions are 404."""
    assert_problem(shared.client.get(path), 404, "not-found")


def test_an_earlier_map_can_still_be_read(service: Service):
    """`map_version` reads a road as an earlier version had it."""
    for road_id in ("a", "b"):
        trace = trace_along(line_at(), seed=ord(road_id), road_id=road_id)
        service.client.post("/v1/surveys?build=false", json=survey_json(trace))
        service.build(road_id)
    assert service.client.get("/v1/roads/b").json()["segment_count"] == 3
    assert service.client.get("/v1/roads/b?map_version=1").json()["segment_count"] == 0
    assert service.client.get("/v1/roads/b/segments?map_version=1").json()["segments"] == []


LINE = {"type": "LineString", "coordinates": [[-118.49, 34.01], [-118.48, 34.02, 12.5]]}


def test_a_road_can_be_named_and_drawn(service: Service):
    """PUT makes a road; what it leaves out stays."""
    made = service.client.put("/v1/roads/main street", json={"name": "Main Street", "line": LINE})
    assert made.status_code == 200
    shapes.RoadDocument.model_validate(made.json())
    assert made.json()["line"]["coordinates"] == [[-118.49, 34.01], [-118.48, 34.02]]
    renamed = service.client.put("/v1/roads/main street", json={"name": "High Street"}).json()
    assert renamed == {**made.json(), "name": "High Street"}
    assert service.client.get("/v1/roads/main street").json() == renamed


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"colour": "red"}, "/colour"),
        ({"name": ""}, "/name"),
        ({"name": 3}, "/name"),
        ({"line": {"type": "Point", "coordinates": [1, 2]}}, "/line/type"),
        ({"line": {**LINE, "coordinates": [[1, 2]]}}, "/line/coordinates"),
        ({"line": {**LINE, "coordinates": [[1, 2], [3]]}}, "/line/coordinates/1"),
        ({"line": {**LINE, "coordinates": [[1, 2], ["3", 4]]}}, "/line/coordinates/1/0"),
        ({"line": {**LINE, "coordinates": [[1, 2], [3, 95]]}}, "/line/coordinates/1"),
        ({"line": {**LINE, "coordinates": [[1, 2], [1, 2]]}}, "/line/coordinates"),
        ({"line": {**LINE, "crs": "x"}}, "/line/crs"),
        ([], ""),
    ],
)
def test_a_bad_road_is_refused(service: Service, body: Any, pointer: str):
    """Names and lines are validated, and a refused road is not made."""
    answer = service.client.put("/v1/roads/r", json=body)
    document = assert_problem(answer, 422, "invalid-input")
    assert pointer in {fault["pointer"] for fault in document["errors"]}
    assert_problem(service.client.get("/v1/roads/r"), 404, "not-found")


def test_cells_say_where_they_are_heard(shared: Service):
    """Every mapped cell with its roads, segments and levels."""
    answer = shared.client.get("/v1/cells")
    cells = shapes.CellList.model_validate_json(answer.content).cells
    assert [cell.cell for cell in cells] == sorted(CELLS)
    assert all(cell.road_count == 2 for cell in cells)
    assert all(cell.min_rsrp_dbm <= cell.mean_rsrp_dbm <= cell.max_rsrp_dbm for cell in cells)
