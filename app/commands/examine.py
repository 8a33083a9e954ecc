"""Reading whatever a person points at, drive by drive, for the doctor: nothing is stored."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rich.progress import Progress

from app.api.surveys import Described, trace_of_json
from app.commands.intake import DRIVES, DRIVES_INDEX
from app.errors import RoadprintError
from app.evaluation.dataset import INDEX, PASSES, is_dataset, read_index, stream_passes
from app.formats.account import Account, WrongFile
from app.formats.options import Options
from app.formats.read import read_drives
from app.formats.sniff import SURVEY_JSON, sniff
from app.formats.source import open_source
from app.numerics.tally import Tally

NO_MEASUREMENTS = (".md", ".png", ".jpg", ".pdf", ".py", ".html", ".geojson")  # known by name


@dataclass(slots=True)
class Examined:
    """
    What was read.

    Attributes:
        formats: Files by format.
        roles: Drives or passes by role, where an index says it.
        unreadable: A sentence a file that is none, or of which nothing came.
        beside: Files that were left alone because another one holds the same drives.
    """

    tally: Tally = field(default_factory=Tally)
    account: Account = field(default_factory=Account)
    formats: Counter[str] = field(default_factory=Counter)
    roles: Counter[str] = field(default_factory=Counter)
    unreadable: list[str] = field(default_factory=list)
    beside: list[str] = field(default_factory=list)


def examine(path: Path, options: Options, examined: Examined, bar: Progress) -> None:
    """Everything that a file or folder holds; what cannot be read is noted, with the reason."""
    if path.is_dir() and is_dataset(path):
        _dataset(path, examined, bar)
    elif path.is_dir():
        for file in _files(path):
            _file(file, options, examined, bar)
    else:
        _file(path, options, examined, bar)


def _files(folder: Path) -> Iterator[Path]:
    """Of a folder and those in it; of data sets the measurements, not their index."""
    for file in sorted(folder.rglob("*")):
        hidden = any(part.startswith(".") for part in file.relative_to(folder).parts)
        index = file.name in {INDEX, DRIVES_INDEX}
        if file.is_file() and not hidden and not index:
            yield file


def _dataset(folder: Path, examined: Examined, bar: Progress) -> None:
    account = Account()
    try:
        roles = {name: entry.role for name, entry in read_index(folder).items()}
        task = bar.add_task(f"{folder.name} (passes)", total=len(roles))
        for each in stream_passes(folder, account):
            examined.tally.add(each.trace)
            examined.roles[roles.get(each.pass_id, "not in the index")] += 1
            bar.advance(task)
        examined.formats["data set (passes along roads)"] += 1
    except RoadprintError as error:
        examined.unreadable.append(f"{folder}: {error}")
    if (folder / DRIVES).is_file():
        examined.beside.append(f"{folder / DRIVES} (the whole drives) beside {PASSES}")
    examined.account.merge(account)


def _file(file: Path, options: Options, examined: Examined, bar: Progress) -> None:
    account = Account()
    before = examined.tally.drives
    try:
        _read(file, options, examined, bar, account)
    except (WrongFile, OSError) as error:
        worth_saying = file.suffix.lower() not in NO_MEASUREMENTS
        if worth_saying or examined.tally.drives > before:
            examined.unreadable.append(f"{file}: {error}")
    except RoadprintError as error:
        examined.unreadable.append(f"{file}: {error}")
    examined.account.merge(account)


def _read(
    file: Path, options: Options, examined: Examined, bar: Progress, account: Account
) -> None:
    with open_source(file) as (source, raw):
        sniffed = sniff(source)
        if sniffed.name == SURVEY_JSON:
            trace = trace_of_json(source.read(), Described())
            examined.tally.add(trace)
            account.samples += len(trace.time_s)
            examined.formats[sniffed.name] += 1
            return
        roles = _roles(file)
        size = file.stat().st_size
        task = bar.add_task(file.name, total=size)

        def show() -> None:
            bar.update(task, completed=min(raw.tell(), size))

        for drive in read_drives(
            source, sniffed, options, account, keep_going=True, after_block=show
        ):
            examined.tally.add(drive.trace, drive.accuracy_m)
            role = roles.get(drive.name) or roles.get(drive.name.rsplit("/", 1)[0])
            if role:
                examined.roles[role] += 1
        examined.formats[sniffed.name] += 1
        bar.update(task, completed=size)


def _roles(file: Path) -> dict[str, str]:
    """Role of each drive by the index beside a file; empty when there is none."""
    index = file.parent / DRIVES_INDEX
    if not index.is_file():
        return {}
    with index.open(encoding="utf-8-sig", newline="") as lines:
        return {row.get("trace_id") or "": row.get("role") or "" for row in csv.DictReader(lines)}
