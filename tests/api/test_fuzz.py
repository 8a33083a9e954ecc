"""Whatever is posted, the service answers and never fails."""

from __future__ import annotations

import copy
import json
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.api.conftest import PROBLEM_MEMBERS, Service, window_json
from tests.api.test_survey_refusals import GOOD

FUZZ = settings(
    max_examples=150,
    deadline=None,  # a cold first request proves nothing
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.floats(),  # NaN and infinities too: json.dumps writes them as most clients would
    st.text(max_size=20),
    st.sampled_from([0, -1, 127, 2147483647, -30.0, 1e308, "850:293", "\x00", "\ud7ff", "é" * 300]),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=12,
)
JSON = {"Content-Type": "application/json"}


@st.composite
def damaged(draw: st.DrawFn, good: dict[str, Any]) -> Any:
    """A good document with a few of its parts replaced, removed, repeated or added."""
    document = copy.deepcopy(good)
    for _ in range(draw(st.integers(1, 3))):
        holder: Any = document
        while True:
            if not isinstance(holder, dict | list) or not holder:
                break
            keys = list(holder) if isinstance(holder, dict) else range(len(holder))
            key = draw(st.sampled_from(list(keys)))
            if isinstance(holder[key], dict | list) and holder[key] and draw(st.booleans()):
                holder = holder[key]
                continue
            action = draw(st.sampled_from(["replace", "remove", "repeat", "add"]))
            if action == "replace":
                holder[key] = draw(VALUES)
            elif action == "remove":
                del holder[key]
            elif isinstance(holder, dict):
                holder[draw(st.text(max_size=8))] = draw(VALUES)
            else:
                holder.insert(
                    key, copy.deepcopy(holder[key]) if action == "repeat" else draw(VALUES)
                )
            break
    return document


def post(service: Service, path: str, body: bytes) -> None:
    answer = service.client.post(path, content=body, headers=JSON)
    assert answer.status_code in {200, 202, 400, 404, 409, 413, 422}, (answer.text, body)
    if answer.status_code >= 400:
        assert set(answer.json()) == PROBLEM_MEMBERS
        assert answer.json()["errors"] or answer.status_code != 422


@FUZZ
@given(body=damaged(GOOD) | VALUES)
def test_any_survey_is_answered(shared: Service, body: Any):
    """Accepted, refused or stored already, but never a failure."""
    post(shared, "/v1/surveys?build=false", json.dumps(body).encode())


@FUZZ
@given(
    body=damaged(window_json(5))
    | damaged(window_json(3, distance_m=None, time_s=[0.0, 1.0, 2.0], speed_mps=3.0))
    | VALUES
)
def test_any_window_is_answered(shared: Service, body: Any):
    """Located, off the map or refused, alone and in a batch."""
    post(shared, "/v1/locate", json.dumps(body).encode())
    post(shared, "/v1/locate/batch", json.dumps({"windows": [body, window_json()]}).encode())


@FUZZ
@given(body=st.binary(max_size=60) | VALUES.map(lambda value: json.dumps(value).encode()))
def test_any_bytes_are_answered(shared: Service, body: bytes):
    """Bytes that are no JSON, and JSON that is nothing of ours, on every path with a body."""
    for path in ("/v1/surveys?build=false", "/v1/locate", "/v1/locate/batch", "/v1/builds"):
        post(shared, path, body)


@FUZZ
@given(
    rows=st.lists(
        st.lists(st.text(alphabet='0123456789.,-:ab"\n\r;é\x00 ', max_size=8), max_size=7),
        max_size=6,
    ),
    head=st.sampled_from(
        ["time_s,lon,lat,cell_id,rsrp_dbm", "lat,lon,time_s,rsrp_dbm,cell_id,serving", ""]
    ),
)
def test_any_csv_is_answered(shared: Service, rows: list[list[str]], head: str):
    """Lines of anything under a right or a wrong header."""
    text = "\n".join([head, *(",".join(row) for row in rows)])
    answer = shared.client.post(
        "/v1/surveys?build=false", content=text.encode(), headers={"Content-Type": "text/csv"}
    )
    assert answer.status_code in {202, 409, 422}, (answer.text, text)


@FUZZ
@given(
    path=st.text(max_size=30),
    query=st.dictionaries(
        st.sampled_from(["limit", "cursor", "bbox", "map_version", "road_id"]),
        st.text(max_size=12),
        max_size=3,
    ),
)
def test_any_read_is_answered(shared: Service, path: str, query: dict[str, str]):
    """Ids and parameters of anything: found, not found or refused."""
    for base in ("/v1/surveys", "/v1/builds", "/v1/roads", "/v1/cells"):
        for url in (base, f"{base}/{path}"):
            try:
                answer = shared.client.get(url, params=query)
            except Exception as error:  # noqa: BLE001 - the client refuses some paths itself
                assert type(error).__name__ == "InvalidURL"  # noqa: PT017 - nothing else is meant
                continue
            assert answer.status_code in {200, 404, 405, 422}, (answer.text, url, query)
