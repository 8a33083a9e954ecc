"""`roadprint locate`: where a vehicle's last metres ended."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import orjson
import typer
from rich.table import Table

from app.commands.console import Url, open_target, out, reported
from app.commands.settings import DataDir
from app.commands.target import Document, window_document
from app.domain import Trace, Window
from app.evaluation.tidy import Account, BadTable, read_passes
from app.numerics.geodesy import distance_m

TAIL_M = 200.0


def locate(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A window as JSON (cells, distance_m, rsrp_dbm), or a tidy CSV of a drive.",
            exists=True,
            dir_okay=False,
        ),
    ],
    length_m: Annotated[
        float, typer.Option(help="How much of a drive's end is the window, metres.")
    ] = TAIL_M,
    url: Url = None,
    data: DataDir = None,
    *,
    json: Annotated[bool, typer.Option("--json", help="Print the answer as it came.")] = False,
) -> None:
    """
    Locate one window and print where its last sample was.

    The way of a CSV drive is measured along its own positions; nothing else is taken from them.
    """
    with reported():
        document = _read_window(file, length_m)
    with open_target(url, data) as target:
        fix = target.locate(document)
    if json:
        typer.echo(orjson.dumps(fix, option=orjson.OPT_INDENT_2).decode())
    else:
        out.print(_table(fix))


def _read_window(file: Path, length_m: float) -> Document:
    text = file.read_text(encoding="utf-8-sig")
    if text.lstrip().startswith("{"):
        try:
            document: Document = orjson.loads(text)
        except orjson.JSONDecodeError as error:
            raise BadTable(f"{file}: no JSON: {error}") from error
        return document
    last = None
    for each in read_passes(text.splitlines(), Account()):
        last = each
    if last is None:
        raise BadTable(f"{file}: no row of it is a reading")
    return window_document(_tail(last.trace, length_m))


def _tail(trace: Trace, length_m: float) -> Window:
    """The last metres of a drive, its way measured along its positions."""
    steps_m = distance_m(trace.lon[:-1], trace.lat[:-1], trace.lon[1:], trace.lat[1:])
    way_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    part = slice(int(np.searchsorted(way_m, way_m[-1] - length_m)), None)
    return Window(trace.cells, way_m[part] - way_m[part][0], trace.rsrp_dbm[part].astype(float))


def _table(fix: Document) -> Table:
    table = Table(show_header=False)
    table.add_row("status", f"{fix['status']} (map version {fix['map_version']})")
    if fix["position"] is not None:
        place, road, segment = fix["position"], fix["road"], fix["segment"]
        table.add_row("road", f"{road['id']} ({road['posterior']:.3f})")
        stretch = f"{segment['start_m']:.0f}-{segment['end_m']:.0f} m"
        table.add_row("sub-segment", f"{segment['index']}: {stretch} ({segment['posterior']:.3f})")
        table.add_row("position", f"{place['lat']:.6f}, {place['lon']:.6f}")
        table.add_row("chainage", f"{place['chainage_m']:.1f} m, {place['direction']}")
        table.add_row("heading", f"{place['heading_deg']:.0f} degrees")
        table.add_row("accuracy", f"{fix['accuracy_m']:.1f} m at {fix['confidence']:.0%}")
    table.add_row("off the map", f"{fix['off_map_posterior']:.3f}")
    table.add_row("used", f"{fix['samples_used']} samples, {fix['cells_used']} cells")
    if fix["cells_unknown"]:
        table.add_row("unknown cells", ", ".join(fix["cells_unknown"]))
    return table
