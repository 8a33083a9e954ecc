"""A build's work may be cut off and run again anywhere: it does everything once."""

from __future__ import annotations

import pytest

from app.domain import Calibration
from app.services import builds, maps, roadwork, surveys
from app.store import models
from app.store.engine import read
from tests.factories import model_of
from tests.services.building import calibrate, fit, mapped, post, run


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
