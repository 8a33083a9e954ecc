"""Survey tools' files as request bodies, and the door for Android apps that know Ichnaea."""

from __future__ import annotations

import gzip
import json
from typing import get_args

import pytest

from app.api.routes.surveys import FileFormat
from app.formats.sniff import FORMATS
from tests.api.conftest import Service, assert_problem
from tests.formats import samples

KML = "application/vnd.google-earth.kml+xml"
TYPES = {
    "gnettrack": "text/plain", "gnettrack-kml": KML, "opencellid": "text/csv",
    "geosubmit": "application/json", "network-survey": "text/csv",
    "network-survey-json": "application/json", "romes": "text/csv",
}  # fmt: skip
FIELDS = {"survey_id", "build_id", "roads", "samples", "dropped"}


def post(service: Service, name: str, media_type: str | None = None, **query: object):
    headers = {"Content-Type": media_type or TYPES[name]}
    return service.client.post(
        "/v1/surveys", params=query, content=samples.ALL[name].encode(), headers=headers
    )


def samples_of(service: Service, survey_id: str):
    return service.client.get(f"/v1/surveys/{survey_id}/samples").json()


@pytest.mark.parametrize("other", ["geosubmit", "tidy"])
def test_exchanged_coordinates_are_named_by_line(service: Service, other: str):
    """Far from all that is known, and amidst it the other way round: nothing of it is stored."""
    assert post(service, "opencellid").status_code == 202
    if other == "tidy":
        names, *rows = samples.TIDY.replace("time_s,lon,lat", "timestamp_s,lat,lon").splitlines()
        text, kind = "\n".join([names, *rows]), "text/csv"
    else:
        text, kind = samples.GEOSUBMIT, "application/json"
        text = text.replace("latitude", "?").replace("longitude", "latitude")
        text = text.replace("?", "longitude").replace('"mobileCountryCode": 262', '"x": 1')
    headers = {"Content-Type": kind}
    answer = service.client.post("/v1/surveys", content=text.encode(), headers=headers)
    pointer = "/lines/2" if other == "tidy" else "/lines/1"
    assert_problem(answer, 422, "swapped-places", {pointer})
    assert len(service.client.get("/v1/surveys").json()["surveys"]) == 1


def test_every_format_can_be_asked_for():
    """The query's words are those of the console."""
    assert set(get_args(FileFormat)) == set(FORMATS)


@pytest.mark.parametrize("name", TYPES)
def test_a_tools_file_is_taken_by_its_content(service: Service, name: str):
    """One drive is answered with the fixed fields, whatever the tool."""
    answer = post(service, name, road_id="high-street", device="blue")
    assert answer.status_code == 202, answer.text
    document = answer.json()
    assert set(document) == FIELDS
    assert answer.headers["location"] == f"/v1/builds/{document['build_id']}"
    assert (document["samples"], document["roads"]) == (4, ["high-street"])
    stored = samples_of(service, document["survey_id"])
    assert stored["device"] == "blue"
    assert stored["recorded_at"] == "2025-05-08T10:00:00Z"
    assert_problem(
        post(service, name, road_id="high-street", device="blue"), 409, "duplicate-survey"
    )


