"""Windows in, fixes out."""

from __future__ import annotations

import json
import re
from typing import Any

import httpx
import numpy as np
import pytest

from app.api.schemas.locate import FixDocument
from tests.api.conftest import Service, assert_problem, window_json
from tests.factories import line_at, trace_along


def located(service: Service, **changed: Any) -> dict[str, Any]:
    answer = service.client.post("/v1/locate", json=window_json(**changed))
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_fix_has_the_documented_shape(shared: Service):
    """Every member is there, of its kind; the map and the time taken are named."""
    answer = shared.client.post("/v1/locate", json=window_json(max_candidates=3))
    fix = FixDocument.model_validate_json(answer.content, strict=False, extra="forbid")
    assert fix.map_version == shared.client.get("/v1/maps/active").json()["version"]
    assert fix.samples_used > 0
    assert fix.confidence == 0.68
    assert len(fix.candidates) <= 3
    assert re.fullmatch(r"match;dur=\d+\.\d{3}", answer.headers["server-timing"])


@pytest.mark.parametrize("limit", [{}, {"max_candidates": None}, {"max_candidates": 10_000}])
def test_all_posteriors_sum_to_one(shared: Service, limit: dict[str, Any]):
    """Asked for without limit, candidates and the off-map probability are all there is."""
    for seed in range(5):
        fix = located(shared, seed=seed, **limit)
        total = sum(candidate["posterior"] for candidate in fix["candidates"])
        assert total + fix["off_map_posterior"] == pytest.approx(1.0, abs=1e-9)


def test_a_limit_keeps_the_best_candidates(shared: Service):
    """`max_candidates` cuts the list and changes nothing else."""
    every = located(shared)
    for limit in (0, 1, 2):
        assert located(shared, max_candidates=limit) == {
            **every,
            "candidates": every["candidates"][:limit],
        }


def test_the_way_may_be_told_by_time_and_speed(shared: Service):
    """Speed and time are distance; one speed or one a sample, any origin of either."""
    by_distance = located(shared, distance_m=[5.0 * step for step in range(12)])
    for way in (
        {"distance_m": [1e6 + 5.0 * step for step in range(12)]},
        {"time_s": [float(step) for step in range(12)], "speed_mps": 5.0},
        {"time_s": [100 + float(step) for step in range(12)], "speed_mps": [5.0] * 12},
    ):
        fix = located(shared, **({"distance_m": None} | way))
        assert fix["candidates"] == by_distance["candidates"]


def test_the_order_of_the_cells_moves_nothing(shared: Service):
    """Cells are named, not numbered."""
    window = window_json()
    order = [2, 0, 1]
    shuffled = {
        **window,
        "cells": [window["cells"][place] for place in order],
        "rsrp_dbm": [[row[place] for place in order] for row in window["rsrp_dbm"]],
    }
    first, second = located(shared, **window), located(shared, **shuffled)
    for one, other in zip(first["candidates"], second["candidates"], strict=True):
        assert other["posterior"] == pytest.approx(one["posterior"], rel=1e-6)
        assert (other["road_id"], other["segment_index"]) == (one["road_id"], one["segment_index"])


def test_unknown_cells_are_named_and_ignored(shared: Service):
    """A cell that the map lacks moves nothing and is told back."""
    window = window_json()
    more = {
        **window,
        "cells": [*window["cells"], "999:1"],
        "rsrp_dbm": [[*row, -80.0] for row in window["rsrp_dbm"]],
    }
    plain, fix = located(shared, **window), located(shared, **more)
    assert fix["cells_unknown"] == ["999:1"]
    assert {**fix, "cells_unknown": []} == plain


@pytest.mark.parametrize("cells", [["999:1", "999:2"], ["850:293", "850:60"]])
def test_a_window_without_a_known_reading_is_off_the_map(shared: Service, cells: list[str]):
    """Nothing heard, or nothing known heard, is a well-formed window that fits no road."""
    reading = None if cells[0].startswith("850") else -90.0
    fix = located(shared, cells=cells, rsrp_dbm=[[reading, reading]] * 12)
    assert fix["status"] == "off_map"
    assert [fix[name] for name in ("road", "segment", "position", "accuracy_m")] == [None] * 4
    FixDocument.model_validate(fix)


