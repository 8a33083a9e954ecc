"""A bad survey is refused with every fault named, and leaves nothing behind."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

import pytest

from tests.api.conftest import Service, assert_problem

GOOD: dict[str, Any] = {
    "road_id": "street-07",
    "device": "pixel4a",
    "recorded_at": "2021-05-08T10:12:00Z",
    "cells": ["850:293", "850:60"],
    "time_s": [0.0, 1.0, 2.0],
    "lon": [-118.4919, -118.4918, -118.4917],
    "lat": [34.0136, 34.0137, 34.0138],
    "rsrp_dbm": [[-110.6, -106.9], [-109.7, None], [-110.1, -106.2]],
}
Change = Callable[[dict[str, Any]], object]


def put(name: str, value: Any) -> Change:
    return lambda survey: survey.__setitem__(name, value)


def drop(name: str) -> Change:
    return lambda survey: survey.pop(name)


def reading(row: int, column: int, value: Any) -> Change:
    return lambda survey: survey["rsrp_dbm"][row].__setitem__(column, value)


def item(name: str, place: int, value: Any) -> Change:
    return lambda survey: survey[name].__setitem__(place, value)


# What is done to a good survey, where the fault must point, and words that must be in it.
# ruff: noqa: E501 - a case a line reads as a table
REFUSALS: list[tuple[str, list[Change], set[str], str]] = [
    ("unknown field", [put("speed", 3)], {"/speed"}, "unknown field 'speed'"),
    ("pointer escapes", [put("a/b~c", 3)], {"/a~1b~0c"}, "unknown field 'a/b~c'"),
    ("missing field", [drop("lat")], {"/lat"}, "'lat' is missing"),
    ("not a list", [put("lat", 34.0)], {"/lat"}, "34.0"),
    ("text for a number", [item("lat", 1, "34")], {"/lat/1"}, "'34'"),
    ("true for a number", [item("lat", 1, True)], {"/lat/1"}, "True"),
    ("null for a number", [item("lat", 1, None)], {"/lat/1"}, "None"),
    ("text for a reading", [reading(1, 0, "-100")], {"/rsrp_dbm/1/0"}, "'-100'"),
    ("nan reading", [reading(1, 0, float("nan"))], {"/rsrp_dbm/1/0"}, "finite"),
    ("infinite reading", [reading(2, 1, float("-inf"))], {"/rsrp_dbm/2/1"}, "finite"),
    ("nan time", [item("time_s", 1, float("nan"))], {"/time_s/1"}, "finite"),
    ("infinite position", [item("lon", 1, float("inf"))], {"/lon/1"}, "finite"),
    ("ragged row", [put("rsrp_dbm", [[-100, -99], [-100], [-100, -99]])], {"/rsrp_dbm/1"}, "1 values"),
    ("row of rows", [put("rsrp_dbm", [-100, -99, -98])], {"/rsrp_dbm/0"}, "array, got -100"),
    ("short column", [put("lat", [34.0136, 34.0137])], {"/lat"}, "2 values for 3 samples"),
    ("long matrix", [lambda s: s["rsrp_dbm"].append([-1e2, None])], {"/rsrp_dbm"}, "4 values"),
    ("too weak", [reading(0, 0, -156.1)], {"/rsrp_dbm/0/0"}, "-156.1 dBm"),
    ("too strong", [reading(0, 0, -30.9)], {"/rsrp_dbm/0/0"}, "-30.9 dBm"),
    ("filler of scanners", [reading(0, 0, -30.0)], {"/rsrp_dbm/0/0"}, "filler"),
    ("filler 127", [reading(0, 1, 127)], {"/rsrp_dbm/0/1"}, "filler"),
    ("filler of Android", [reading(2, 0, 2147483647)], {"/rsrp_dbm/2/0"}, "2147483647 dBm"),
    ("weak for LTE", [put("radio", "lte"), reading(1, 0, -140.5)], {"/rsrp_dbm/1/0"}, "-140..-44"),
    ("strong for LTE", [put("radio", "lte"), reading(1, 0, -43.5)], {"/rsrp_dbm/1/0"}, "LTE"),
    ("strong for NR", [put("radio", "nr"), reading(1, 0, -30.5)], {"/rsrp_dbm/1/0"}, "-156..-31"),
    ("unknown radio", [put("radio", "gsm")], {"/radio"}, "'gsm'"),
    ("duplicate cells", [item("cells", 1, "850:293")], {"/cells/1"}, "stands at /cells/0"),
    ("empty cell", [item("cells", 1, "")], {"/cells/1"}, "at least 1 character"),
    ("control character", [item("cells", 1, "850\x00")], {"/cells/1"}, "pattern"),
    ("name of no cell", [put("global_ids", {"1:1": "262-01-5387"})], {"/global_ids/1:1"}, "not in /cells"),
    ("no cells", [put("cells", []), put("rsrp_dbm", [[], [], []])], {"/cells"}, "no cell"),
    ("falling time", [item("time_s", 2, 0.5)], {"/time_s/2"}, "0.5 s after 1 s"),
    ("east of the earth", [item("lon", 2, 180.5)], {"/lon/2"}, "180.5"),
    ("north of the earth", [item("lat", 0, 90.01)], {"/lat/0"}, "90.01"),
    ("jump", [item("lat", 2, 34.2)], {"/lon/2"}, "20.7 km"),
    ("one sample", [lambda s: [s[n].__delitem__(slice(1, 3)) for n in ("time_s", "lon", "lat", "rsrp_dbm")]],
     {"/time_s"}, "1 samples"),
    ("no sample", [lambda s: [s[n].clear() for n in ("time_s", "lon", "lat", "rsrp_dbm")]],
     {"/time_s"}, "0 samples"),
    ("nothing heard", [put("rsrp_dbm", [[None, None]] * 3)], {"/rsrp_dbm"}, "no cell is heard"),
    ("foreign reference", [put("reference_cell", "1:1")], {"/reference_cell"}, "'1:1'"),
    ("no zone", [put("recorded_at", "2021-05-08T10:12:00")], {"/recorded_at"}, "timezone"),
    ("no moment", [put("recorded_at", "yesterday")], {"/recorded_at"}, "'yesterday'"),
    ("clock never set", [put("recorded_at", "1970-01-01T00:00:00Z")], {"/recorded_at"}, "1990"),
    ("overflowing zone", [put("recorded_at", "0001-01-01T00:00:00+14:00")], {"/recorded_at"}, "1990"),
    ("slash in the road", [put("road_id", "a/b")], {"/road_id"}, "'a/b'"),
    ("empty road", [put("road_id", "")], {"/road_id"}, "at least 1 character"),
    ("several at once", [reading(0, 0, -200), item("time_s", 2, 0.5), item("lon", 1, 200)],
     {"/rsrp_dbm/0/0", "/time_s/2", "/lon/1"}, "and 2 more"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "pointers", "words"),
    [case[1:] for case in REFUSALS],
    ids=[case[0].replace(" ", "-") for case in REFUSALS],
)
def test_a_bad_survey_is_refused_at_its_fault(
    shared: Service, changes: list[Change], pointers: set[str], words: str
):
    """Every fault is named with its place and its number, and nothing is stored."""
    survey = copy.deepcopy(GOOD)
    for change in changes:
        change(survey)
    before = shared.client.get("/v1/surveys").json()
    answer = shared.client.post(
        "/v1/surveys", content=json.dumps(survey), headers={"Content-Type": "application/json"}
    )
    document = assert_problem(answer, 422, "invalid-input", pointers)
    said = document["detail"] + " ".join(fault["detail"] for fault in document["errors"])
    assert words in said
    assert shared.client.get("/v1/surveys").json() == before


@pytest.mark.parametrize(
    "body", [b"", b"{", b"[]", b"3", b"null", b'{"cells": [1,]}', b"\xff\xfe{}"]
)
def test_what_is_no_object_is_refused(shared: Service, body: bytes):
    """A body that is no JSON object is malformed, and says how."""
    answer = shared.client.post(
        "/v1/surveys", content=body, headers={"Content-Type": "application/json"}
    )
    assert_problem(answer, 422, "invalid-input", {""})


def test_only_the_first_faults_are_spelled_out(shared: Service):
    """A matrix wrong everywhere answers with a handful of faults and their number."""
    survey = {**GOOD, "rsrp_dbm": [[-200.0 - column for column in range(30)]] * 3}
    survey["cells"] = [str(column) for column in range(30)]
    document = assert_problem(shared.client.post("/v1/surveys", json=survey), 422, "invalid-input")
    assert len(document["errors"]) == 21
    assert document["errors"][-1] == {"pointer": "", "detail": "and 70 more faults"}


def test_a_range_of_the_radio_includes_its_edges(shared: Service):
    """Both edges of both radios' ranges are readings."""
    for radio, edges in {"lte": [-140.0, -44.0], "nr": [-156.0, -31.0]}.items():
        survey = {**GOOD, "radio": radio, "rsrp_dbm": [edges] * 3, "road_id": f"edge-{radio}"}
        answer = shared.client.post("/v1/surveys?build=false", json=survey)
        assert answer.status_code == 202, answer.text


