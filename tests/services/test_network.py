"""Drives that name no road: they wait, a build finds their roads once, and nothing is left over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Line, Road, Trace
from app.numerics.lines import length_m
from app.numerics.network.finding import find_roads
from app.services import builds, ingest, network, roads, roadwork, surveys
from app.store import drives
from app.store.engine import read
from tests.factories import FRAME, line_at, trace_along
from tests.services.building import mapped, run


def turning(seed: int, *corners: tuple[float, float], **fields) -> Trace:
    """A drive through corners, local metres, with levels that mean nothing."""
    at = FRAME.to_lonlat(*np.array(corners, dtype=float).T)
    line = Line(np.asarray(at.lon), np.asarray(at.lat))
    return replace(trace_along(line, seed=seed, noise_m=2.0, step_m=8.0), **fields)


BENT = ((0.0, 0.0), (500.0, 0.0), (500.0, 400.0))
ACROSS = ((500.0, -400.0), (500.0, 800.0))
ALONG = ((-300.0, 0.0), (1000.0, 0.0))


def post(engine, *traces, **options):
    return [ingest.accept_survey(engine, trace, **options) for trace in traces]


def shown(engine) -> dict[str, int]:
    """Roads that people see, with their surveys."""
    return {road.road_id: road.survey_count for road in roads.list_roads(engine).items}


def test_a_drive_that_turns_waits_for_its_roads(engine):
    """The answer to the post names no road; after the build the survey does."""
    (done,) = post(engine, turning(1, *BENT))
    assert done.roads == ()
    assert surveys.survey_trace(engine, done.survey_id).road_id is None
    build = run(engine, done.build_id)
    assert (build.status, build.roads_total) == ("successful", 1)
    (road_id,) = surveys.get_survey(engine, done.survey_id).roads
    assert shown(engine) == {road_id: 1}
    assert length_m(roads.get_road(engine, road_id).line) == pytest.approx(900.0, rel=0.04)


def test_a_grid_of_drives_becomes_streets_with_their_passes(engine):
    """Three drives over two streets: each drive runs along the streets that it drove."""
    bent, across, along = post(
        engine, *(turning(n, *w) for n, w in enumerate((BENT, ACROSS, ALONG)))
    )
    build = run(engine, along.build_id)
    assert (build.status, build.roads_done) == ("successful", 2)
    street, avenue = (surveys.get_survey(engine, d.survey_id).roads[0] for d in (along, across))
    assert street != avenue
    assert surveys.get_survey(engine, bent.survey_id).roads == (street, avenue)
    assert shown(engine) == {street: 2, avenue: 2}


def test_a_later_build_touches_only_what_a_drive_touches(engine):
    """A new drive along one street builds that street; ids stay."""
    post(engine, *(turning(n, *w) for n, w in enumerate((BENT, ACROSS, ALONG))))
    far = turning(9, (5000.0, 0.0), (5600.0, 0.0), (5600.0, 500.0))
    (done,) = post(engine, far)
    run(engine, done.build_id)
    before = set(shown(engine))
    (again,) = post(engine, replace(turning(10, *ACROSS), device="another"))
    build = run(engine, again.build_id)
    assert build.roads_total == 1
    assert set(shown(engine)) == before
    assert len(before) == 3


def test_placing_twice_does_nothing_twice(engine):
    """A worker killed after the finding's commit, and its successor: the same rows."""
    (done,) = post(engine, turning(1, *BENT))
    roadwork.begin_build(engine, done.build_id)
    assert network.place_drives(engine, find_roads, done.build_id) == 1
    once = shown(engine)
    assert network.place_drives(engine, find_roads, done.build_id) == 1
    assert shown(engine) == once


