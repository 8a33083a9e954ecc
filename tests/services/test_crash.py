"""
kill -9 at any moment: no accepted survey is lost, no half map is seen, nothing is done twice.

Real processes, killed at seeded random moments.
"""

from __future__ import annotations

import random
import threading
import time

import sqlalchemy as sa

from app.services import builds, ingest, maps, surveys
from app.store.engine import read
from tests.factories import line_at, trace_along
from tests.services.conftest import ENDED, wait_until

DRIVES = 150


def rows(engine, query):
    with read(engine) as connection:
        return connection.execute(sa.text(query)).all()


def assert_maps_are_whole(engine):
    """Every version has the roads it says, each with all of its model."""
    for version in maps.list_maps(engine):
        radio_map = maps.load_radio_map(engine, version.version)
        assert len(radio_map.models) == version.road_count
        assert radio_map.calibration.window_count == version.road_count
        for model in radio_map.models:
            assert model.mean_dbm.shape == (101, len(model.cells))
            assert len(model.segments) == 3
    incomplete = """
        SELECT model_id, segment_count,
               (SELECT count(*) FROM segments s WHERE s.model_id = m.model_id) AS stored,
               (SELECT count(*) FROM fits f WHERE f.model_id = m.model_id) AS fitted
        FROM road_models m WHERE segment_count <> stored OR fitted <> 3 * cell_count
    """
    assert rows(engine, incomplete) == []
    assert rows(engine, "PRAGMA integrity_check") == [("ok",)]
    assert rows(engine, "PRAGMA foreign_key_check") == []


class Onlooker(threading.Thread):
    """Looks at the active map all the time, as a serving process does."""

    def __init__(self, engine):
        super().__init__(daemon=True)
        self.engine, self.done, self.faults, self.seen = engine, threading.Event(), [], set()

    def run(self):  # noqa: D102 - the thread's body
        while not self.done.wait(0.05):
            version = maps.active_version(self.engine)
            if version is None:
                continue
            radio_map = maps.load_radio_map(self.engine, version)
            self.seen.add(version)
            said = maps.get_map(self.engine, version)
            if len(radio_map.models) != said.road_count:
                self.faults.append((version, len(radio_map.models), said.road_count))


def test_no_accepted_survey_is_lost_and_every_build_ends(crew):
    """The poster is killed six times and the worker twice while they are at it."""
    rng = random.Random(20211108)
    onlooker = Onlooker(crew.engine)
    onlooker.start()
    worker, kills, cut_off = crew.start_worker(0.1), 0, 0
    accepted: dict[str, str] = {}
    for turn in range(7):
        poster = crew.start("poster_program.py", DRIVES)
        said = []
        if turn < 6:
            said = [poster.stdout.readline() for _ in range(20 * turn + rng.randrange(1, 20))]
            time.sleep(rng.uniform(0.0, 0.01))  # anywhere in what it does next
            crew.kill(poster)
        if turn % 3 == 2:  # every third turn: in between it gets somewhere
            crew.kill(worker)
            kills += 1
            worker = crew.start_worker(0.1)
        # A killed process may leave half a line: only a whole one was told to anybody.
        said += [line for line in poster.stdout if line.endswith("\n")]
        for number, survey_id in map(str.split, said):
            assert accepted.setdefault(number, survey_id) == survey_id
        cut_off += len(said) < DRIVES
    assert cut_off == 6
    assert len(accepted) == DRIVES

    stored = rows(crew.engine, "SELECT survey_id, build_id FROM surveys")
    assert {row.survey_id for row in stored} == set(accepted.values())
    for build_id in {row.build_id for row in stored}:
        assert crew.finish(build_id).status == "successful"
    wait_until(lambda: maps.active_version(crew.engine) in onlooker.seen)
    onlooker.done.set()
    onlooker.join()
    assert onlooker.faults == []
    assert_maps_are_whole(crew.engine)

    active = maps.load_radio_map(crew.engine, maps.active_version(crew.engine))
    assert {model.road_id for model in active.models} == {f"r{n}" for n in range(7)}
    built = rows(crew.engine, "SELECT count(*) AS n FROM build_roads WHERE state = 'built'")[0].n
    assert rows(crew.engine, "SELECT count(*) AS n FROM road_models")[0].n == built
    assert len(crew.fits()) <= built + kills  # a kill costs at most the road that was under way
    ended = rows(crew.engine, "SELECT count(*) AS n FROM builds WHERE status = 'successful'")[0].n
    assert len(maps.list_maps(crew.engine)) == ended


def test_a_build_whose_workers_are_killed_over_and_over_still_ends(crew):
    """Two workers, each killed at random moments and started again, finish twelve roads."""
    rng = random.Random(7)
    for number in range(12):
        trace = trace_along(line_at(50.0 * number), seed=number, road_id=f"r{number}")
        ingest.accept_survey(crew.engine, trace, build=False)
    build_id = builds.request_build(crew.engine, None).id
    workers = [crew.start_worker(0.25) for _ in range(2)]
    kills = 0
    done_before = 0
    while builds.get_build(crew.engine, build_id).status not in ENDED and kills < 8:
        time.sleep(rng.uniform(0.5, 2.0))
        done = builds.get_build(crew.engine, build_id).roads_done
        assert done >= done_before
        done_before = done
        victim = rng.randrange(2)
        crew.kill(workers[victim])
        kills += 1
        workers[victim] = crew.start_worker(0.25)
    build = crew.finish(build_id)
    assert (build.status, build.roads_done, build.failed_roads) == ("successful", 12, ())
    assert len(maps.list_maps(crew.engine)) == 1
    assert_maps_are_whole(crew.engine)
    assert set(crew.fits()) == {f"r{n}" for n in range(12)}
    assert len(crew.fits()) <= 12 + kills


def test_a_survey_posted_while_every_worker_is_dead_is_built_later(crew):
    """The build waits in the store for the next worker."""
    worker = crew.start_worker(0.0)
    wait_until(lambda: list((crew.data_dir / "workers").glob("*.lock")))
    crew.kill(worker)
    done = ingest.accept_survey(crew.engine, trace_along(line_at(), seed=1, road_id="r1"))
    crew.start_worker(0.0)
    assert crew.finish(done.build_id).status == "successful"
    assert surveys.get_survey(crew.engine, done.survey_id).roads == ("r1",)
