"""`roadprint coverage`: where to drive next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.table import Table

from app.commands.console import FAULT, USAGE, Url, err, open_target, out
from app.commands.settings import DataDir
from app.commands.target import Document, Target

PASSES = {
    "never": "never driven",
    "once": "driven once",
    "twice": "twice",
    "more": "three times and more",
}


def coverage(
    bbox: Annotated[
        str | None,
        typer.Option(metavar="W,S,E,N", help="Only what touches this box, degrees."),
    ] = None,
    version: Annotated[
        int | None, typer.Option(min=1, help="Another map version than the active one.")
    ] = None,
    out_file: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write all stretches as GeoJSON."),
    ] = None,
    url: Url = None,
    data: DataDir = None,
) -> None:
    """
    Tell how well the roads are surveyed, and on which stretches the next drive helps most.

    The file of `--out` opens in any map program: colour it by `passes` or `expected_error_m`.
    """
    if out_file is not None and not out_file.absolute().parent.is_dir():
        err.print(f"{out_file}: its folder does not exist", highlight=False, soft_wrap=True)
        raise typer.Exit(USAGE)
    with open_target(url, data) as target:
        found = _whole(target, bbox, version, pages=out_file is not None)
        if not found["summary"]["length_m"]:
            where = "touches this box" if bbox else "is known: import drives or a network first"
            err.print(f"[red]no road {where}[/]")
            raise typer.Exit(FAULT)
        for line in summary_words(found):
            out.print(line, highlight=False, soft_wrap=True)
        out.print(_table(found["summary"]["most_worth_a_drive"]))
        if out_file is not None:
            out_file.write_bytes(orjson.dumps(found))
            out.print(f"{len(found['features']):,} stretches are in {out_file}", soft_wrap=True)


def _whole(target: Target, bbox: str | None, version: int | None, *, pages: bool) -> Document:
    """The first page; with all that follow joined to it when ``pages`` is set."""
    found = target.coverage(bbox=bbox, version=version)
    cursor = found["next_cursor"]
    while pages and cursor is not None:
        page = target.coverage(bbox=bbox, version=version, cursor=cursor)
        found["features"] += page["features"]
        cursor = page["next_cursor"]
    return {**found, "next_cursor": None}


def summary_words(found: Document) -> list[str]:
    """Four lines of a `GET /v1/coverage`; shorter when nothing was driven."""
    summary = found["summary"]
    by = summary["length_m_by_passes"]
    version = found["map_version"]
    whole = "no map yet" if version is None else f"map version {version}"
    lines = [
        f"{whole}: {_km(summary['length_m'])} of road",
        ", ".join(f"{words} {_km(by[name])}" for name, words in PASSES.items()),
    ]
    if by["unknown"]:
        lines.append(
            f"built before coverage was kept: {_km(by['unknown'])}; build again to have it"
        )
    if summary["both_directions"] is not None:
        lines.append(
            f"of what was driven: {summary['both_directions']:.0%} in both directions, "
            f"{summary['several_days']:.0%} on two days or more"
        )
    error = summary["expected_error_m"]
    if error["p50"] is not None:
        lines.append(
            f"expected error of {found['window_m']:.0f} m windows: {error['p50']:.0f} m at half of "
            f"the driven length, more than {error['p90']:.0f} m at a tenth"
        )
    return lines


def _table(worth: list[Document]) -> Table:
    """The stretches most worth a drive, the best first."""
    if not worth:
        return Table(title="no stretch is worth another drive", title_justify="left")
    table = Table(title="where the next drive helps most", title_justify="left")
    for name in ("road", "from m", "to m", "expected error", "why"):
        table.add_column(name, justify="left" if name in {"road", "why"} else "right")
    for one in worth:
        error_m = one["expected_error_m"]
        table.add_row(
            one["road_id"],
            f"{one['start_m']:.0f}",
            f"{one['end_m']:.0f}",
            "" if error_m is None else f"{error_m:.0f} m",
            one["reason"],
        )
    return table


def _km(metres: float) -> str:
    return f"{metres / 1000.0:.1f} km"
