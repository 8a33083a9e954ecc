"""`roadprint locate`: where a vehicle's last metres ended."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import orjson
import typer
from rich.table import Table

from app.commands.console import Url, open_target, out, reported
from app.commands.explain import explanation_tables
from app.commands.settings import DataDir
from app.commands.target import Document, Target, window_document
from app.domain import Trace, Window
from app.evaluation.tidy import BadTable, read_passes
from app.formats.account import Account
from app.numerics.geodesy import Floats, distance_m

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
        float, typer.Option(help="How much of a drive is a window, metres.")
    ] = TAIL_M,
    url: Url = None,
    data: DataDir = None,
    *,
    track: Annotated[
        bool,
        typer.Option("--track", help="Follow a CSV drive window by window, not its end alone."),
    ] = False,
    distance_error: Annotated[
        float | None,
        typer.Option(
            help="Share by which the way may be told too long or too short (one standard "
            "deviation): 0.01 = good to 1 %, 0 = exact. Unsaid: unknown, or as in the JSON.",
        ),
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say why: what decided, and what the runner-up was.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the answer as it came.")] = False,
) -> None:
    """
    Locate one window and print where its last sample was.

    The way of a CSV drive is measured along its own positions; nothing else is taken from them.
    With --track the whole drive is followed, each window in the light of those before it.
    With --explain tables tell what separated the (last) answer from its runner-up.
    """
    with reported():
        documents = _read_drive(file, length_m) if track else [_read_window(file, length_m)]
    if distance_error is not None:
        documents = [{**document, "distance_error": distance_error} for document in documents]
    if explain:
        documents = [{**document, "explain": True} for document in documents]
    with open_target(url, data) as target:
        fixes = _follow(target, documents) if track else [target.locate(documents[0])]
    if json:
        answer = fixes if track else fixes[0]
        typer.echo(orjson.dumps(answer, option=orjson.OPT_INDENT_2).decode())
    else:
        out.print(_tracked_table(fixes) if track else _table(fixes[0]))
        if explain:  # of a followed drive, the last window
            out.print(explanation_tables(fixes[-1]["explanation"]))


def _follow(target: Target, documents: Sequence[Document]) -> list[Document]:
    fixes: list[Document] = []
    for document in documents:
        state = fixes[-1]["state"] if fixes else None
        fixes.append(target.locate({**document, "state": state}))
    return fixes


def _read_window(file: Path, length_m: float) -> Document:
    text = file.read_text(encoding="utf-8-sig")
    if text.lstrip().startswith("{"):
        try:
            document: Document = orjson.loads(text)
        except orjson.JSONDecodeError as error:
            raise BadTable(f"{file}: no JSON: {error}") from error
        return document
    trace = _last_drive(file, text)
    way_m = _way_m(trace)
    return _document(trace, way_m, float(way_m[-1]), length_m)


def _read_drive(file: Path, length_m: float) -> list[Document]:
    """A drive's windows back to back, their `distance_m` running on as one odometer."""
    trace = _last_drive(file, file.read_text(encoding="utf-8-sig"))
    way_m = _way_m(trace)
    ends_m = np.arange(length_m, way_m[-1] + 1e-6, length_m)
    return [_document(trace, way_m, end_m, length_m) for end_m in ends_m.tolist() or [way_m[-1]]]


def _last_drive(file: Path, text: str) -> Trace:
    last = None
    for each in read_passes(text.splitlines(), Account()):
        last = each
    if last is None:
        raise BadTable(f"{file}: no row of it is a reading")
    return last.trace


def _way_m(trace: Trace) -> Floats:
    """The way so far, measured along the positions."""
    steps_m = distance_m(trace.lon[:-1], trace.lat[:-1], trace.lon[1:], trace.lat[1:])
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def _document(trace: Trace, way_m: Floats, end_m: float, length_m: float) -> Document:
    """The window of the last ``length_m`` before ``end_m``."""
    last = max(int(np.searchsorted(way_m, end_m + 1e-6)), 1)
    first = min(int(np.searchsorted(way_m, end_m - length_m)), last - 1)
    part = slice(first, last)
    return window_document(Window(trace.cells, way_m[part], trace.rsrp_dbm[part].astype(float)))


def _tracked_table(fixes: Sequence[Document]) -> Table:
    table = Table("road", "probable", "chainage", "accuracy", "position", "off the map")
    for fix in fixes:
        place, off_map = fix["position"], f"{fix['off_map_posterior']:.3f}"
        if place is None:
            table.add_row("-", "", "", "", "", off_map)
            continue
        table.add_row(
            fix["road"]["id"],
            f"{fix['road']['posterior']:.3f}",
            f"{place['chainage_m']:.1f} m, {place['direction']}",
            f"{fix['accuracy_m']:.1f} m",
            f"{place['lat']:.6f}, {place['lon']:.6f}",
            off_map,
        )
    return table


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
