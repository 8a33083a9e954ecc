"""Surveys: traces as one row each, with their samples as four blobs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from app.domain import Trace
from app.store.bounds import bounds_of
from app.store.columns import F4, F8, new_id, pack, unpack, utc_now
from app.store.records import Page, Placing, SurveySummary
from app.store.tables import passes, surveys

SUMMARY = [column for column in surveys.c if not isinstance(column.type, sa.LargeBinary)]


@dataclass(frozen=True, slots=True)
class PassRange:
    """Samples ``first_sample:end_sample`` of a survey run along a road."""

    road_id: str
    first_sample: int
    end_sample: int


@dataclass(frozen=True, slots=True)
class Receipt:
    """What came with a trace: its key, the hash of its content, readings dropped by reason."""

    idempotency_key: str | None
    content_hash: str
    dropped: Mapping[str, int]


def content_hash(trace: Trace) -> str:
    """
    SHA-256 of what a survey says: samples, cells, road, device and time of recording.

    The order of the cells is no content; the device and the time are, because two passes of a
    noiseless simulation may agree in every sample and still be two passes.
    """
    order = sorted(range(len(trace.cells)), key=trace.cells.__getitem__)
    rsrp_dbm = np.asarray(trace.rsrp_dbm, dtype=np.float32)[:, order]
    rsrp_dbm = np.where(np.isnan(rsrp_dbm), np.float32(np.nan), rsrp_dbm)  # one bit pattern of NaN
    recorded_at = trace.recorded_at.timestamp() if trace.recorded_at else None
    words = (trace.road_id, trace.device, recorded_at, trace.reference_cell, sorted(trace.cells))
    digest = hashlib.sha256(repr(words).encode())
    for numbers in (trace.time_s, trace.lon, trace.lat):
        digest.update(pack(numbers, F8))
    digest.update(pack(rsrp_dbm, F4))
    return digest.hexdigest()


def insert_survey(
    connection: Connection,
    trace: Trace,
    along: Sequence[PassRange],
    receipt: Receipt,
    placing: Placing = "given",
) -> str:
    """Store a trace and the roads it runs along, as far as they are known; the survey's id."""
    survey_id = new_id()
    box = bounds_of(trace.lon, trace.lat)
    connection.execute(
        surveys.insert().values(
            survey_id=survey_id,
            content_hash=receipt.content_hash,
            idempotency_key=receipt.idempotency_key,
            received_at=utc_now(),
            recorded_at=trace.recorded_at,
            device=trace.device,
            reference_cell=trace.reference_cell,
            placing=placing,
            west=box.west,
            south=box.south,
            east=box.east,
            north=box.north,
            sample_count=len(trace.time_s),
            cell_count=len(trace.cells),
            cells=list(trace.cells),
            dropped=dict(receipt.dropped),
            global_ids=dict(trace.global_ids),
            time_s=pack(trace.time_s, F8),
            lon=pack(trace.lon, F8),
            lat=pack(trace.lat, F8),
            rsrp_dbm=pack(trace.rsrp_dbm, F4),
        )
    )
    insert_passes(connection, survey_id, along)
    return survey_id


def insert_passes(connection: Connection, survey_id: str, along: Sequence[PassRange]) -> None:
    """Say which samples of a survey run along which roads."""
    rows = [
        {
            "survey_id": survey_id,
            "position": position,
            "road_id": piece.road_id,
            "first_sample": piece.first_sample,
            "end_sample": piece.end_sample,
        }
        for position, piece in enumerate(along)
    ]
    if rows:
        connection.execute(passes.insert(), rows)


def name_build(connection: Connection, survey_id: str, build_id: str) -> None:
    """Remember which build takes the survey in, for whoever posts it again."""
    connection.execute(
        surveys.update().where(surveys.c.survey_id == survey_id).values(build_id=build_id)
    )


def find_by_hash(connection: Connection, digest: str) -> str | None:
    """Id of the survey with this content."""
    return connection.scalar(sa.select(surveys.c.survey_id).where(surveys.c.content_hash == digest))


def find_by_key(connection: Connection, key: str) -> tuple[str, str] | None:
    """Id and content hash of the survey that came with this idempotency key."""
    found = connection.execute(
        sa.select(surveys.c.survey_id, surveys.c.content_hash).where(
            surveys.c.idempotency_key == key
        )
    ).one_or_none()
    return (found.survey_id, found.content_hash) if found else None


