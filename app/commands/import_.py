"""`roadprint import`: survey files in, a map out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import typer
from rich.table import Table

from app.commands.console import (
    FAULT,
    USAGE,
    Url,
    conclude,
    err,
    file_bar,
    follow_build,
    open_target,
    out,
)
from app.commands.intake import Intake, Wishes, is_folder_of_drives, take_in
from app.commands.settings import DataDir
from app.evaluation.dataset import is_dataset
from app.formats.options import Options
from app.formats.sniff import FORMATS


def import_(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...",
            help="Drive test files of any known format, gzipped or not; or data set folders.",
        ),
    ],
    road_id: Annotated[
        str | None, typer.Option(help="The road that the files were driven on.")
    ] = None,
    format_: Annotated[
        str | None,
        typer.Option("--format", metavar="NAME", help=f"Instead of looking: {', '.join(FORMATS)}."),
    ] = None,
    time_zone: Annotated[
        str,
        typer.Option(metavar="ZONE", help="Of times written without one, such as Africa/Dakar."),
    ] = "UTC",
    device: Annotated[str | None, typer.Option(help="Name of the device that measured.")] = None,
    url: Url = None,
    data: DataDir = None,
    *,
    keep_going: Annotated[
        bool, typer.Option(help="Take the sound rows of files that are broken in part.")
    ] = False,
    include_tests: Annotated[
        bool, typer.Option(help="Take the drives, too, that drives_index.csv keeps for testing.")
    ] = False,
    build: Annotated[bool, typer.Option(help="Build the map when all is in.")] = True,
) -> None:
    """
    Import drives, build the map and tell what became of every drive and row.

    The format is found by content: tidy CSV, G-NetTrack Pro (text, KML), OpenCelliD measurements,
    geosubmit, Network Survey (CSV, JSON), R&S ROMES, survey JSON. A file that is wrong, or broken
    in part, stores nothing; of a broken one `--keep-going` takes what is sound. Of data sets only
    survey drives are taken in. Importing the same files again changes nothing.
    """
    wishes = Wishes(
        options=Options(zone=zone_of(time_zone), device=device, fast=True),
        road_id=road_id,
        format=_known(format_),
        keep_going=keep_going,
        include_tests=include_tests,
    )
    for path in paths:
        _refuse_missing(path)
    intake = Intake()
    with open_target(url, data) as target:
        with file_bar(out) as bar:
            for path in paths:
                take_in(target, path, wishes, intake, bar)
        out.print(_account(intake))
        for sentence in intake.broken:
            err.print(f"[red]nothing stored of[/] {sentence}", highlight=False, soft_wrap=True)
        if not intake.stored:
            err.print("[red]no survey was taken in[/]")
            raise typer.Exit(FAULT)
        if build:
            requested = target.request_build(sorted(intake.roads) or None)
            conclude(target, follow_build(target, requested))
    if intake.refused or intake.broken:
        raise typer.Exit(FAULT)


def _refuse_missing(path: Path) -> None:
    folder = path.is_dir()
    if path.exists() and not (folder and not (is_dataset(path) or is_folder_of_drives(path))):
        return
    missing = "not a data set folder" if folder else "no such file"
    err.print(f"{path}: {missing}", highlight=False, soft_wrap=True)
    raise typer.Exit(USAGE)


def zone_of(name: str) -> ZoneInfo:
    """
    The time zone that somebody named.

    Raises:
        typer.Exit: `USAGE` when there is none of that name.
    """
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        err.print(f"--time-zone {name}: no such zone; write it as Europe/Berlin or UTC")
        raise typer.Exit(USAGE) from None


def _known(format_: str | None) -> str | None:
    if format_ is not None and format_ not in FORMATS:
        err.print(f"--format {format_}: there are {', '.join(FORMATS)}")
        raise typer.Exit(USAGE)
    return format_


def _account(intake: Intake) -> Table:
    """What became of everything that was read."""
    table = Table(title="import", title_justify="left", show_header=False)
    for sentence in intake.formats:
        table.add_row("format", sentence)
    table.add_row("passes read", f"{intake.passes:,}")
    table.add_row("surveys stored", f"{intake.posted:,}")
    if intake.replayed:
        table.add_row("stored by an earlier import", f"{intake.replayed:,}")
    if intake.skipped:
        table.add_row("test passes left out", f"{intake.skipped:,}")
    for reason, refusals in sorted(intake.refused.items()):
        table.add_row(f"[red]refused[/]: {reason}", f"{len(refusals):,}")
        for refusal in refusals[:3]:
            table.add_row("", refusal)
    _add_rows(table, intake)
    return table


def _add_rows(table: Table, intake: Intake) -> None:
    account = intake.account
    table.add_row("rows read", f"{account.rows:,}")
    table.add_row("samples read", f"{account.samples:,}")
    if intake.global_ids:
        table.add_row("cells with a global id", f"{len(intake.global_ids):,}")
    for reason, rows in account.dropped.most_common():
        places = account.places(reason)
        where = f" (line {places})" if places else ""
        table.add_row(f"rows dropped: {reason}", f"{rows:,}{where}")
    for sentence, count in account.notes.items():
        table.add_row("note", sentence if count == 1 else f"{sentence}: {count:,}")
