"""A vehicle tracked over HTTP: the state goes with the client, and only ours is taken back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from app.api.schemas.locate import FixDocument
from tests.api.conftest import Service, assert_problem, serving, survey_json, window_json
from tests.factories import line_at, trace_along

GROWING = [2.5 * step for step in range(12)]


def post(service: Service, **changed: Any) -> dict[str, Any]:
    answer = service.client.post("/v1/locate", json=window_json(**changed))
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_without_a_state_nothing_changes(shared: Service):
    """No member of the answer is new, and none differs from a track's first."""
    alone = post(shared)
    assert "state" not in alone
    first = post(shared, state=None)
    state = first.pop("state")
    assert first == alone
    assert re.fullmatch(r"[A-Za-z0-9_-]{40,}", state)


@pytest.mark.parametrize("begin", [None, ""])
def test_a_track_goes_from_answer_to_request(shared: Service, begin: str | None):
    """Null or empty begins; each answer's state goes on; every answer is an ordinary fix."""
    state = begin
    for step in range(4):
        way_m = [25.0 * step + each for each in GROWING]
        fix = post(shared, state=state, distance_m=way_m, seed=step)
        FixDocument.model_validate_json(
            shared.client.post(
                "/v1/locate", json=window_json(state=state, distance_m=way_m, seed=step)
            ).content,
            strict=False,
            extra="forbid",
        )
        total = sum(one["posterior"] for one in fix["candidates"]) + fix["off_map_posterior"]
        assert total == pytest.approx(1.0, abs=1e-9)
        state = fix["state"]


def test_the_same_state_twice_has_the_same_answer(shared: Service):
    """Nothing is kept on the server: a replayed request is answered as before."""
    state = post(shared, state=None)["state"]
    once = post(shared, state=state, travelled_m=30.0, seed=2)
    post(shared, state=once["state"], travelled_m=30.0, seed=3)
    assert post(shared, state=state, travelled_m=30.0, seed=2) == once


def test_the_way_may_be_told_by_time_and_speed(shared: Service):
    """A running clock is a running odometer."""
    told = {"distance_m": None, "speed_mps": 5.0}
    clock = [0.5 * step for step in range(12)]
    by_clock = post(shared, state=None, time_s=clock, **told)
    by_way = post(shared, state=None, distance_m=GROWING)
    later = [3.0 + each for each in clock]
    second = post(shared, state=by_clock["state"], time_s=later, seed=2, **told)
    same = post(shared, state=by_way["state"], distance_m=[15.0 + m for m in GROWING], seed=2)
    for one, other in zip(second["candidates"], same["candidates"], strict=True):
        assert one["posterior"] == pytest.approx(other["posterior"], rel=1e-6)


REFUSALS: list[tuple[str, dict[str, Any], str, str]] = [
    ("rubbish", {"state": "x"}, "/state", "no state"),
    ("no text", {"state": 7}, "/state", "7"),
    ("too long", {"state": "A" * 70_000}, "/state", "65536 are the most"),
    ("foreign", {"state": "A" * 120}, "/state", "did not make"),
    ("a way without state", {"travelled_m": 3.0}, "/travelled_m", "no state"),
    ("backwards", {"state": None, "travelled_m": -1.0}, "/travelled_m", "-1"),
    ("a way in words", {"state": None, "travelled_m": "3"}, "/travelled_m", "'3'"),
]


@pytest.mark.parametrize(
    ("changed", "pointer", "words"),
    [case[1:] for case in REFUSALS],
    ids=[case[0].replace(" ", "-") for case in REFUSALS],
)
def test_a_bad_state_is_refused_at_its_place(
    shared: Service, changed: dict[str, Any], pointer: str, words: str
):
    """Alone it is a 422; in a batch it has that problem in its place and spoils no other."""
    window = window_json(**changed)
    problem = assert_problem(
        shared.client.post("/v1/locate", json=window), 422, "invalid-input", {pointer}
    )
    assert words in problem["errors"][0]["detail"]
    good = window_json(state=None)
    fixes = shared.client.post("/v1/locate/batch", json={"windows": [good, window, good]}).json()
    first, bad, last = fixes["fixes"]
    assert first == last
    assert first["state"]
    assert [fault["pointer"] for fault in bad["errors"]] == [f"/windows/1{pointer}"]


def test_a_changed_state_is_refused(shared: Service):
    """One letter changed in the middle, at either end, or cut off."""
    state = post(shared, state=None)["state"]
    middle = len(state) // 2
    other = "A" if state[middle] != "A" else "B"
    for changed in (state[:middle] + other + state[middle + 1 :], state[:-4], state[4:]):
        answer = shared.client.post("/v1/locate", json=window_json(state=changed))
        assert_problem(answer, 422, "invalid-input", {"/state"})


def test_each_window_of_a_batch_has_its_own_state(shared: Service):
    """Two vehicles and a stranger in one batch are answered as alone."""
    first = post(shared, state=None, seed=1)["state"]
    second = post(shared, state=None, seed=2)["state"]
    windows = [
        window_json(state=first, travelled_m=20.0, seed=3),
        window_json(seed=3),
        window_json(state=second, travelled_m=20.0, seed=3),
    ]
    fixes = shared.client.post("/v1/locate/batch", json={"windows": windows}).json()["fixes"]
    alone = [shared.client.post("/v1/locate", json=window).json() for window in windows]
    assert fixes == alone
    assert "state" not in fixes[1]


def test_a_state_survives_a_restart_and_no_other_service_takes_it(tmp_path: Path):
    """The key lies in the store; another store has another one; a told one is shared."""
    states = {}
    for name, told in (("one", None), ("other", None), ("told", "secret"), ("too", "secret")):
        (tmp_path / name).mkdir()
        with serving(tmp_path / name, state_key=told) as running:
            prepared(running)
            states[name] = post(running, state=None)["state"]
    with serving(tmp_path / "one") as again:
        again.wait_for_map(1)
        assert post(again, state=states["one"])["state"]
        answer = again.client.post("/v1/locate", json=window_json(state=states["other"]))
        assert_problem(answer, 422, "invalid-input", {"/state"})
    with serving(tmp_path / "too", state_key="secret") as again:
        again.wait_for_map(1)
        assert post(again, state=states["told"])["state"]


def prepared(service: Service) -> None:
    """One road, surveyed and built."""
    trace = trace_along(line_at(), seed=0, road_id="north")
    posted = service.client.post("/v1/surveys?build=false", json=survey_json(trace))
    assert posted.status_code == 202, posted.text
    service.wait_for_map(service.build())


def test_a_state_goes_on_on_the_next_map(service: Service):
    """A map version that has its roads takes it; one that has none of them says so."""
    prepared(service)
    state = post(service, state=None)["state"]
    service.wait_for_map(service.build("north"))
    assert post(service, state=state)["map_version"] == 2