def test_confidence_widens_the_radius(shared: Service):
    """The radius is that of the confidence asked for, which the answer repeats."""
    seed = next(s for s in range(50) if located(shared, seed=s)["status"] == "located")
    radii = []
    for confidence in (0.5, 0.68, 0.95):
        fix = located(shared, seed=seed, confidence=confidence)
        assert fix["confidence"] == confidence
        radii.append(fix["accuracy_m"])
    assert radii == sorted(radii)


def test_how_far_distances_err_may_be_told(shared: Service):
    """Null is the same as nothing; what is told moves the fix, of one window and in a batch."""
    trace = trace_along(line_at(), seed=12)
    heard = [[None if np.isnan(one) else float(one) for one in row] for row in trace.rsrp_dbm[:60]]
    way_m = (8.4 * trace.time_s[:60]).tolist()  # 5 % too far
    drive = window_json(cells=list(trace.cells), rsrp_dbm=heard, distance_m=way_m)
    fixes = {error: located(shared, **drive, distance_error=error) for error in (None, 0.0, 0.1)}
    assert located(shared, **drive) == fixes[None]
    assert len({fix["candidates"][0]["chainage_m"] for fix in fixes.values()}) == len(fixes)
    windows = [{**drive, "distance_error": error} for error in fixes]
    batch = shared.client.post("/v1/locate/batch", json={"windows": windows}).json()
    assert batch["fixes"] == list(fixes.values())


def test_without_a_map_the_service_says_so(service: Service):
    """503 with `Retry-After`, for one window and for many; a malformed one is told that first."""
    for path, body in (("/v1/locate", window_json()), ("/v1/locate/batch", {"windows": []})):
        answer = service.client.post(path, json=body)
        assert_problem(answer, 503, "no-map")
        assert int(answer.headers["retry-after"]) > 0
    assert_problem(service.client.post("/v1/locate", json={}), 422, "invalid-input")


def raw(**changed: Any) -> dict[str, Any]:
    return window_json(4, **changed)


WINDOW_REFUSALS: list[tuple[str, dict[str, Any], set[str], str]] = [
    ("unknown field", raw(speed="x"), {"/speed"}, "unknown field 'speed'"),
    ("no way", raw(distance_m=None), {"/distance_m"}, "the way is missing"),
    ("half a way", raw(distance_m=None, time_s=[0.0, 1, 2, 3]), {"/distance_m"}, "the way is missing"),
    ("two ways", raw(speed_mps=3.0), {"/speed_mps"}, "told by distance_m already"),
    ("short way", raw(distance_m=[0.0, 1.0]), {"/distance_m"}, "2 values for 4 samples"),
    ("falling way", raw(distance_m=[0.0, 5.0, 4.5, 6.0]), {"/distance_m/2"}, "4.5 m after 5 m"),
    ("endless way", raw(distance_m=[0.0, 5.0, 6.0, 1e6]), {"/distance_m"}, "1000000 m long"),
    ("overflowing way", raw(distance_m=[-1e308, 0.0, 1.0, 1e308]), {"/distance_m"}, "inf m long"),
    ("falling time", raw(distance_m=None, time_s=[0.0, 2, 1, 3], speed_mps=1.0), {"/time_s/2"}, "1 s after 2 s"),
    ("reversing", raw(distance_m=None, time_s=[0.0, 1, 2, 3], speed_mps=-1.0), {"/speed_mps"}, "-1 m/s"),
    ("a flight", raw(distance_m=None, time_s=[0.0, 1, 2, 3], speed_mps=[1.0, 1, 250, 1]), {"/speed_mps/2"}, "250 m/s"),
    ("speed in words", raw(distance_m=None, time_s=[0.0, 1, 2, 3], speed_mps="5"), {"/speed_mps"}, "'5'"),
    ("empty", raw(cells=[], rsrp_dbm=[], distance_m=[]), {"/cells", "/rsrp_dbm"}, "no sample"),
    ("no cell", raw(cells=[], rsrp_dbm=[[]] * 4), {"/cells"}, "no cell"),
    ("ragged", raw(rsrp_dbm=[[-90.0] * 3, [-90.0] * 2, [-90.0] * 3, []]), {"/rsrp_dbm/1", "/rsrp_dbm/3"}, "2 values"),
    ("cell twice", raw(cells=["a", "b", "a"]), {"/cells/2"}, "stands at /cells/0"),
    ("too weak", raw(rsrp_dbm=[[-90.0, -156.5, None]] * 4), {f"/rsrp_dbm/{i}/1" for i in range(4)}, "-156.5 dBm"),
    ("filler", raw(rsrp_dbm=[[-90.0, 127, -90.0]] + [[-90.0] * 3] * 3), {"/rsrp_dbm/0/1"}, "filler"),
    ("certainty", raw(confidence=1.0), {"/confidence"}, "1.0"),
    ("no confidence", raw(confidence=0), {"/confidence"}, "0"),
    ("percent", raw(distance_error=3.0), {"/distance_error"}, "0.1"),
    ("better than exact", raw(distance_error=-0.01), {"/distance_error"}, "0"),
    ("negative limit", raw(max_candidates=-1), {"/max_candidates"}, "-1"),
    ("half a candidate", raw(max_candidates=1.5), {"/max_candidates"}, "1.5"),
    ("too many samples", window_json(101), {"/rsrp_dbm"}, "101 samples; 100 are the most"),
    ("too many cells", raw(cells=[str(c) for c in range(21)], rsrp_dbm=[[-90.0] * 21] * 4), {"/cells"}, "20 are the most"),
    ("nan", raw(rsrp_dbm=[[float("nan")] * 3] * 4), {"/rsrp_dbm/0/0"}, "finite"),
    ("infinite way", raw(distance_m=[0.0, 1.0, 2.0, float("inf")]), {"/distance_m/3"}, "finite"),
]  # fmt: skip
# ruff: noqa: E501 - a case a line reads as a table


