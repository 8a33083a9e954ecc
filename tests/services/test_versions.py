"""What a build makes of the map: versions that overlay one another, activation and the way back."""

from __future__ import annotations

import pytest

from app.domain import Road
from app.errors import NotFound, NothingToBuild
from app.services import builds, maps, roads, roadwork
from app.store import models
from app.store.engine import read
from tests.factories import line_at, trace_along
from tests.services.building import calibrate, fit, mapped, post, run


def test_a_build_that_shall_not_activate_leaves_the_active_map(engine):
    """Its version is there to be chosen by hand."""
    run(engine, post(engine, "r1").build_id)
    quiet = run(engine, builds.request_build(engine, None, activate=False).id)
    assert quiet.map_version == 2
    assert maps.active_version(engine) == 1
    assert maps.activate(engine, 2).active


def test_surveys_do_not_join_a_build_that_shall_not_activate(engine):
    """Their map must become active, so they get a build that does."""
    post(engine, "r1", build=False)
    quiet = builds.request_build(engine, ["r1"], activate=False)
    assert post(engine, "r1", seed=2).build_id != quiet.id


def test_an_older_build_does_not_undo_a_newer_one(engine):
    """Where two builds overlap, a road keeps the model of the one that began later."""
    early = post(engine, "r1").build_id
    roadwork.begin_build(engine, early)
    roadwork.build_road(engine, fit, early, "r1")
    late = post(engine, "r1", seed=2).build_id
    run(engine, late)
    roadwork.publish(engine, calibrate, early)
    with read(engine) as connection:
        kept = models.of_build(connection, late)
        assert roadwork.versions.model_ids(connection, 2) == kept
    assert maps.active_version(engine) == 2


def test_a_version_activated_while_another_calibrates_is_built_on(engine):
    """The base is the version active when the new one is stored, not when its work began."""
    post(engine, "r1", build=False)
    post(engine, "r2", build=False)
    first = builds.request_build(engine, ["r1"]).id
    second = builds.request_build(engine, ["r2"]).id
    for build_id, road_id in ((first, "r1"), (second, "r2")):
        roadwork.begin_build(engine, build_id)
        roadwork.build_road(engine, fit, build_id, road_id)
    rounds = []

    def slow_calibrate(fitted):
        if not rounds:
            roadwork.publish(engine, calibrate, second)
        rounds.append(len(fitted))
        return calibrate(fitted)

    roadwork.publish(engine, slow_calibrate, first)
    assert rounds == [1, 2]
    assert mapped(engine, maps.active_version(engine)) == ["r1", "r2"]
    assert maps.list_maps(engine)[0].calibration.window_count == 14


def test_asking_for_a_build_of_nothing_is_refused(engine):
    """No roads, an empty list, an unknown road: each is told apart."""
    with pytest.raises(NothingToBuild):
        builds.request_build(engine, None)
    with pytest.raises(NothingToBuild):
        builds.request_build(engine, [])
    with pytest.raises(NotFound):
        builds.request_build(engine, ["nowhere"])
    with pytest.raises(NotFound):
        builds.get_build(engine, "nothing")
    with pytest.raises(NotFound):
        builds.dismiss_build(engine, "nothing")


def test_a_road_that_was_never_driven_fails_with_that_reason(engine):
    """A road that somebody only drew has no samples to build from."""
    roads.put_road(engine, Road("drawn", None, line_at()))
    build = run(engine, builds.request_build(engine, ["drawn"]).id)
    assert (build.status, build.failed_roads[0].code) == ("failed", "not-enough-samples")


def test_builds_are_listed_newest_first(engine):
    """Following the cursors visits every build once."""
    post(engine, "r1", build=False)
    made = [builds.request_build(engine, ["r1"]).id for _ in range(5)]
    page = builds.list_builds(engine, limit=3)
    rest = builds.list_builds(engine, limit=3, cursor=page.next_cursor)
    assert [build.id for build in (*page.items, *rest.items)] == made[::-1]
    assert rest.next_cursor is None


def test_maps_can_be_rolled_back(engine):
    """Activating an older version makes it the active one, and says when."""
    run(engine, post(engine, "r1").build_id)
    run(engine, post(engine, "r1", seed=2).build_id)
    back = maps.activate(engine, 1)
    assert (back.active, maps.active_version(engine)) == (True, 1)
    assert [version.active for version in maps.list_maps(engine)] == [False, True]
    assert back.activated_at > maps.get_map(engine, 2).activated_at
    with pytest.raises(NotFound):
        maps.activate(engine, 3)
    with pytest.raises(NotFound):
        maps.get_map(engine, 3)
    with pytest.raises(NotFound):
        maps.load_radio_map(engine, 3)


def test_roads_are_seen_as_a_version_has_them(engine):
    """Counts are the version's, surveys those stored now; the version defaults to the active."""
    run(engine, post(engine, "r1").build_id)
    post(engine, "r1", seed=2)
    road = roads.get_road(engine, "r1")
    assert (road.segment_count, road.survey_count, road.model_version) == (3, 2, 1)
    assert len(roads.list_segments(engine, "r1")) == 3
    one = roads.get_segment(engine, "r1", 2)
    assert (one.segment.index, len(one.segment.curves)) == (2, 3)
    assert one.road.cells == tuple(sorted(trace_along(line_at(), seed=1).cells))
    assert [cell.cell for cell in roads.list_cells(engine)] == list(one.road.cells)
    for missing in (
        lambda: roads.get_road(engine, "nowhere"),
        lambda: roads.get_road(engine, "r1", version=9),
        lambda: roads.get_segment(engine, "r1", 3),
        lambda: roads.list_segments(engine, "nowhere"),
        lambda: roads.list_cells(engine, version=9),
        lambda: roads.list_roads(engine, version=9),
    ):
        with pytest.raises(NotFound):
            missing()


def test_a_road_before_any_map_has_no_model(engine):
    """It is listed with its surveys, without length, passes and segments."""
    post(engine, "r1", build=False)
    (road,) = roads.list_roads(engine).items
    assert (road.length_m, road.segment_count, road.survey_count) == (None, 0, 1)
    assert roads.list_segments(engine, "r1") == []
