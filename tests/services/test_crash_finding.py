"""kill -9 while roads are found from drives: no drive is lost, no half network shows, it ends."""

from __future__ import annotations

import random
import time
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import sqlalchemy as sa

from app.domain import Line
from app.numerics.lines import length_m
from app.services import builds, ingest, roads, surveys
from app.store.engine import create_store_engine, read
from app.store.migrate import migrate
from tests.factories import FRAME, trace_along
from tests.services.building import run
from tests.services.conftest import ENDED, wait_until

TOWN = (
    ((-300.0, 0.0), (1000.0, 0.0)),
    ((500.0, -400.0), (500.0, 800.0)),
    ((0.0, 0.0), (500.0, 0.0), (500.0, 400.0)),
    ((1000.0, 0.0), (500.0, 0.0), (500.0, -400.0)),
)
TOWNS_M = (0.0, 20_000.0)  # northward: two neighbourhoods


def post_towns(engine):
    """Every town's drives, each under its town; and the build that waits for them."""
    posted = []
    for north_m in TOWNS_M:
        town = []
        for seed, corners in enumerate(TOWN):
            at = FRAME.to_lonlat(*np.add(corners, (0.0, north_m)).T)
            line = Line(np.asarray(at.lon), np.asarray(at.lat))
            trace = trace_along(line, seed=seed, noise_m=2.0, step_m=8.0)
            done = ingest.accept_survey(engine, replace(trace, device=f"phone-{seed}-{north_m}"))
            town.append(done.survey_id)
        posted.append(town)
    return posted, done.build_id


def network_of(engine):
    """What the network is, without its roads' made-up ids."""
    shown = [round(length_m(road.line), 6) for road in roads.list_roads(engine).items]
    query = "SELECT survey_id, first_sample, end_sample FROM passes ORDER BY survey_id, position"
    with read(engine) as connection:
        passes = connection.execute(sa.text(query)).all()
    along = Counter(row[0] for row in passes)
    return sorted(shown), [row[1:] for row in passes], list(along.values())


def state_of(engine):
    """All rows that the finding writes, as they are."""
    tables = ("roads", "passes", "build_roads", "builds")
    with read(engine) as connection:
        placings = connection.execute(sa.text("SELECT survey_id, placing FROM surveys")).all()
        return [connection.execute(sa.text(f"SELECT * FROM {t}")).all() for t in tables] + [  # noqa: S608
            placings
        ]


def assert_whole(engine, towns):
    """Of each town all drives wait or all are found, with every road that their passes name."""
    query = """
        SELECT s.placing, r.line_lon IS NOT NULL AS drawn, count(*) AS n
        FROM surveys s LEFT JOIN passes p ON p.survey_id = s.survey_id
        LEFT JOIN roads r ON r.road_id = p.road_id WHERE s.survey_id IN :ids GROUP BY 1, 2
    """
    for town in towns:
        with read(engine) as connection:
            rows = connection.execute(
                sa.text(query).bindparams(sa.bindparam("ids", expanding=True)), {"ids": town}
            ).all()
        assert len({row.placing for row in rows}) == 1, rows
        if rows[0].placing == "found":
            assert [row.drawn for row in rows] == [1], rows
        assert all(surveys.get_survey(engine, survey_id).samples for survey_id in town)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The network that the towns' drives make when nobody dies."""
    engine = create_store_engine(f"sqlite:///{tmp_path_factory.mktemp('calm')}/roadprint.sqlite")
    migrate(engine)
    _, build_id = post_towns(engine)
    assert run(engine, build_id).status == "successful"
    yield network_of(engine)
    engine.dispose()


def test_a_worker_killed_over_and_over_while_it_finds_roads(crew, undisturbed):
    """Killed at random moments of four findings; at any moment each town is whole or waits."""
    rng = random.Random(20250322)
    towns, build_id = post_towns(crew.engine)
    finds = crew.data_dir / "finds.log"
    begun = 0
    for _ in range(4):
        worker = crew.start_worker(0.4)

        def more(before=begun):
            seen = len(finds.read_text().splitlines()) if finds.exists() else 0
            return seen > before or builds.get_build(crew.engine, build_id).status in ENDED

        wait_until(more)
        time.sleep(rng.uniform(0.0, 0.7))  # within the finding, or in what it writes after it
        crew.kill(worker)
        begun = len(finds.read_text().splitlines())
        assert_whole(crew.engine, towns)
    crew.start_worker(0.0)
    build = crew.finish(build_id)
    assert (build.status, build.failed_roads) == ("successful", ())
    assert build.roads_done == build.roads_total == len(roads.list_roads(crew.engine).items)
    assert_whole(crew.engine, towns)
    assert network_of(crew.engine) == undisturbed


def test_death_at_any_statement_of_the_finding_leaves_what_was(crew, undisturbed):
    """Before the commit nothing has changed, after it all; the next start ends either."""
    towns, build_id = post_towns(crew.engine)
    crew.start("finding_program.py", build_id, "finding").wait()
    before = state_of(crew.engine)
    for at in (1, 4, 6):
        assert crew.start("finding_program.py", build_id, at).wait() == -9
        assert state_of(crew.engine) == before, at
    assert crew.start("finding_program.py", build_id, 9).wait() == -9  # in the second town
    first_town = state_of(crew.engine)
    assert first_town != before
    assert_whole(crew.engine, towns)
    assert crew.start("finding_program.py", build_id, 3).wait() == -9
    assert state_of(crew.engine) == first_town
    assert crew.start("finding_program.py", build_id, "committed").wait() == -9
    assert state_of(crew.engine) != first_town
    assert_whole(crew.engine, towns)
    crew.start_worker(0.0)
    assert crew.finish(build_id).status == "successful"
    assert network_of(crew.engine) == undisturbed
