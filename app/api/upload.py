"""Survey tools' files as request bodies: found out by content, read, and stored drive by drive."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from sqlalchemy.engine import Engine

from app.api.content import CSV, JSON, KML
from app.api.csv_survey import REQUIRED
from app.api.errors import Refusal
from app.api.surveys import Described
from app.domain import Trace
from app.errors import DuplicateSurvey, Fault, InvalidInput
from app.formats.account import Account, WrongFile
from app.formats.assemble import Drive
from app.formats.options import Options
from app.formats.read import read_drives
from app.formats.sniff import (
    GEOSUBMIT,
    GNETTRACK_KML,
    NETWORK_SURVEY_JSON,
    SURVEY_JSON,
    TIDY,
    Sniffed,
    sniff,
)
from app.services.ingest import Accepted, accept_survey
from app.services.surveys import get_survey
from app.services.swapped import SwappedPlaces, refuse_swapped_drives

HEAD_BYTES = 4096  # our own JSON names its columns in the first of them, or it is not our own
OURS = (b'"cells"', b'"time_s"', b'"rsrp_dbm"')
JSON_FORMATS = {GEOSUBMIT, NETWORK_SURVEY_JSON, SURVEY_JSON}
THEIRS = (b'"items"', b'"messageType"')


@dataclass(frozen=True, slots=True)
class Upload:
    """
    A file as it was posted.

    Attributes:
        format: Asked for in the query; None: found by content.
        zone: Of times that are written without one.
        keep_going: Take the sound rows of a broken file.
    """

    media_type: str
    raw: bytes
    described: Described
    format: str | None
    zone: str
    keep_going: bool


def is_own(upload: Upload) -> bool:
    """
    Whether a body is a survey of our own making, JSON or CSV, to be read strictly.

    What is neither ours nor any tool's counts as ours, so that its faults are named one by one.
    """
    if upload.format is not None:
        return upload.format == SURVEY_JSON
    if upload.media_type == JSON:
        head = upload.raw[:HEAD_BYTES]
        return any(name in head for name in OURS) or not any(name in head for name in THEIRS)
    if upload.media_type != CSV:
        return False
    try:
        found = sniff(io.BytesIO(upload.raw))
    except WrongFile:
        return True
    return found.name == TIDY and found.layout is not None and REQUIRED[0] in found.layout.names


def drives_of(upload: Upload, account: Account) -> list[Drive]:
    """
    The drives in a tool's file, as the query describes them.

    Raises:
        InvalidInput: It is no such file, it is broken, or the query contradicts it.
        Refusal: It is JSON under another media type.
    """
    source = io.BytesIO(upload.raw)
    sniffed = sniff(source, GNETTRACK_KML if upload.media_type == KML else upload.format)
    if sniffed.name in JSON_FORMATS and upload.media_type != JSON:
        detail = f"the body is JSON and claims to be {upload.media_type}"
        raise Refusal(415, "unsupported-media-type", detail, {"Accept": JSON})
    options = Options(zone=zone_of(upload.zone), device=upload.described.device)
    return read_all(source, sniffed, options, account, upload.described, upload.keep_going)


def read_all(
    source: io.BytesIO,
    sniffed: Sniffed,
    options: Options,
    account: Account,
    described: Described,
    keep_going: bool,  # noqa: FBT001 - one of the caller's own options
) -> list[Drive]:
    """
    Every drive, with what the query says of them; nothing is stored while a file may be broken.

    Raises:
        InvalidInput: The file is wrong or broken, or the query contradicts it.
    """
    drives = read_drives(source, sniffed, options, account, keep_going=keep_going)
    return [replace(drive, trace=_described(drive.trace, described)) for drive in drives]


def _described(trace: Trace, described: Described) -> Trace:
    if described.radio is not None:
        raise InvalidInput([Fault("/radio", "the file's own rows say which radio they measured")])
    if described.recorded_at is not None and trace.recorded_at is not None:
        raise InvalidInput(
            [Fault("/recorded_at", f"the file says {trace.recorded_at.isoformat()}")]
        )
    reference = described.reference_cell
    if reference is not None and reference not in trace.cells:
        raise InvalidInput([Fault("/reference_cell", f"{reference!r} is in no row of a drive")])
    return replace(
        trace,
        road_id=described.road_id,
        recorded_at=described.recorded_at or trace.recorded_at,
        reference_cell=reference,
    )


def zone_of(name: str) -> ZoneInfo:
    """
    A time zone by name.

    Raises:
        InvalidInput: There is none of this name.
    """
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise InvalidInput([Fault("/time_zone", f"{name[:60]!r} is no time zone")]) from None


def store_drives(
    engine: Engine,
    drives: Sequence[Drive],
    account: Account,
    *,
    idempotency_key: str | None,
    build: bool,
) -> list[Accepted]:
    """
    Each drive as one survey; those that are stored already are named as they are.

    Raises:
        DuplicateSurvey: All of them are stored already.
        IdempotencyMismatch: The key belongs to a file of other content.
        SwappedPlaces: One of them makes sense only with longitude and latitude exchanged.
    """
    try:
        refuse_swapped_drives(engine, [drive.trace for drive in drives])
    except SwappedPlaces as error:
        line = drives[error.drive].line
        error.faults = [Fault(f"/lines/{line}", f"line {line}: {error.detail}")]
        raise
    several, known = [], []
    for number, drive in enumerate(drives):
        key = (
            idempotency_key if not number or not idempotency_key else f"{idempotency_key}/{number}"
        )
        dropped = account.dropped if len(drives) == 1 else drive.dropped
        try:
            several.append(
                accept_survey(
                    engine, drive.trace, idempotency_key=key, build=build, dropped=dropped
                )
            )
        except DuplicateSurvey as duplicate:
            known.append(duplicate)
            several.append(_stored(engine, duplicate.survey_id))
    if len(known) == len(drives):
        raise known[0]
    return several


def _stored(engine: Engine, survey_id: str) -> Accepted:
    survey = get_survey(engine, survey_id)
    return Accepted(
        survey_id=survey_id,
        build_id=survey.build_id,
        roads=survey.roads,
        samples=survey.samples,
        dropped=survey.dropped,
        replayed=True,
    )
