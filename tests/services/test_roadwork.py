"""A build's work may be cut off and run again anywhere: it does everything once."""

from __future__ import annotations

import pytest

from app.domain import Calibration, Road
from app.errors import NotFound, NothingToBuild, RoadTooShort
from app.services import builds, ingest, maps, roads, roadwork, surveys
from app.store import models
from app.store.engine import read
from tests.factories import line_at, model_of, trace_along


def fit(road, passes):
    """A made-up model; roads named bad or broken have none."""
    if road.road_id.startswith("bad"):
        raise RoadTooShort(needed_m=20.0, got_m=3.5)
    if road.road_id.startswith("broken"):
        raise ZeroDivisionError("a fault in the fit")
    cells = tuple(sorted({cell for trace in passes for cell in trace.cells}))
    return model_of(road.road_id, seed=len(passes), cells=cells)


def calibrate(fitted):
    return Calibration(window_count=sum(len(model.evidence) for model in fitted))


def post(engine, road_id, seed=1, **options):
    trace = trace_along(line_at(), seed=seed, road_id=road_id)
    return ingest.accept_survey(engine, trace, **options)


def run(engine, build_id):
    """All of a build, as the job does it."""
    count = roadwork.begin_build(engine, build_id)
    for road_id in roadwork.waiting_roads(engine, build_id, 0, count):
        if not roadwork.build_road(engine, fit, build_id, road_id):
            break
    roadwork.publish(engine, calibrate, build_id)
    roadwork.clear_leftovers(engine, build_id)
    return builds.get_build(engine, build_id)


def mapped(engine, version):
    return [model.road_id for model in maps.load_radio_map(engine, version).models]


def test_a_build_makes_a_version_of_its_roads_and_activates_it(engine):
    """Two roads built, one version with both, active, calibrated on their evidence."""
    post(engine, "r1")
    build = run(engine, post(engine, "r2", seed=2).build_id)
    assert (build.status, build.progress, build.roads_done, build.map_version) == (
        "successful", 1.0, 2, 1,
    )  # fmt: skip
    assert build.started_at <= build.finished_at
    assert mapped(engine, 1) == ["r1", "r2"]
    (version,) = maps.list_maps(engine)
    assert (version.active, version.road_count, version.build_id) == (True, 2, build.id)
    assert version.calibration == Calibration(window_count=14)


def test_progress_moves_road_by_road(engine):
    """Each road done is counted at once."""
    build_id = [post(engine, f"r{n}").build_id for n in range(3)][-1]
    roadwork.begin_build(engine, build_id)
    seen = []
    for road_id in ("r0", "r1", "r2"):
        roadwork.build_road(engine, fit, build_id, road_id)
        seen.append(builds.get_build(engine, build_id).roads_done)
    assert seen == [1, 2, 3]


def test_every_step_run_twice_does_nothing_twice(engine):
    """The same calls again leave the same models, the same version and the same activation."""
    build_id = post(engine, "r1").build_id
    for _ in range(2):
        assert roadwork.begin_build(engine, build_id) == 1
        assert roadwork.build_road(engine, fit, build_id, "r1")
    with read(engine) as connection:
        once = models.of_build(connection, build_id)
    for _ in range(2):
        roadwork.publish(engine, calibrate, build_id)
        roadwork.clear_leftovers(engine, build_id)
    with read(engine) as connection:
        assert models.of_build(connection, build_id) == once
    assert len(maps.list_maps(engine)) == 1


def test_a_road_built_twice_at_once_is_stored_once(engine):
    """A worker thought dead that comes back finds its road done and stores nothing."""
    build_id = post(engine, "r1").build_id
    roadwork.begin_build(engine, build_id)

    def slow_fit(road, passes):
        roadwork.build_road(engine, fit, build_id, "r1")  # another worker is quicker
        return model_of("r1", seed=99)

    roadwork.build_road(engine, slow_fit, build_id, "r1")
    roadwork.publish(engine, calibrate, build_id)
    assert builds.get_build(engine, build_id).status == "successful"
    served = maps.load_radio_map(engine, 1).models[0]
    assert (served.mean_dbm[0] == model_of("r1", seed=1).mean_dbm[0])[1:].all()


@pytest.mark.parametrize(
    ("bad", "code", "detail"),
    [
        ("bad-1", "road-too-short", "3.5 m long, 20.0 m are needed"),
        ("broken-1", "internal-error", "ZeroDivisionError: a fault in the fit"),
    ],
)
def test_a_bad_road_fails_alone_with_its_reason(engine, bad, code, detail):
    """The others are built and published; the bad one keeps the model it had, here none."""
    post(engine, "r1")
    build = run(engine, post(engine, bad).build_id)
    assert build.status == "successful"
    ((road_id, found, reason),) = build.failed_roads
    assert (road_id, found) == (bad, code)
    assert detail in reason
    assert mapped(engine, build.map_version) == ["r1"]