def test_a_killed_finding_leaves_nothing(engine):
    """A death while roads are found shows no road and no pass, and the drive still waits."""
    (done,) = post(engine, turning(1, *BENT))
    roadwork.begin_build(engine, done.build_id)

    def die(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        network.place_drives(engine, die, done.build_id)
    assert shown(engine) == {}
    with read(engine) as connection:
        assert list(drives.waiting_boxes(connection)) == [done.survey_id]
    assert network.place_drives(engine, find_roads, done.build_id) == 1


def test_a_drive_that_comes_in_meanwhile_is_not_lost(engine):
    """A post between finding and writing waits for its own build; the finding is made anew."""
    (done,) = post(engine, turning(1, *ALONG))
    roadwork.begin_build(engine, done.build_id)
    tries = []

    def find_while_posting(driven, known, new_ids):
        if not tries:
            post(engine, turning(2, *BENT))
        tries.append(len(driven))
        return find_roads(driven, known, new_ids)

    assert network.place_drives(engine, find_while_posting, done.build_id) == 1
    with read(engine) as connection:
        assert len(drives.waiting_boxes(connection)) == 1


def test_one_drive_that_breaks_the_finding_keeps_no_other_out(engine):
    """The drive that raises is set aside; the one beside it gets its road."""
    good, bad = post(engine, turning(1, *ALONG), turning(2, *BENT))

    def find(driven, known, new_ids):
        if bad.survey_id in {one.drive_id for one in driven}:
            raise ZeroDivisionError("a fault in the finding")
        return find_roads(driven, known, new_ids)

    roadwork.begin_build(engine, bad.build_id)
    assert network.place_drives(engine, find, bad.build_id) == 1
    assert len(surveys.get_survey(engine, good.survey_id).roads) == 1
    with read(engine) as connection:
        assert drives.waiting_boxes(connection) == {}


def test_a_drive_that_stands_ends_its_build_with_a_reason(engine):
    """No road, no map: the build says why."""
    still = turning(1, (0.0, 0.0), (12.0, 0.0), (0.0, 5.0))
    (done,) = post(engine, still)
    build = run(engine, done.build_id)
    assert (build.status, build.problem["code"]) == ("failed", "no-road-found")


def test_a_dismissed_build_leaves_its_drives_to_the_next(engine):
    """Nothing of a dismissed build is written; the next build finds the roads."""
    (first,) = post(engine, turning(1, *BENT))
    roadwork.begin_build(engine, first.build_id)
    builds.dismiss_build(engine, first.build_id)
    assert network.place_drives(engine, find_roads, first.build_id) == 0
    assert shown(engine) == {}
    requested = builds.request_build(engine, None)
    assert run(engine, requested.id).status == "successful"
    assert len(shown(engine)) == 1


def test_deleting_the_only_drive_of_a_road_leaves_no_road(engine):
    """What nobody drives any more is neither shown nor mapped."""
    kept, gone = post(engine, turning(1, *ALONG), turning(2, (0.0, 3000.0), (700.0, 3000.0)))
    run(engine, gone.build_id)
    assert len(shown(engine)) == 2
    build = run(engine, surveys.delete_survey(engine, gone.survey_id))
    assert build.status == "successful"
    assert set(shown(engine)) == set(surveys.get_survey(engine, kept.survey_id).roads)
    assert mapped(engine, build.map_version) == list(shown(engine))


def test_deleting_a_drive_shortens_the_road_to_what_is_driven(engine):
    """The part of a road that only the forgotten drive drove goes with it."""
    long, short = post(engine, turning(1, *ALONG), turning(2, (0.0, 0.0), (500.0, 0.0)))
    run(engine, short.build_id)
    (road_id,) = shown(engine)
    assert length_m(roads.get_road(engine, road_id).line) == pytest.approx(1300.0, abs=40.0)
    run(engine, surveys.delete_survey(engine, long.survey_id))
    assert shown(engine) == {road_id: 1}
    assert length_m(roads.get_road(engine, road_id).line) == pytest.approx(500.0, abs=40.0)


def test_a_drawn_road_takes_the_drives_beside_it(engine):
    """A line that somebody sets is kept, and drives are laid on it by the next build."""
    (done,) = post(engine, turning(1, *ALONG))
    run(engine, done.build_id)
    line = line_at(0.0, length_m=1300.0, x_m=-300.0)
    roads.put_road(engine, Road("main-street", "Main Street", line))
    build = run(engine, builds.request_build(engine, None).id)
    assert build.status == "successful"
    assert surveys.get_survey(engine, done.survey_id).roads == ("main-street",)
    assert list(shown(engine)) == ["main-street"]
    np.testing.assert_array_equal(roads.get_road(engine, "main-street").line.lon, line.lon)


def test_a_survey_that_names_its_road_stays_there(engine):
    """Finding roads moves no pass of a survey that named its own."""
    named = turning(1, *ALONG, road_id="mine")
    first, second = post(engine, named, turning(2, *ACROSS))
    run(engine, second.build_id)
    assert surveys.get_survey(engine, first.survey_id).roads == ("mine",)
    assert len(shown(engine)) == 2


def test_far_drives_are_found_apart():
    """Drives of two towns are two neighbourhoods, those of one town are one."""
    boxes = {
        name: ingest.bounds_of([lon, lon + 0.01], [lat, lat + 0.01])
        for name, lon, lat in (("a", 10.0, 50.0), ("b", 10.012, 50.0), ("c", 11.0, 50.0))
    }
    assert network.groups_of(boxes) == [frozenset("ab"), frozenset("c")]


def test_two_devices_of_one_car_stay_two_surveys(engine):
    """The same way at the same time on two phones is two passes of each road."""
    one, other = turning(1, *ALONG, device="left"), turning(2, *ALONG, device="right")
    done = post(engine, one, other)
    run(engine, done[-1].build_id)
    assert list(shown(engine).values()) == [2]
