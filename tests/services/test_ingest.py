"""A survey is accepted once, whole, with its build, on the road that it drove."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
import sqlalchemy as sa

from app.domain import Road
from app.errors import DuplicateSurvey, IdempotencyMismatch, InvalidInput, NotFound
from app.services import builds, ingest, roads, surveys
from app.store import builds as build_rows
from app.store.columns import utc_now
from app.store.engine import read, write
from tests.factories import line_at, trace_along


def tables_filled(engine):
    with read(engine) as connection:
        return {
            name
            for name in sa.inspect(connection).get_table_names()
            if connection.scalar(sa.text(f"SELECT count(*) FROM {name}"))  # noqa: S608
        } - {"alembic_version"}


def test_a_survey_and_its_build_are_stored_together(engine):
    """What is accepted can be read back, and its build waits for a worker."""
    trace = trace_along(line_at(), seed=1, road_id="r1")
    done = ingest.accept_survey(engine, trace, dropped={"filler": 3})
    assert (done.roads, done.samples, done.replayed) == (("r1",), 101, False)
    summary = surveys.get_survey(engine, done.survey_id)
    assert (summary.build_id, summary.dropped) == (done.build_id, {"filler": 3})
    np.testing.assert_array_equal(
        surveys.survey_trace(engine, done.survey_id).rsrp_dbm, trace.rsrp_dbm
    )
    build = builds.get_build(engine, done.build_id)
    assert (build.status, build.roads_total, build.activate) == ("accepted", 1, True)


def test_storing_only_enqueues_nothing(engine):
    """build=False stores the survey and leaves the map alone."""
    trace = trace_along(line_at(), seed=1, road_id="r1")
    assert ingest.accept_survey(engine, trace, build=False).build_id is None
    assert builds.list_builds(engine).items == ()


def test_the_same_survey_twice_is_refused_and_stores_nothing(engine):
    """A second post of the same content names the first and adds no build."""
    trace = trace_along(line_at(), seed=1, road_id="r1")
    first = ingest.accept_survey(engine, trace)
    with pytest.raises(DuplicateSurvey) as refusal:
        ingest.accept_survey(engine, trace, idempotency_key="another")
    assert refusal.value.survey_id == first.survey_id
    assert len(surveys.list_surveys(engine).items) == 1


def test_an_idempotency_key_gives_the_first_answer_again(engine):
    """The same key and content change nothing, however often; other content is refused."""
    trace = trace_along(line_at(), seed=1, road_id="r1")
    first = ingest.accept_survey(engine, trace, idempotency_key="k", dropped={"filler": 3})
    again = ingest.accept_survey(engine, trace, idempotency_key="k")
    assert again == replace(first, replayed=True)
    with pytest.raises(IdempotencyMismatch):
        ingest.accept_survey(
            engine, trace_along(line_at(), seed=2, road_id="r1"), idempotency_key="k"
        )
    assert len(surveys.list_surveys(engine).items) == 1


def test_a_fault_in_the_middle_stores_nothing(engine, monkeypatch):
    """A crash between the survey and its build leaves neither."""
    monkeypatch.setattr(ingest, "join_build", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        ingest.accept_survey(engine, trace_along(line_at(), seed=1, road_id="r1"))
    assert tables_filled(engine) == set()


def test_surveys_in_a_row_share_a_build(engine):
    """A hundred posts before a worker looks make one build of all their roads."""
    accepted = [
        ingest.accept_survey(engine, trace_along(line_at(), seed=n, road_id=f"r{n % 4}"))
        for n in range(20)
    ]
    assert len({done.build_id for done in accepted}) == 1
    assert builds.get_build(engine, accepted[0].build_id).roads_total == 4


def test_a_build_that_has_begun_takes_nothing_more_in(engine):
    """What is posted during a build goes into the next one."""
    first = ingest.accept_survey(engine, trace_along(line_at(), seed=1, road_id="r1"))
    with write(engine) as connection:
        assert build_rows.begin(connection, first.build_id) == "running"
    second = ingest.accept_survey(engine, trace_along(line_at(), seed=2, road_id="r2"))
    assert second.build_id != first.build_id
    assert builds.get_build(engine, first.build_id).roads_total == 1


def test_a_steady_stream_does_not_starve_the_map(engine):
    """Each post puts the build off a little, but never past its longest wait."""
    done = ingest.accept_survey(engine, trace_along(line_at(), seed=0, road_id="r1"))
    for seed in range(1, 4):
        ingest.accept_survey(engine, trace_along(line_at(), seed=seed, road_id="r1"))
    with read(engine) as connection:
        waiting = build_rows.open_build(connection)
        assert waiting.build_id == done.build_id
        assert waiting.due_at > utc_now()
    with write(engine) as connection:  # as if the stream had run for long
        long_ago = waiting.created_at - timedelta(seconds=60)
        connection.execute(
            build_rows.builds.update().values(
                created_at=long_ago, due_at=utc_now() + timedelta(seconds=0.2)
            )
        )
    ingest.accept_survey(engine, trace_along(line_at(), seed=9, road_id="r1"))
    with read(engine) as connection:
        assert build_rows.due_builds(connection) == [(done.build_id, "accepted")]


def test_a_nameless_drive_joins_the_road_it_follows(engine):
    """Of two parallel streets 60 m apart, a noisy drive goes to its own."""
    for number, y_m in enumerate((0.0, 60.0)):
        roads.put_road(engine, Road(f"street-{number}", None, line_at(y_m)))
    for number, y_m in enumerate((0.0, 60.0)):
        drive = trace_along(line_at(y_m), seed=number, noise_m=4.0)
        assert ingest.accept_survey(engine, drive).roads == (f"street-{number}",)


def test_a_nameless_drive_elsewhere_founds_a_road(engine):
    """A drive that no known road explains gets a road of its own, and the next drive joins it."""
    roads.put_road(engine, Road("street-0", None, line_at(0.0)))
    (founded,) = ingest.accept_survey(engine, trace_along(line_at(300.0), seed=1)).roads
    assert founded != "street-0"
    backwards = line_at(300.0)
    backwards = replace(backwards, lon=backwards.lon[::-1])
    again = ingest.accept_survey(engine, trace_along(backwards, seed=2, noise_m=3.0))
    assert again.roads == (founded,)


def test_a_drive_that_turns_off_belongs_to_no_known_road(engine):
    """With under 70 % of its samples beside it, a drive does not join the road."""
    roads.put_road(engine, Road("short", None, line_at(0.0, length_m=200.0)))
    long_drive = trace_along(line_at(0.0, length_m=400.0), seed=1)
    (founded,) = ingest.accept_survey(engine, long_drive).roads
    assert founded != "short"


def test_a_deleted_survey_is_gone_and_its_road_is_built_again(engine):
    """Deleting stores a build of the touched road; the survey can then be posted anew."""
    trace = trace_along(line_at(), seed=1, road_id="r1")
    done = ingest.accept_survey(engine, trace, build=False)
    build_id = surveys.delete_survey(engine, done.survey_id)
    assert builds.get_build(engine, build_id).roads_total == 1
    with pytest.raises(NotFound):
        surveys.get_survey(engine, done.survey_id)
    with pytest.raises(NotFound):
        surveys.survey_trace(engine, done.survey_id)
    with pytest.raises(NotFound):
        surveys.delete_survey(engine, done.survey_id)
    assert ingest.accept_survey(engine, trace).survey_id != done.survey_id


def test_surveys_are_paged_in_the_order_of_arrival(engine):
    """Following the cursors visits every survey once; a road's list holds its own only."""
    posted = [
        ingest.accept_survey(
            engine, trace_along(line_at(), seed=n, road_id=f"r{n % 2}"), build=False
        ).survey_id
        for n in range(7)
    ]
    seen, cursor = [], None
    while True:
        page = surveys.list_surveys(engine, limit=3, cursor=cursor)
        seen += [survey.survey_id for survey in page.items]
        cursor = page.next_cursor
        if cursor is None:
            break
    assert seen == posted
    of_road = surveys.list_surveys(engine, road_id="r1").items
    assert [survey.survey_id for survey in of_road] == posted[1::2]


@pytest.mark.parametrize("wrong", [{"limit": 0}, {"limit": 1001}, {"cursor": "%%"}])
def test_a_wrong_page_is_refused(engine, wrong):
    """Limits outside their range and cursors that are none of ours are malformed input."""
    with pytest.raises(InvalidInput):
        surveys.list_surveys(engine, **wrong)


def test_surveys_of_an_unknown_road_are_not_found(engine):
    """An empty list would hide a mistyped id."""
    with pytest.raises(NotFound):
        surveys.list_surveys(engine, road_id="nowhere")