def select_summary(connection: Connection, survey_id: str) -> SurveySummary | None:
    """One survey without its samples."""
    row = connection.execute(
        sa.select(*SUMMARY).where(surveys.c.survey_id == survey_id)
    ).one_or_none()
    return _summaries(connection, [row])[0] if row else None


def select_page(
    connection: Connection, *, road_id: str | None, limit: int, after: str | None
) -> Page[SurveySummary]:
    """Surveys in the order of their arrival (ids sort by time), after the survey ``after``."""
    query = sa.select(*SUMMARY).order_by(surveys.c.survey_id).limit(limit + 1)
    if after is not None:
        query = query.where(surveys.c.survey_id > after)
    if road_id is not None:
        on_road = sa.select(passes.c.survey_id).where(passes.c.road_id == road_id)
        query = query.where(surveys.c.survey_id.in_(on_road))
    rows = connection.execute(query).all()
    items = tuple(_summaries(connection, rows[:limit]))
    return Page(items, items[-1].survey_id if len(rows) > limit else None)


def select_trace(connection: Connection, survey_id: str) -> Trace | None:
    """A survey as it was posted (the road it names is the first it runs along, if any)."""
    row = connection.execute(
        sa.select(surveys, passes.c.road_id)
        .outerjoin(passes, passes.c.survey_id == surveys.c.survey_id)
        .where(surveys.c.survey_id == survey_id)
        .order_by(passes.c.position)
        .limit(1)
    ).one_or_none()
    return _trace(row, slice(None)) if row else None


def select_passes(connection: Connection, road_id: str) -> list[Trace]:
    """Every pass along a road, in the order of arrival."""
    rows = connection.execute(
        sa.select(surveys, passes.c.road_id, passes.c.first_sample, passes.c.end_sample)
        .join(passes, passes.c.survey_id == surveys.c.survey_id)
        .where(passes.c.road_id == road_id)
        .order_by(passes.c.survey_id, passes.c.position)
    )
    return [_trace(row, slice(row.first_sample, row.end_sample)) for row in rows]


def delete(connection: Connection, survey_id: str) -> list[str] | None:
    """Forget a survey; the roads it ran along, or None when there was no such survey."""
    roads = connection.scalars(
        sa.select(passes.c.road_id).where(passes.c.survey_id == survey_id).distinct()
    ).all()
    gone = connection.execute(surveys.delete().where(surveys.c.survey_id == survey_id))
    return sorted(roads) if gone.rowcount else None


def _trace(row: Row[tuple[object, ...]], part: slice) -> Trace:
    stored = row._mapping  # noqa: SLF001 - the documented way to read a row by name
    return Trace(
        cells=tuple(stored["cells"]),
        time_s=unpack(stored["time_s"], F8)[part],
        lon=unpack(stored["lon"], F8)[part],
        lat=unpack(stored["lat"], F8)[part],
        rsrp_dbm=unpack(stored["rsrp_dbm"], F4, stored["sample_count"], stored["cell_count"])[part],
        road_id=stored["road_id"],
        device=stored["device"],
        recorded_at=stored["recorded_at"],
        reference_cell=stored["reference_cell"],
        global_ids=stored["global_ids"],
    )


def _summaries(
    connection: Connection, rows: Sequence[Row[tuple[object, ...]]]
) -> list[SurveySummary]:
    ids = [row.survey_id for row in rows]
    along: dict[str, list[str]] = {survey_id: [] for survey_id in ids}
    for survey_id, road_id in connection.execute(
        sa.select(passes.c.survey_id, passes.c.road_id)
        .where(passes.c.survey_id.in_(ids))
        .order_by(passes.c.survey_id, passes.c.position)
    ):
        if road_id not in along[survey_id]:
            along[survey_id].append(road_id)
    return [
        SurveySummary(
            survey_id=row.survey_id,
            roads=tuple(along[row.survey_id]),
            device=row.device,
            recorded_at=row.recorded_at,
            received_at=row.received_at,
            reference_cell=row.reference_cell,
            cells=tuple(row.cells),
            samples=row.sample_count,
            dropped=dict(row.dropped),
            build_id=row.build_id,
        )
        for row in rows
    ]
