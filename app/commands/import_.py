"""`roadprint import`: survey files in, a map out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from app.commands.console import (
    FAULT,
    USAGE,
    Url,
    conclude,
    err,
    follow_build,
    open_target,
    out,
    progress_bar,
)
from app.commands.intake import Intake, take_in
from app.commands.settings import DataDir
from app.evaluation.dataset import is_dataset


def import_(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...",
            help="Data set folders (roads.geojson, passes_index.csv, passes.csv.gz), tidy CSV "
            "files (time_s,lon,lat,cell_id,rsrp_dbm) or survey JSON files.",
        ),
    ],
    road_id: Annotated[
        str | None, typer.Option(help="The road that a CSV or JSON file was driven on.")
    ] = None,
    url: Url = None,
    data: DataDir = None,
    *,
    build: Annotated[bool, typer.Option(help="Build the map when all is in.")] = True,
) -> None:
    """
    Import surveys, build the map and tell what became of every pass and row.

    Only survey passes of a data set are taken in; its test passes stay for testing. Importing the
    same files again changes nothing.
    """
    for path in paths:
        if not path.exists() or (path.is_dir() and not is_dataset(path)):
            missing = "no such file" if not path.exists() else "not a data set folder"
            err.print(f"{path}: {missing}", highlight=False, soft_wrap=True)
            raise typer.Exit(USAGE)
    intake = Intake()
    with open_target(url, data) as target:
        with progress_bar("passes") as bar:
            for path in paths:
                take_in(target, path, road_id, intake, bar)
        out.print(_account(intake))
        if not intake.stored:
            err.print("[red]no survey was taken in[/]")
            raise typer.Exit(FAULT)
        if build:
            conclude(follow_build(target, target.request_build(sorted(intake.roads) or None)))
    if intake.refused:
        raise typer.Exit(FAULT)


def _account(intake: Intake) -> Table:
    """What became of everything that was read."""
    table = Table(title="import", title_justify="left", show_header=False)
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
    table.add_row("rows read", f"{intake.account.rows:,}")
    table.add_row("samples read", f"{intake.account.samples:,}")
    for reason, rows in intake.account.dropped.most_common():
        table.add_row(f"rows dropped: {reason}", f"{rows:,}")
    return table