def test_a_file_of_several_drives_is_answered_with_each(service: Service):
    """The sum in the fixed fields, one entry a drive beside them; the same key answers again."""
    rows = [samples.opencellid_row(i, measured_at=1000 * (1_746_698_400 + i + 4000 * (i // 3)))
            for i in range(9)]  # fmt: skip
    body = samples.OPENCELLID_NAMES + "\n" + "".join(rows) + rows[0]
    headers = {"Content-Type": "text/csv", "Idempotency-Key": "log-1"}
    answer = service.client.post("/v1/surveys?road_id=a", content=body, headers=headers)
    assert answer.status_code == 202, answer.text
    document = answer.json()
    assert [each["samples"] for each in document["surveys"]] == [3, 3, 3]
    assert document["samples"] == 9
    assert document["survey_id"] == document["surveys"][0]["survey_id"]
    assert document["dropped"] == {"repeated reading": 1}
    again = service.client.post("/v1/surveys?road_id=a", content=body, headers=headers)
    assert again.status_code == 202
    assert again.headers["idempotency-replayed"] == "true"
    assert [each["survey_id"] for each in again.json()["surveys"]] == [
        each["survey_id"] for each in document["surveys"]
    ]
    assert len(service.client.get("/v1/surveys").json()["surveys"]) == 3


def test_a_file_that_is_known_in_part_adds_what_is_new(service: Service):
    """A log that was posted before and has grown since."""
    rows = [samples.opencellid_row(i, measured_at=1000 * (1_746_698_400 + i + 4000 * (i // 3)))
            for i in range(6)]  # fmt: skip
    head = samples.OPENCELLID_NAMES + "\n"
    headers = {"Content-Type": "text/csv"}
    first = service.client.post("/v1/surveys", content=head + "".join(rows[:3]), headers=headers)
    both = service.client.post("/v1/surveys", content=head + "".join(rows), headers=headers)
    assert both.status_code == 202
    assert both.json()["surveys"][0]["survey_id"] == first.json()["survey_id"]
    assert len(service.client.get("/v1/surveys").json()["surveys"]) == 2


def test_a_broken_file_points_at_its_line_and_stores_nothing(service: Service):
    """Unless its sound part is asked for."""
    body = samples.OPENCELLID + samples.opencellid_row(9, signal="loud")
    headers = {"Content-Type": "text/csv"}
    answer = service.client.post("/v1/surveys", content=body, headers=headers)
    assert_problem(answer, 422, "broken-file", {"/lines/6"})
    assert service.client.get("/v1/surveys").json()["surveys"] == []
    answer = service.client.post("/v1/surveys?keep_going=true", content=body, headers=headers)
    assert answer.json()["dropped"] == {"not a number": 1}


@pytest.mark.parametrize(
    ("name", "query", "code"),
    [
        ("opencellid", {"format": "romes"}, "wrong-file"),
        ("opencellid", {"format": "nemo"}, "invalid-input"),
        ("gnettrack", {"time_zone": "Mars/Base"}, "invalid-input"),
        ("gnettrack", {"radio": "lte"}, "invalid-input"),
        ("gnettrack", {"recorded_at": "2025-05-08T10:00:00Z"}, "invalid-input"),
        ("gnettrack", {"reference_cell": "1:1"}, "invalid-input"),
    ],
)
def test_a_query_that_contradicts_its_file_is_refused(service: Service, name, query, code):
    """And nothing is stored."""
    assert_problem(post(service, name, **query), 422, code)
    assert service.client.get("/v1/surveys").json()["surveys"] == []


def test_json_under_another_name_is_refused(service: Service):
    """415: a media type is a promise."""
    assert_problem(post(service, "geosubmit", "text/plain"), 415, "unsupported-media-type")


def submit(service: Service, body: object, **headers: str):
    raw = gzip.compress(json.dumps(body).encode())
    told = {"Content-Type": "application/json", "Content-Encoding": "gzip", **headers}
    return service.client.post("/v2/geosubmit?key=anything", content=raw, headers=told)


def test_android_apps_upload_straight_in(service: Service):
    """Ichnaea's own answer, the drive stored with its device and built; again changes nothing."""
    body = json.loads(samples.GEOSUBMIT)
    for _ in range(2):
        answer = submit(service, body, **{"User-Agent": "NeoStumbler/2.0"})
        assert (answer.status_code, answer.json()) == (200, {})
    (survey,) = service.client.get("/v1/surveys").json()["surveys"]
    assert (survey["samples"], survey["device"]) == (4, "NeoStumbler/2.0")
    assert survey["build_id"]
    stored = samples_of(service, survey["id"])
    assert stored["cells"] == ["2850:325"]
    assert stored["global_ids"] == {"2850:325": "262-01-5387"}


@pytest.mark.parametrize(
    "items",
    [
        [],
        [{"wifiAccessPoints": [{"macAddress": "01:23:45:67:89:ab"}]}],
        [samples.report(0)],
        [samples.report(i, samples.tower(radioType="gsm")) for i in range(3)],
    ],
)
def test_reports_that_make_no_drive_are_taken_and_left_out(service: Service, items):
    """A client that gets 200 does not send them again and again."""
    assert submit(service, {"items": items}).status_code == 200
    assert service.client.get("/v1/surveys").json()["surveys"] == []


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({}, "/items"),
        ([], "/items"),
        ({"items": [samples.report(0), 3]}, "/items/1"),
        ({"items": [{"cellTowers": 3}]}, "/items/0"),
        ({"items": [{"position": 3}]}, "/items/0"),
    ],
)
def test_malformed_reports_are_refused_at_their_place(service: Service, body, pointer):
    """A problem document with a JSON pointer."""
    assert_problem(submit(service, body), 422, "wrong-file", {pointer})


def test_bodies_that_are_no_json_are_refused(service: Service):
    """By what they claim, and by what they are."""
    client = service.client
    answer = client.post("/v2/geosubmit", content="x", headers={"Content-Type": "text/plain"})
    assert_problem(answer, 415, "unsupported-media-type")
    answer = client.post("/v2/geosubmit", content="x", headers={"Content-Type": "application/json"})
    assert_problem(answer, 422, "wrong-file")
