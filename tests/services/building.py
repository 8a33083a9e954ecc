"""A build without its worker: the steps of a job, with a fit that costs nothing."""

from __future__ import annotations

from app.domain import Calibration
from app.errors import RoadTooShort
from app.numerics.network.finding import find_roads
from app.services import builds, ingest, maps, network, roadwork
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
    roadwork.begin_build(engine, build_id)
    count = network.place_drives(engine, find_roads, build_id)
    for road_id in roadwork.waiting_roads(engine, build_id, 0, count):
        if not roadwork.build_road(engine, fit, build_id, road_id):
            break
    if count:
        roadwork.publish(engine, calibrate, build_id)
    else:
        network.end_without_roads(engine, build_id)
    roadwork.clear_leftovers(engine, build_id)
    return builds.get_build(engine, build_id)


def mapped(engine, version):
    return [model.road_id for model in maps.load_radio_map(engine, version).models]
