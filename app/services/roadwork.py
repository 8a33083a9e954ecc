"""
The work of a build, road by road, then its map version: every function may be run again.

Nothing here knows who calls it or how often. A road's model and its place in the build are one
write, and so are a map version, its activation and the end of its build; whoever comes second finds
the work done. `app.services.jobs` makes the calls durable.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from sqlalchemy.engine import Connection, Engine
from sqlalchemy.exc import SQLAlchemyError

from app.domain import Calibration, Road, RoadModel, Trace
from app.errors import CannotBuildRoad, NotEnoughSamples
from app.numerics.coverage import cover
from app.store import builds, coverage, drives, models, roads, surveys, versions
from app.store.engine import read, write
from app.store.records import RoadOutcome

log = logging.getLogger(__name__)

FitRoad = Callable[[Road, Sequence[Trace]], RoadModel]
Calibrate = Callable[[Sequence[RoadModel]], Calibration]

MOST_ATTEMPTS = 10  # at a road whose worker dies each time: it is the road, then, not the machine
OPTIMISTIC_TRIES = 3  # at calibrating without the write lock while other builds publish


@dataclass(frozen=True, slots=True)
class Overlay:
    """The models of the next map version, and the version they were laid over."""

    base: int | None
    models: dict[str, int]


def begin_build(engine: Engine, build_id: str) -> int:
    """Close a build's list of roads; how many there are, 0 when the build is over."""
    with write(engine) as connection:
        if builds.begin(connection, build_id) != "running":
            return 0
        return len(builds.select_roads(connection, build_id))


def waiting_roads(engine: Engine, build_id: str, first: int, end: int) -> list[str]:
    """Ids of the roads ``first:end`` of a build's list that wait to be built."""
    with read(engine) as connection:
        listed = builds.select_roads(connection, build_id)[first:end]
    return [row.road_id for row in listed if row.state == "waiting"]


def build_road(engine: Engine, fit: FitRoad, build_id: str, road_id: str) -> bool:
    """
    Build one road of a build; False when the build is over and the other roads may be left.

    A road that cannot be built ends as failed with its reason and touches no other.
    """
    with write(engine) as connection:
        if builds.select_status(connection, build_id) != "running":
            return False
        attempts = builds.begin_road(connection, build_id, road_id)
    if attempts == 0:
        return True  # somebody built it before
    if attempts > MOST_ATTEMPTS:
        detail = f"the worker died {MOST_ATTEMPTS} times while it built this road"
        _close(engine, build_id, road_id, RoadOutcome("failed", "worker-died", detail))
        return True
    try:
        _fit_and_store(engine, fit, build_id, road_id)
    except SQLAlchemyError:
        raise  # the store's trouble is not the road's: the job tries again
    except CannotBuildRoad as reason:
        _close(engine, build_id, road_id, RoadOutcome("failed", reason.code, str(reason)))
    except Exception as fault:
        log.exception("road %s of build %s broke the fit", road_id, build_id)
        detail = f"{type(fault).__name__}: {fault}"
        _close(engine, build_id, road_id, RoadOutcome("failed", "internal-error", detail))
    return True


def publish(engine: Engine, calibrate: Calibrate, build_id: str) -> None:
    """
    Make the map version of a build whose roads are done, and end the build.

    The active version's models, overlaid with the build's. A base model of a build that began later
    stays: it has seen every survey that this build has.
    """
    for attempt in range(OPTIMISTIC_TRIES + 1):
        with read(engine) as connection:
            overlay = _overlay(connection, build_id)
            evidence = models.load_by_id(connection, list(overlay.models.values()))
        calibration = calibrate(evidence)
        with write(engine) as connection:
            if builds.select_status(connection, build_id) != "running":
                return
            if _nothing_new(connection, build_id):
                builds.finish(
                    connection, build_id, "failed", problem=_problem(connection, build_id)
                )
                return
            now = _overlay(connection, build_id)
            if now != overlay:
                if attempt < OPTIMISTIC_TRIES:
                    continue  # another version became active meanwhile: calibrate on that
                evidence = models.load_by_id(connection, list(now.models.values()))
                overlay, calibration = now, calibrate(evidence)
            version = versions.insert_version(connection, build_id, overlay.models, calibration)
            build = builds.select_build(connection, build_id)
            if build is not None and build.activate:
                versions.activate(connection, version)
            builds.finish(connection, build_id, "successful", map_version=version)
            return


def abandon(engine: Engine, build_id: str, code: str, detail: str) -> bool:
    """End a build that cannot go on; False when it had ended."""
    problem = {
        "type": f"urn:roadprint:problem:{code}",
        "title": "The build broke off",
        "detail": detail,
    }
    with write(engine) as connection:
        return builds.finish(connection, build_id, "failed", problem={**problem, "code": code})


def clear_leftovers(engine: Engine, build_id: str) -> None:
    """Drop the models of a build that ended without a map version."""
    with write(engine) as connection:
        build = builds.select_build(connection, build_id)
        if build is not None and build.finished_at is not None and build.map_version is None:
            models.delete_of_build(connection, build_id)


def _fit_and_store(engine: Engine, fit: FitRoad, build_id: str, road_id: str) -> None:
    with read(engine) as connection:
        road = roads.select_road(connection, road_id) or Road(road_id)
        passes = surveys.select_passes(connection, road_id)
        active = versions.active_version(connection)
        mapped = versions.model_of(connection, active, road_id) is not None
        made = bool(drives.found_among(connection, [road_id]))
    if not passes and (mapped or made):  # a road that drives made goes when they lie elsewhere
        _close(engine, build_id, road_id, RoadOutcome("gone"))
        return
    if not passes:
        raise NotEnoughSamples(needed=2, got=0)
    model = fit(road, passes)
    covered = [asdict(segment) for segment in cover(model, passes)]
    with write(engine) as connection:
        if builds.finish_road(connection, build_id, road_id, RoadOutcome("built")):
            model_id = models.insert_model(connection, build_id, model)
            coverage.insert_coverage(connection, model_id, covered)


def _close(engine: Engine, build_id: str, road_id: str, outcome: RoadOutcome) -> None:
    with write(engine) as connection:
        builds.finish_road(connection, build_id, road_id, outcome)


def _overlay(connection: Connection, build_id: str) -> Overlay:
    base = versions.active_version(connection)
    chosen = versions.model_ids(connection, base)
    outcome = {row.road_id: row.state for row in builds.select_roads(connection, build_id)}
    newer = models.roads_begun_after(connection, build_id, base)
    for road_id, model_id in models.of_build(connection, build_id).items():
        if road_id not in newer:
            chosen[road_id] = model_id
    for road_id, state in outcome.items():
        if state == "gone" and road_id not in newer:
            chosen.pop(road_id, None)
    return Overlay(base, chosen)


def _nothing_new(connection: Connection, build_id: str) -> bool:
    return all(row.state == "failed" for row in builds.select_roads(connection, build_id))


def _problem(connection: Connection, build_id: str) -> dict[str, object]:
    failed = [row for row in builds.select_roads(connection, build_id) if row.state == "failed"]
    reasons = "; ".join(f"{row.road_id}: {row.detail}" for row in failed[:5])
    more = f"; and {len(failed) - 5} more" if len(failed) > 5 else ""
    return {
        "type": "urn:roadprint:problem:no-road-built",
        "title": "No road could be built",
        "detail": f"all {len(failed)} roads failed: {reasons}{more}",
        "code": "no-road-built",
    }
