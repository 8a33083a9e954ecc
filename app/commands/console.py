"""How the client-side commands choose their target, show progress and report errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from app.commands.client import HttpTarget
from app.commands.local import LocalTarget
from app.commands.reliability import reliability_words
from app.commands.settings import chosen_settings
from app.commands.target import BuildView, Target
from app.errors import RoadprintError

FAULT = 1  # exit code: what was asked for could not be done
USAGE = 2  # exit code: it was asked for wrongly

Url = Annotated[
    str | None,
    typer.Option(
        "--url",
        metavar="URL",
        help="A running service, such as http://127.0.0.1:8000; else the data folder is used.",
    ),
]

out = Console()
err = Console(stderr=True)


@contextmanager
def open_target(url: str | None, data: Path | None) -> Iterator[Target]:
    """
    The service at ``url``, else the data folder; errors become a sentence and an exit code.

    Raises:
        typer.Exit: `FAULT` after any error that roadprint knows, `USAGE` when both are given.
    """
    if url is not None and data is not None:
        err.print("give --url or --data, not both: a service has its own data folder")
        raise typer.Exit(USAGE)
    with reported():
        if url is not None:
            with HttpTarget(url) as target:
                yield target
        else:
            with LocalTarget(chosen_settings(data_dir=data)) as target:
                yield target


@contextmanager
def reported() -> Iterator[None]:
    """
    Turn the errors that roadprint raises on purpose into a sentence on standard error.

    Raises:
        typer.Exit: `FAULT` after such an error.
    """
    try:
        yield
    except (RoadprintError, OSError) as error:
        err.print(f"[red]{type(error).__name__}[/]: {error}", highlight=False, soft_wrap=True)
        raise typer.Exit(FAULT) from None


def file_bar(console: Console, *, transient: bool = False) -> Progress:
    """A bar of bytes a file; a transient one is gone when all is read."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeElapsedColumn(),
        console=console,
        transient=transient,
    )


def progress_bar(unit: str) -> Progress:
    """A bar that counts ``unit``; a plain terminal or a log gets its end only."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
        console=out,
    )


def follow_build(target: Target, build: BuildView) -> BuildView:
    """Show a build until it is finished; its last state."""
    with progress_bar("roads") as bar:
        task = bar.add_task("building", total=max(build.roads_total, 1))
        for build in target.follow(build.build_id):  # noqa: B020, PLR1704 - the newest state counts
            bar.update(task, completed=build.roads_done, total=max(build.roads_total, 1))
    for line in build.failed_roads:
        err.print(f"[yellow]not built[/] {line}", highlight=False, soft_wrap=True)
    return build


def conclude(target: Target, build: BuildView) -> None:
    """
    Say how a build ended, and how far its map can be trusted.

    Raises:
        typer.Exit: `FAULT` when it was not successful.
    """
    if build.status == "successful":
        out.print(f"map version {build.map_version} is ready ({build.roads_done} roads)")
        if build.map_version is not None:
            for line in reliability_words(target.reliability(build.map_version)):
                out.print(line, highlight=False, soft_wrap=True)
        return
    reason = f": {build.problem}" if build.problem else ""
    err.print(f"[red]build {build.build_id} {build.status}[/]{reason}", soft_wrap=True)
    raise typer.Exit(FAULT)