def post_lenient(service: Service, path: str, body: object) -> httpx.Response:
    """With NaN and Infinity, which httpx's encoder would refuse."""
    headers = {"Content-Type": "application/json"}
    return service.client.post(path, content=json.dumps(body), headers=headers)


@pytest.mark.parametrize(
    ("window", "pointers", "words"),
    [case[1:] for case in WINDOW_REFUSALS],
    ids=[case[0].replace(" ", "-") for case in WINDOW_REFUSALS],
)
def test_a_bad_window_is_refused_at_its_fault(
    shared: Service, window: dict[str, Any], pointers: set[str], words: str
):
    """Alone it is a 422; in a batch it has that problem in its place and spoils no other."""
    alone = assert_problem(
        post_lenient(shared, "/v1/locate", window), 422, "invalid-input", pointers
    )
    assert words in alone["detail"] + " ".join(fault["detail"] for fault in alone["errors"])
    good = window_json()
    answer = post_lenient(shared, "/v1/locate/batch", {"windows": [good, window, good]})
    assert answer.status_code == 200
    first, bad, last = answer.json()["fixes"]
    assert first == last == located(shared)
    assert (bad["status"], bad["code"]) == (422, "invalid-input")
    assert {fault["pointer"] for fault in bad["errors"]} == {f"/windows/1{p}" for p in pointers}


def test_a_batch_answers_as_its_windows_do(shared: Service):
    """One fix a window, in order, each the same as alone."""
    windows = [window_json(seed=seed, max_candidates=seed) for seed in range(6)]
    answer = shared.client.post("/v1/locate/batch", json={"windows": windows})
    alone = [shared.client.post("/v1/locate", json=window).json() for window in windows]
    assert answer.json() == {"fixes": alone}


@pytest.mark.parametrize(
    ("body", "pointers"),
    [
        ({}, {"/windows"}),
        ({"windows": 3}, {"/windows"}),
        ({"windows": [], "more": 1}, {"/more"}),
        ({"windows": [{}] * 11}, {"/windows"}),
        ([], {""}),
        ("x", {""}),
    ],
)
def test_a_batch_that_is_none_is_refused(shared: Service, body: object, pointers: set[str]):
    """Only a whole batch that cannot be read is refused as a whole."""
    answer = shared.client.post("/v1/locate/batch", json=body)
    assert_problem(answer, 422, "invalid-input", pointers)


def test_a_batch_of_rubbish_has_a_problem_for_each(shared: Service):
    """Whatever stands in a window's place gets an entry."""
    windows = [None, 3, "x", [], {}, window_json()]
    fixes = shared.client.post("/v1/locate/batch", json={"windows": windows}).json()["fixes"]
    assert [fix.get("code") for fix in fixes] == ["invalid-input"] * 5 + [None]
    assert fixes[0]["errors"][0]["pointer"] == "/windows/0"


def test_an_answer_is_reproducible(shared: Service):
    """The same window on the same map has the same answer, to the last bit."""
    rng = np.random.default_rng(3)
    window = window_json(rsrp_dbm=rng.uniform(-120, -60, (12, 3)).tolist())
    assert located(shared, **window) == located(shared, **window)
