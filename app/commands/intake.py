"""Reading survey files of any of our layouts and storing what they hold, pass by pass."""

from __future__ import annotations

import gzip
import hashlib
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TextIO
from urllib.parse import quote

import orjson
from rich.progress import Progress

from app.commands.target import Document, Refused, Target, survey_document
from app.errors import DuplicateSurvey
from app.evaluation.dataset import read_index, read_roads, stream_passes
from app.evaluation.tidy import Account, BadTable, read_passes

JSON_BEGINS = b"{"


@dataclass(slots=True)
class Intake:
    """What an import has done so far; ``refused`` holds a sentence a pass, by reason."""

    passes: int = 0
    posted: int = 0
    replayed: int = 0
    skipped: int = 0
    roads: set[str] = field(default_factory=set)
    refused: defaultdict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    account: Account = field(default_factory=Account)

    @property
    def stored(self) -> int:
        """Surveys that are in the store now, by this import or an earlier one."""
        return self.posted + self.replayed

    def refuse(self, name: str, code: str, detail: str) -> None:
        """Count a pass that was not taken."""
        self.refused[code].append(f"{name}: {detail[:160]}")


def take_in(target: Target, path: Path, road_id: str | None, intake: Intake, bar: Progress) -> None:
    """
    Store everything that one path holds.

    Raises:
        BadDataset, BadTable: The files are broken; what was stored before stays stored.
    """
    if path.is_dir():
        _take_dataset(target, path, intake, bar)
    elif _begins_with(path, JSON_BEGINS):
        task = bar.add_task(path.name, total=1)
        _take_json(target, path, road_id, intake)
        bar.advance(task)
    else:
        task = bar.add_task(path.name, total=None)
        _take_csv(target, path, road_id, intake)
        bar.update(task, total=intake.passes, completed=intake.passes)


def _take_dataset(target: Target, folder: Path, intake: Intake, bar: Progress) -> None:
    """Roads first, then the survey passes; the index says which those are."""
    index = read_index(folder)
    surveys = sum(entry.role == "survey" for entry in index.values())
    used = {entry.road_id for entry in index.values() if entry.role == "survey"}
    for road in read_roads(folder):
        if road.road_id in used:
            target.put_road(road)
    task = bar.add_task(folder.name, total=surveys)
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


def _take_csv(target: Target, path: Path, road_id: str | None, intake: Intake) -> None:
    """A tidy table; without a ``pass_id`` column all of it is one pass."""
    with _open_text(path) as lines:
        for each in read_passes(lines, intake.account):
            intake.passes += 1
            trace = replace(each.trace, road_id=road_id)
            key = f"{path.name}/{each.pass_id}" if each.pass_id else path.name
            _post(target, survey_document(trace), key, intake)


def _take_json(target: Target, path: Path, road_id: str | None, intake: Intake) -> None:
    """A survey as ``POST /v1/surveys`` takes it."""
    intake.passes += 1
    try:
        document: Document = orjson.loads(path.read_bytes())
    except orjson.JSONDecodeError as error:
        raise BadTable(f"{path}: no JSON: {error}") from error
    if road_id is not None:
        document["road_id"] = road_id
    samples = document.get("time_s")
    intake.account.samples += len(samples) if isinstance(samples, list) else 0
    _post(target, document, path.name, intake)


def _post(target: Target, document: Document, name: str, intake: Intake) -> None:
    """Store one survey; a refusal is counted and the import goes on."""
    try:
        posted = target.post_survey(document, _key(name, document))
    except Refused as refusal:
        if refusal.code == DuplicateSurvey.code:  # it came in from elsewhere: it is there
            intake.replayed += 1
        else:
            intake.refuse(name, refusal.code, refusal.detail)
        return
    intake.roads.update(posted.roads)
    if posted.replayed:
        intake.replayed += 1
    else:
        intake.posted += 1


def _key(name: str, document: Document) -> str:
    """
    The same for the same pass of the same file, so that importing again is answered, not stored.

    The content is part of it: a corrected file is a new survey, not a contradiction.
    """
    digest = hashlib.sha256(orjson.dumps(document, option=orjson.OPT_SORT_KEYS)).hexdigest()
    return f"{quote(name)[-120:]}-{digest[:32]}"


def _begins_with(path: Path, mark: bytes) -> bool:
    with path.open("rb") as file:
        return file.read(64).lstrip().startswith(mark)


def _open_text(path: Path) -> TextIO:
    if _begins_with(path, b"\x1f\x8b"):
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open(encoding="utf-8-sig", newline="")