def test_a_build_of_bad_roads_only_fails_and_changes_no_map(engine):
    """No version appears, and the problem says which roads and why."""
    build = run(engine, post(engine, "bad-1").build_id)
    assert (build.status, build.map_version) == ("failed", None)
    assert build.problem["code"] == "no-road-built"
    assert "bad-1: the surveyed stretch" in build.problem["detail"]
    assert maps.list_maps(engine) == []


def test_a_version_costs_what_changed(engine):
    """An unchanged road keeps its very model in the next version."""
    post(engine, "r1")
    run(engine, post(engine, "r2").build_id)
    run(engine, post(engine, "r2", seed=2).build_id)
    first, second = (maps.load_radio_map(engine, version).models for version in (1, 2))
    assert [model.pass_count for model in second] == [2, 2]
    with read(engine) as connection:
        one, two = (roadwork.versions.model_ids(connection, version) for version in (1, 2))
    assert one["r1"] == two["r1"]
    assert one["r2"] != two["r2"]
    assert len(first) == len(second) == 2


def test_a_road_without_surveys_leaves_the_map(engine):
    """Deleting a road's last survey takes the road out of the next version only."""
    post(engine, "r1")
    gone = post(engine, "r2")
    run(engine, gone.build_id)
    build = run(engine, surveys.delete_survey(engine, gone.survey_id))
    assert build.status == "successful"
    assert mapped(engine, 2) == ["r1"]
    assert mapped(engine, 1) == ["r1", "r2"]


def test_the_last_road_may_leave(engine):
    """A map of no roads is a map version too."""
    only = post(engine, "r1")
    run(engine, only.build_id)
    build = run(engine, surveys.delete_survey(engine, only.survey_id))
    assert (build.status, mapped(engine, build.map_version)) == ("successful", [])


def test_a_dismissed_build_stops_at_the_next_road(engine):
    """Nothing of it enters a map, and its models are dropped."""
    post(engine, "r1")
    build_id = post(engine, "r2").build_id
    roadwork.begin_build(engine, build_id)
    assert roadwork.build_road(engine, fit, build_id, "r1")
    assert builds.dismiss_build(engine, build_id).status == "dismissed"
    assert not roadwork.build_road(engine, fit, build_id, "r2")
    roadwork.publish(engine, calibrate, build_id)
    roadwork.clear_leftovers(engine, build_id)
    build = builds.get_build(engine, build_id)
    assert (build.status, build.map_version, build.roads_done) == ("dismissed", None, 1)
    assert maps.list_maps(engine) == []
    with read(engine) as connection:
        assert models.of_build(connection, build_id) == {}


def test_a_build_dismissed_during_a_road_stores_none_of_it(engine):
    """The road that was being fitted is thrown away."""
    build_id = post(engine, "r1").build_id
    roadwork.begin_build(engine, build_id)

    def dismissing_fit(road, passes):
        builds.dismiss_build(engine, build_id)
        return fit(road, passes)

    roadwork.build_road(engine, dismissing_fit, build_id, "r1")
    with read(engine) as connection:
        assert models.of_build(connection, build_id) == {}


def test_a_dismissed_build_never_begins(engine):
    """A build called off before its turn is not started."""
    build_id = post(engine, "r1").build_id
    builds.dismiss_build(engine, build_id)
    assert roadwork.begin_build(engine, build_id) == 0
    assert builds.get_build(engine, build_id).status == "dismissed"


def test_a_finished_build_cannot_be_dismissed(engine):
    """Dismissing too late changes nothing."""
    build_id = post(engine, "r1").build_id
    run(engine, build_id)
    assert builds.dismiss_build(engine, build_id).status == "successful"


def test_a_road_that_kills_its_workers_is_given_up(engine):
    """After ten deaths the road fails, and the others go on."""
    build_id = post(engine, "r1").build_id
    roadwork.begin_build(engine, build_id)

    def deadly_fit(road, passes):
        raise SystemExit  # as near to a dying process as a test comes

    for _ in range(roadwork.MOST_ATTEMPTS):
        with pytest.raises(SystemExit):
            roadwork.build_road(engine, deadly_fit, build_id, "r1")
    roadwork.build_road(engine, deadly_fit, build_id, "r1")
    (failed,) = builds.get_build(engine, build_id).failed_roads
    assert failed.code == "worker-died"


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