CSV_HEAD = "time_s,lon,lat,cell_id,rsrp_dbm\n"
CSV_REFUSALS = [
    ("no header", "", "/lines/1/time_s", "missing"),
    ("missing column", "time_s,lon,lat,cell_id\n0,1,2,a\n", "/lines/1/rsrp_dbm", "missing"),
    ("unknown column", "time_s,lon,lat,cell_id,rsrp_dbm,pass_id\n", "/lines/1/pass_id", "unknown"),
    ("column twice", "time_s,lon,lat,lat,cell_id,rsrp_dbm\n", "/lines/1/lat", "twice"),
    ("short row", CSV_HEAD + "0,1,2,a,-100\n1,1,2,a\n", "/lines/3", "4 values"),
    ("no number", CSV_HEAD + "0,1,2,a,-100\n1,x,2,a,-99\n", "/lines/3/lon", "'x'"),
    ("nan", CSV_HEAD + "0,1,2,a,-100\n1,1,2,a,nan\n", "/lines/3/rsrp_dbm", "'nan'"),
    ("out of range", CSV_HEAD + "0,1,2,a,-100\n1,1,2,a,-99\n1,1,2,b,-200\n", "/lines/4/rsrp_dbm", "-200"),
    ("cell twice", CSV_HEAD + "0,1,2,a,-100\n0,1,2,a,-99\n", "/lines/3/cell_id", "line 2"),
    ("falling time", CSV_HEAD + "1,1,2,a,-100\n1,1,2,b,-99\n0,1,2,a,-99\n", "/lines/4/time_s", "0 s after"),
    ("empty cell", CSV_HEAD + "0,1,2,a,-100\n1,1,2,,-99\n", "/lines/3/cell_id", "at least 1"),
    ("one sample", CSV_HEAD + "0,1,2,a,-100\n", "/time_s", "1 samples"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "pointer", "words"),
    [case[1:] for case in CSV_REFUSALS],
    ids=[case[0].replace(" ", "-") for case in CSV_REFUSALS],
)
def test_a_bad_csv_is_refused_at_its_line(shared: Service, text: str, pointer: str, words: str):
    """A fault in a CSV body names its line and column."""
    answer = shared.client.post("/v1/surveys", content=text, headers={"Content-Type": "text/csv"})
    document = assert_problem(answer, 422, "invalid-input")
    fault = next(fault for fault in document["errors"] if fault["pointer"] == pointer)
    assert words in fault["detail"]


def test_csv_that_is_no_text_is_refused(shared: Service):
    """Bytes that are no UTF-8 are named by their place."""
    answer = shared.client.post(
        "/v1/surveys", content=b"time_s\xff", headers={"Content-Type": "text/csv"}
    )
    assert "byte 6" in assert_problem(answer, 422, "invalid-input", {""})["detail"]
