"""Reading survey files of any format that is known and storing what they hold, drive by drive."""

from __future__ import annotations

import csv
import hashlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote

import orjson
from rich.progress import Progress

from app.commands.spool import Spool
from app.commands.target import Document, Refused, Target, survey_document
from app.domain import Trace
from app.errors import DuplicateSurvey
from app.evaluation.dataset import is_dataset, read_index, read_roads, stream_passes
from app.formats.account import Account, WrongFile
from app.formats.options import Options
from app.formats.read import read_drives
from app.formats.sniff import SURVEY_JSON, Sniffed, sniff
from app.formats.source import open_source

DRIVES, DRIVES_INDEX = "drives.csv.gz", "drives_index.csv"


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the person at the console said of the files."""

    options: Options = field(default_factory=Options)
    road_id: str | None = None
    format: str | None = None
    keep_going: bool = False
    include_tests: bool = False


@dataclass(slots=True)
class Intake:
    """
    What an import has done so far.

    ``refused`` holds a sentence a drive, by reason; ``broken`` one a file of which nothing was
    stored.
    """

    passes: int = 0
    posted: int = 0
    replayed: int = 0
    skipped: int = 0
    roads: set[str] = field(default_factory=set)
    refused: defaultdict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    broken: list[str] = field(default_factory=list)
    formats: list[str] = field(default_factory=list)
    global_ids: dict[str, str] = field(default_factory=dict)
    account: Account = field(default_factory=Account)

    @property
    def stored(self) -> int:
        """Surveys that are in the store now, by this import or an earlier one."""
        return self.posted + self.replayed

    def refuse(self, name: str, code: str, detail: str) -> None:
        """Count a drive that was not taken."""
        self.refused[code].append(f"{name}: {detail[:300]}")


def is_folder_of_drives(folder: Path) -> bool:
    """Whether a folder holds whole drives, with or without passes along roads."""
    return (folder / DRIVES).is_file()


def take_in(target: Target, path: Path, wishes: Wishes, intake: Intake, bar: Progress) -> None:
    """
    Store everything that one path holds; a wrong file is noted in ``intake.broken``.

    Raises:
        BadDataset, BadTable: A data set folder is broken; what was stored before stays stored.
    """
    if path.is_dir() and is_dataset(path):
        _take_dataset(target, path, intake, bar)
        return
    file = path / DRIVES if path.is_dir() else path
    account = Account()
    try:
        with open_source(file) as (source, raw):
            sniffed = sniff(source, wishes.format)
            intake.formats.append(f"{file.name}: {sniffed.name}")
            if sniffed.name == SURVEY_JSON:
                _take_json(target, file, source, wishes.road_id, intake)
            else:
                reading = _Reading(file, source, raw, sniffed, account, bar)
                _take_drives(target, reading, wishes, intake)
    except WrongFile as error:
        intake.broken.append(f"{file}: {error}")
    intake.account.merge(account)


@dataclass(frozen=True, slots=True)
class _Reading:
    """A file that is being read."""

    file: Path
    source: BinaryIO
    raw: BinaryIO
    sniffed: Sniffed
    account: Account
    bar: Progress
    lines: dict[str, int] = field(default_factory=dict)  # of each drive's first sample, by its name


def _take_drives(target: Target, reading: _Reading, wishes: Wishes, intake: Intake) -> None:
    """
    Every drive of a file as one survey.

    Nothing is stored before the whole file is read, because it may turn out to be broken; a file
    whose good part is wanted anyhow is stored as it is read.
    """
    tests = set() if wishes.include_tests else _test_drives(reading.file)
    if wishes.keep_going:
        for name, trace in _traces(reading, wishes, tests, intake):
            _post_trace(target, name, trace, intake, reading.lines[name])
        return
    with Spool() as spool:
        for name, trace in _traces(reading, wishes, tests, intake):
            spool.put(name, trace)
        for name, trace in spool.drain():
            trace = replace(trace, road_id=wishes.road_id)  # noqa: PLW2901 - the same, named
            _post_trace(target, name, trace, intake, reading.lines[name])


def _traces(
    reading: _Reading, wishes: Wishes, tests: set[str], intake: Intake
) -> Iterator[tuple[str, Trace]]:
    """The drives that are wanted, with the progress shown in bytes of the file."""
    size = reading.file.stat().st_size
    task = reading.bar.add_task(reading.file.name, total=size)

    def show() -> None:
        reading.bar.update(task, completed=min(reading.raw.tell(), size))

    drives = read_drives(
        reading.source,
        reading.sniffed,
        wishes.options,
        reading.account,
        keep_going=wishes.keep_going,
        after_block=show,
    )
    skipped = 0
    for drive in drives:
        if drive.name.rsplit("/", 1)[0] in tests or drive.name in tests:
            skipped += 1
            continue
        intake.passes += 1
        intake.global_ids.update(drive.trace.global_ids)
        name = f"{reading.file.name}/{drive.name}"
        reading.lines[name] = drive.line
        yield name, replace(drive.trace, road_id=wishes.road_id)
    intake.skipped += skipped
    if skipped:
        reading.account.note(
            f"test drives of {DRIVES_INDEX} left out (--include-tests takes them in)", skipped
        )
    reading.bar.update(task, completed=size)


def _test_drives(file: Path) -> set[str]:
    """Drives that the index beside a file keeps back for testing; none when there is no index."""
    index = file.parent / DRIVES_INDEX
    if not index.is_file():
        return set()
    with index.open(encoding="utf-8-sig", newline="") as lines:
        return {
            row["trace_id"]
            for row in csv.DictReader(lines)
            if row.get("role") == "test" and row.get("trace_id")
        }


def _take_dataset(target: Target, folder: Path, intake: Intake, bar: Progress) -> None:
    """Roads first, then the survey passes; the index says which those are."""
    index = read_index(folder)
    surveys = sum(entry.role == "survey" for entry in index.values())
    used = {entry.road_id for entry in index.values() if entry.role == "survey"}
    for road in read_roads(folder):
        if road.road_id in used:
            target.put_road(road)
    task = bar.add_task(f"{folder.name} (passes)", total=surveys)
    for each in stream_passes(folder, intake.account):
        intake.passes += 1
        entry = index.get(each.pass_id)
        if entry is None:
            intake.refuse(each.pass_id, "not-in-index", "the index does not name this pass")
        elif entry.role != "survey":
            intake.skipped += 1
        else:
            trace = replace(each.trace, road_id=entry.road_id)
            key = f"{folder.resolve().name}/{each.pass_id}"
            _post(target, survey_document(trace), key, intake)
            bar.advance(task)


def _take_json(
    target: Target, path: Path, source: BinaryIO, road_id: str | None, intake: Intake
) -> None:
    """A survey as ``POST /v1/surveys`` takes it."""
    intake.passes += 1
    try:
        document: Document | list[object] = orjson.loads(source.read())
    except orjson.JSONDecodeError as error:
        raise WrongFile(f"no JSON: {error}") from error
    if not isinstance(document, dict):
        raise WrongFile("a survey in JSON is one object")
    if road_id is not None:
        document["road_id"] = road_id
    samples = document.get("time_s")
    intake.account.samples += len(samples) if isinstance(samples, list) else 0
    _post(target, document, path.name, intake)


def _post(target: Target, document: Document, name: str, intake: Intake) -> None:
    digest = hashlib.sha256(orjson.dumps(document, option=orjson.OPT_SORT_KEYS)).hexdigest()
    try:
        posted = target.post_survey(document, _key(name, digest))
    except Refused as refusal:
        _refused(refusal, name, intake)
    else:
        _stored(intake, posted.roads, replayed=posted.replayed)


def _post_trace(target: Target, name: str, trace: Trace, intake: Intake, line: int) -> None:
    digest = hashlib.sha256(repr((trace.cells, trace.device, trace.recorded_at)).encode())
    digest.update(repr(trace.road_id).encode())
    for numbers in (trace.time_s, trace.lon, trace.lat, trace.rsrp_dbm):
        digest.update(numbers.tobytes())
    try:
        posted = target.post_trace(trace, _key(name, digest.hexdigest()))
    except Refused as refusal:
        _refused(refusal, f"{name} (from line {line})", intake)
    else:
        _stored(intake, posted.roads, replayed=posted.replayed)


def _refused(refusal: Refused, name: str, intake: Intake) -> None:
    """A refusal is counted and the import goes on; a survey that is there already is no refusal."""
    if refusal.code == DuplicateSurvey.code:
        intake.replayed += 1
    else:
        intake.refuse(name, refusal.code, refusal.detail)


def _stored(intake: Intake, roads: tuple[str, ...], *, replayed: bool) -> None:
    intake.roads.update(roads)
    if replayed:
        intake.replayed += 1
    else:
        intake.posted += 1


def _key(name: str, digest: str) -> str:
    """
    The same for the same drive of the same file, so that importing again is answered, not stored.

    The content is part of it: a corrected file is a new survey, not a contradiction.
    """
    return f"{quote(name)[-120:]}-{digest[:32]}"
