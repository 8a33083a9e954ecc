"""`GET /v1/coverage`: who drove where, the error to expect, and where the next drive helps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
import sqlalchemy as sa

from app.api.schemas.coverage import CoverageCollection
from app.domain import Line, Trace
from app.store.engine import write
from app.store.tables import segment_coverage
from tests.api.conftest import Service, assert_problem, serving, survey_json
from tests.factories import FRAME, line_at, trace_along

LINE = line_at(40.0)


def passes(days: list[int], *, road_id: str = "driven") -> list[Trace]:
    """A pass a day, every second one backward, by two phones in turn."""
    found = []
    for number, day in enumerate(days):
        trace = trace_along(LINE, seed=number, road_id=road_id, device=f"phone-{number % 2}")
        trace = replace(trace, recorded_at=datetime(2021, 5, day, 10, tzinfo=UTC))
        if number % 2:
            trace = replace(
                trace, lon=trace.lon[::-1], lat=trace.lat[::-1], rsrp_dbm=trace.rsrp_dbm[::-1]
            )
        found.append(trace)
    return found


def draw(service: Service, road_id: str, line: Line, name: str | None = None) -> None:
    coordinates = np.column_stack([line.lon, line.lat]).tolist()
    body = {"name": name, "line": {"type": "LineString", "coordinates": coordinates}}
    service.client.put(f"/v1/roads/{road_id}", json=body).raise_for_status()


def post(service: Service, trace: Trace) -> None:
    posted = service.client.post("/v1/surveys?build=false", json=survey_json(trace))
    assert posted.status_code == 202, posted.text


@pytest.fixture(scope="module")
def covered(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A road driven five times on three days, one driven half way once, one that is drawn only."""
    with serving(tmp_path_factory.mktemp("covered")) as service:
        draw(service, "driven", LINE, "Main Street")
        for trace in passes([1, 1, 2, 3, 3]):
            post(service, trace)
        draw(service, "half", line_at(80.0))
        half = trace_along(line_at(80.0, length_m=100.0), seed=9, road_id="half", device=None)
        post(service, replace(half, recorded_at=None))
        service.wait_for_map(service.build("driven", "half"))
        draw(service, "wanted", line_at(5000.0, length_m=300.0))
        yield service


def get(service: Service, **query: Any) -> dict[str, Any]:
    answer = service.client.get("/v1/coverage", params=query)
    assert answer.status_code == 200, answer.text
    document: dict[str, Any] = answer.json()
    CoverageCollection.model_validate(document, extra="forbid")
    return document


def of_road(document: dict[str, Any], road_id: str) -> list[dict[str, Any]]:
    told = [feature["properties"] for feature in document["features"]]
    return [one for one in told if one["road_id"] == road_id]


def test_every_stretch_says_who_drove_it(covered: Service):
    """Passes by direction, days, devices, cells, the newest survey and the error to expect."""
    for one in of_road(get(covered), "driven"):
        assert (one["passes"], one["forward"], one["backward"]) == (5, 3, 2)
        assert (one["days"], one["devices"], one["cells"]) == (3, 2, 3)
        assert one["last_surveyed_at"] == "2021-05-03T10:00:00Z"
        assert one["name"] == "Main Street"
        assert 0 < one["cells_per_sample"] <= 3
        assert one["spread_db"] > 0
        assert 0 < one["expected_error_m"] <= 300
        assert one["road_right"] == 0.95


def test_a_stretch_that_a_pass_did_not_reach_has_none(covered: Service):
    """Half a road driven is half covered; undated, unnamed passes are one day, one device."""
    first, middle, last = of_road(get(covered), "half")
    assert (first["passes"], first["days"], first["devices"]) == (1, 1, 1)
    assert first["last_surveyed_at"] is None
    assert (last["passes"], last["days"], last["expected_error_m"]) == (0, 0, None)
    assert middle["passes"] in {0, 1}


def test_a_road_without_a_model_is_one_stretch_of_zeros(covered: Service):
    """It was drawn and nobody drove it."""
    (one,) = of_road(get(covered), "wanted")
    assert one["segment_index"] is None
    assert one["length_m"] == pytest.approx(300.0, rel=1e-3)
    assert (one["passes"], one["days"], one["devices"], one["cells"]) == (0, 0, 0, 0)
    assert one["expected_error_m"] is None


def test_the_summary_is_of_all_and_names_what_is_worth_a_drive(covered: Service):
    """Lengths add up; what nobody drove comes first, with the reason in words."""
    document = get(covered, limit=1)
    summary = document["summary"]
    assert summary["length_m"] == pytest.approx(700.0, rel=1e-3)
    assert sum(summary["length_m_by_passes"].values()) == pytest.approx(summary["length_m"])
    assert summary["length_m_by_passes"]["more"] == pytest.approx(200.0, rel=1e-3)
    assert 0.5 < summary["both_directions"] < 1.0
    best = summary["most_worth_a_drive"][0]
    assert best["road_id"] == "wanted"
    assert best["reason"].startswith("never driven")
    once = [one for one in summary["most_worth_a_drive"] if "driven once" in one["reason"]]
    assert once[0]["road_id"] == "half"
    assert "only forward" in once[0]["reason"]
    spread = summary["expected_error_m"]
    assert spread["p10"] <= spread["p50"] <= spread["p90"]


