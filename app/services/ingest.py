"""Taking a survey in: stored together with the build that it calls for, or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from sqlalchemy.engine import Connection, Engine

from app.domain import Line, Trace
from app.errors import DuplicateSurvey, IdempotencyMismatch
from app.numerics import lines
from app.services.builds import join_build
from app.services.swapped import refuse_swapped
from app.store import roads, surveys
from app.store.bounds import bounds_of, widened
from app.store.columns import new_id
from app.store.engine import write
from app.store.records import Placing, SurveySummary
from app.store.surveys import PassRange, Receipt

NEAR_M = 25.0  # GPS in a street canyon, and the half width of a wide street
LEAST_SHARE_NEAR = 0.95  # of the samples: a drive that turns off runs along other roads too
DEGREES_OF_NEAR = (
    0.001  # some 110 m of latitude: a box this much wider misses no road within NEAR_M
)
MOST_VERTICES = 200  # of a line that positions are compared with: memory is samples x vertices
STRAIGHT_WITHIN_M = 25.0  # of the line from its first to its last sample: a drive of one road
STRAIGHT_FROM_M = 60.0  # shorter ones are not worth a road


@dataclass(frozen=True, slots=True)
class Accepted:
    """
    What became of a posted survey.

    Attributes:
        build_id: The build that takes it in; None when none was asked for.
        dropped: Readings left out before the survey was stored, by reason.
        replayed: True when an earlier post with the same idempotency key is answered again.
    """

    survey_id: str
    build_id: str | None
    roads: tuple[str, ...]
    samples: int
    dropped: Mapping[str, int]
    replayed: bool


def accept_survey(
    engine: Engine,
    trace: Trace,
    *,
    idempotency_key: str | None = None,
    build: bool = True,
    dropped: Mapping[str, int] | None = None,
) -> Accepted:
    """
    Store a survey and enqueue the build of its roads, in one transaction.

    When this returns the survey outlives a crash, and so does its build: the build's row is the
    message to the worker.

    Raises:
        DuplicateSurvey: The same content is stored, under another idempotency key or none.
        IdempotencyMismatch: The key belongs to a survey of other content.
        SwappedPlaces: Its positions make sense only with longitude and latitude exchanged.
    """
    receipt = Receipt(idempotency_key, surveys.content_hash(trace), dropped or {})
    with write(engine) as connection:
        earlier = _earlier_survey(connection, receipt)
        if earlier is not None:
            return _accepted(earlier, replayed=True)
        refuse_swapped(connection, trace)
        along = assign_roads(connection, trace)
        placing: Placing = "waiting" if trace.road_id is None else "given"
        for piece in along:
            part = slice(piece.first_sample, piece.end_sample)
            box = bounds_of(trace.lon[part], trace.lat[part])
            roads.widen(connection, piece.road_id, box, found=placing == "waiting")
        roads.note_cells(connection, trace.cells)
        survey_id = surveys.insert_survey(connection, trace, along, receipt, placing)
        if build:
            touched = list(dict.fromkeys(piece.road_id for piece in along))
            surveys.name_build(connection, survey_id, join_build(connection, touched))
        stored = surveys.select_summary(connection, survey_id)
    assert stored is not None  # noqa: S101 - it was inserted three lines above
    return _accepted(stored, replayed=False)


def assign_roads(connection: Connection, trace: Trace) -> Sequence[PassRange]:
    """
    Which roads a trace certainly runs along: the one it names, else what can be said at once.

    A trace that names no road waits for a build to find its roads (`app.services.network`). Until
    then it is laid on the known road that `LEAST_SHARE_NEAR` of its samples lie beside; or, when it
    runs straight, on a road of its own. One that turns has no pass yet.
    """
    road_id = trace.road_id or _followed_road(connection, trace)
    if road_id is None and _is_straight(trace):
        road_id = f"road-{new_id()}"
    return [] if road_id is None else [PassRange(road_id, 0, len(trace.time_s))]


def _is_straight(trace: Trace) -> bool:
    """Whether nearly every sample lies by the line from the first to the last."""
    ends = Line(trace.lon[[0, -1]], trace.lat[[0, -1]])
    if lines.length_m(ends) < STRAIGHT_FROM_M:
        return False
    offset_m = np.abs(lines.project(ends, trace.lon, trace.lat).offset_m)
    return float(np.mean(offset_m <= STRAIGHT_WITHIN_M)) >= LEAST_SHARE_NEAR


def _earlier_survey(connection: Connection, receipt: Receipt) -> SurveySummary | None:
    """The survey that this post repeats and may repeat; None when the content is new."""
    if receipt.idempotency_key is not None:
        keyed = surveys.find_by_key(connection, receipt.idempotency_key)
        if keyed is not None:
            survey_id, digest = keyed
            if digest != receipt.content_hash:
                raise IdempotencyMismatch(receipt.idempotency_key, survey_id)
            return surveys.select_summary(connection, survey_id)
    known = surveys.find_by_hash(connection, receipt.content_hash)
    if known is not None:
        raise DuplicateSurvey(known)
    return None


def _followed_road(connection: Connection, trace: Trace) -> str | None:
    best, best_share = None, 0.0
    for road_id, line in roads.lines_near(
        connection, widened(bounds_of(trace.lon, trace.lat), DEGREES_OF_NEAR)
    ):
        thinned = _thinned(line)
        if len(thinned.lon) < 2:
            continue
        offset_m = np.abs(lines.project(thinned, trace.lon, trace.lat).offset_m)
        share = float(np.mean(offset_m <= NEAR_M))
        if share > best_share:
            best, best_share = road_id, share
    return best if best_share >= LEAST_SHARE_NEAR else None


def _thinned(line: Line) -> Line:
    """Every n-th vertex and the last, so that a drive's positions may serve as a line."""
    step = -(-len(line.lon) // MOST_VERTICES)
    kept = np.unique(np.append(np.arange(0, len(line.lon), step), len(line.lon) - 1))
    return Line(line.lon[kept], line.lat[kept])


def _accepted(survey: SurveySummary, *, replayed: bool) -> Accepted:
    return Accepted(
        survey_id=survey.survey_id,
        build_id=survey.build_id,
        roads=survey.roads,
        samples=survey.samples,
        dropped=survey.dropped,
        replayed=replayed,
    )
