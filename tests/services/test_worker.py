"""Worker processes share a build, take over from the dead, and stop when told."""

from __future__ import annotations

import signal
import time

import pytest

from app.services import builds, ingest, maps
from tests.factories import line_at, trace_along
from tests.services.conftest import wait_until


def post(engine, *road_ids):
    """One survey a road; the build that takes them in."""
    done = [
        ingest.accept_survey(
            engine, trace_along(line_at(50.0 * n), seed=n, road_id=road_id), build=False
        )
        for n, road_id in enumerate(road_ids)
    ]
    assert done
    return builds.request_build(engine, list(road_ids)).id


def test_two_workers_share_a_build_and_bad_roads_fail_alone(crew):
    """Every road is fitted once, by one of two; two bad ones are listed with their reasons."""
    names = ["bad-1", "broken-1", *(f"r{n}" for n in range(8))]
    crew.start_worker(0.4)
    crew.start_worker(0.4)
    wait_until(lambda: len(list((crew.data_dir / "workers").glob("*.lock"))) == 2)
    time.sleep(1.5)  # both have launched
    build = crew.finish(post(crew.engine, *names))
    assert (build.status, build.roads_done) == ("successful", 10)
    assert [(road, code) for road, code, _ in build.failed_roads] == [
        ("bad-1", "not-enough-samples"),
        ("broken-1", "internal-error"),
    ]
    assert sorted(crew.fits()) == sorted(names)
    assert len(crew.workers_that_fitted()) == 2
    assert len(maps.load_radio_map(crew.engine, 1).models) == 8


@pytest.mark.postgresql
def test_a_worker_on_postgresql_takes_over_from_a_killed_one(postgres_crew):
    """The same code on PostgreSQL: a build outlives its worker, nothing is fitted in vain."""
    crew = postgres_crew
    build_id = post(crew.engine, *(f"r{n}" for n in range(5)))
    first = crew.start_worker(0.3)
    wait_until(lambda: builds.get_build(crew.engine, build_id).roads_done >= 2)
    crew.kill(first)
    crew.start_worker(0.0)
    build = crew.finish(build_id)
    assert (build.status, build.roads_done) == ("successful", 5)
    assert len(crew.fits()) <= 6  # only the road that was under way is fitted again


def test_a_living_worker_takes_over_from_a_killed_one(crew):
    """Without any restart the other worker finishes, within seconds, not after a timeout."""
    build_id = post(crew.engine, *(f"r{n}" for n in range(6)))
    workers = [crew.start_worker(0.5), crew.start_worker(0.5)]
    wait_until(lambda: builds.get_build(crew.engine, build_id).roads_done >= 1)
    wait_until(lambda: len(crew.workers_that_fitted()) == 2)
    crew.kill(workers[0])
    killed_s = time.monotonic()
    build = crew.finish(build_id)
    assert build.status == "successful"
    assert time.monotonic() - killed_s < 12.0  # well below what a silent worker is granted
    assert len(crew.fits()) <= 7


def test_a_dismissed_build_ends_between_two_roads(crew):
    """The roads not begun yet are never fitted, no map appears, and the next build runs."""
    build_id = post(crew.engine, *(f"r{n}" for n in range(30)))
    crew.start_worker(0.1)
    wait_until(lambda: builds.get_build(crew.engine, build_id).roads_done >= 2)
    builds.dismiss_build(crew.engine, build_id)
    begun = len(crew.fits())
    after = crew.finish(builds.request_build(crew.engine, ["r1"]).id)
    assert after.status == "successful"
    assert len(crew.fits()) <= begun + 2
    assert [version.build_id for version in maps.list_maps(crew.engine)] == [after.id]


def test_a_terminated_worker_ends_at_once_and_leaves_its_work_to_others(crew):
    """SIGTERM does not wait for the road; another worker fits it again."""
    build_id = post(crew.engine, "r1")
    first = crew.start_worker(60.0)
    wait_until(lambda: crew.fits() == ["r1"])
    first.send_signal(signal.SIGTERM)
    asked_s = time.monotonic()
    first.wait(10)
    assert time.monotonic() - asked_s < 5.0
    crew.start_worker(0.0)
    assert crew.finish(build_id).status == "successful"


def test_a_build_without_its_job_is_started_again(crew):
    """When the jobs' file is lost, what it held is still in the store."""
    build_id = post(crew.engine, *(f"r{n}" for n in range(4)))
    first = crew.start_worker(0.4)
    wait_until(lambda: builds.get_build(crew.engine, build_id).roads_done >= 1)
    crew.kill(first)
    for leftover in crew.data_dir.glob("jobs.sqlite*"):
        leftover.unlink()
    crew.start_worker(0.0)
    assert crew.finish(build_id).status == "successful"
    assert len(crew.fits()) <= 5