def test_pages_join_to_the_whole(covered: Service):
    """Every stretch once, in order, whatever the size of a page."""
    whole = get(covered)
    assert whole["next_cursor"] is None
    for limit in (1, 2, 5):
        ids, cursor = [], None
        while True:
            page = get(covered, limit=limit, **({"cursor": cursor} if cursor else {}))
            assert len(page["features"]) <= limit
            assert page["summary"] == whole["summary"]
            ids += [feature["id"] for feature in page["features"]]
            cursor = page["next_cursor"]
            if cursor is None:
                break
        assert ids == [feature["id"] for feature in whole["features"]]


def test_a_box_keeps_the_stretches_that_touch_it(covered: Service):
    """Stretches, not roads; the summary is of the box."""
    first = of_road(get(covered), "driven")[0]
    west, south = FRAME.to_lonlat(-5.0, 35.0).lon, FRAME.to_lonlat(-5.0, 35.0).lat
    east, north = FRAME.to_lonlat(20.0, 45.0).lon, FRAME.to_lonlat(20.0, 45.0).lat
    document = get(covered, bbox=f"{west},{south},{east},{north}")
    assert [feature["properties"] for feature in document["features"]] == [first]
    assert document["summary"]["length_m"] == pytest.approx(first["length_m"])
    assert get(covered, bbox="0,0,1,1")["features"] == []
    assert get(covered, bbox="0,0,1,1")["summary"]["both_directions"] is None


def test_geojson_is_what_it_is_and_json_what_it_may_be_called(covered: Service):
    """One document under two names, with two tags; a third name is not acceptable."""
    plain = covered.client.get("/v1/coverage")
    assert plain.headers["content-type"] == "application/geo+json"
    named = covered.client.get("/v1/coverage", headers={"Accept": "application/json"})
    assert named.headers["content-type"] == "application/json"
    assert named.content == plain.content
    assert named.headers["etag"] != plain.headers["etag"]
    refused = covered.client.get("/v1/coverage", headers={"Accept": "text/html"})
    assert_problem(refused, 406, "not-acceptable")


def test_what_is_known_is_not_sent_again(covered: Service):
    """The tag names the map version; 304 without a body."""
    first = covered.client.get("/v1/coverage")
    assert f"coverage-{first.json()['map_version']}-" in first.headers["etag"]
    again = covered.client.get("/v1/coverage", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(
    ("query", "status", "code", "pointers"),
    [
        ("bbox=1,2,3", 422, "invalid-input", {""}),
        ("bbox=0,50,1,40", 422, "invalid-input", {""}),
        ("bbox=nan,0,1,1", 422, "invalid-input", {""}),
        ("limit=0", 422, "invalid-input", {""}),
        ("limit=1001", 422, "invalid-input", {""}),
        ("limit=many", 422, "invalid-input", {""}),
        ("cursor=%20", 422, "invalid-input", {"/cursor"}),
        ("cursor=bm9ydGg", 422, "invalid-input", {"/cursor"}),
        ("version=0", 422, "invalid-input", {""}),
        ("version=99", 404, "not-found", set()),
        ("version=99999999999", 422, "invalid-input", {""}),
    ],
)
def test_wrong_questions_are_told_what_is_wrong(
    covered: Service, query: str, status: int, code: str, pointers: set[str]
):
    """Every refusal is a problem document."""
    assert_problem(covered.client.get(f"/v1/coverage?{query}"), status, code, pointers)


def test_without_a_map_roads_wait_for_their_first_drive(service: Service):
    """Nothing at all, then a drawn road with zeros: no map is no reason to refuse."""
    empty = get(service)
    assert (empty["map_version"], empty["features"]) == (None, [])
    assert empty["summary"]["expected_error_m"] == {"p10": None, "p50": None, "p90": None}
    trace = trace_along(line_at(), seed=1, road_id="posted")
    service.client.post("/v1/surveys?build=false", json=survey_json(trace)).raise_for_status()
    (waiting,) = get(service)["features"]
    assert waiting["properties"]["passes"] == 0
    assert waiting["geometry"]["type"] == "LineString"


def test_each_map_has_its_own_coverage(service: Service):
    """Versions keep theirs; of one from before the counting everything is null."""
    draw(service, "r", LINE)
    first, second = passes([1, 2], road_id="r")
    post(service, first)
    old = service.build()
    post(service, second)
    service.build()
    assert {one["passes"] for one in of_road(get(service, version=old), "r")} == {1}
    assert {one["passes"] for one in of_road(get(service), "r")} == {2}
    uncounted = service.build()
    with write(service.engine) as connection:
        connection.execute(sa.delete(segment_coverage))
    document = get(service, version=uncounted)
    assert {one["passes"] for one in of_road(document, "r")} == {None}
    assert {one["days"] for one in of_road(document, "r")} == {None}
    assert document["summary"]["length_m_by_passes"]["unknown"] > 0
    assert document["summary"]["most_worth_a_drive"] == []
