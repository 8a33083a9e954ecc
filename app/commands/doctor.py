"""`roadprint doctor`: what a data set is good for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from app.commands.console import FAULT, USAGE, err, file_bar, out
from app.commands.examine import Examined, examine
from app.commands.import_ import zone_of
from app.commands.verdicts import Verdict, jitter_words, verdicts
from app.formats.options import Options
from app.numerics.tally import Checkup

SIGNS = {"bad": ("x", "red"), "mind": ("!", "yellow"), "good": ("+", "green"), "note": ("-", "dim")}
MOST_UNREADABLE = 8


def doctor(
    paths: Annotated[
        list[Path],
        typer.Argument(metavar="PATH...", help="Files of any known format, folders, data sets."),
    ],
    time_zone: Annotated[
        str,
        typer.Option(metavar="ZONE", help="Of times written without one, such as Africa/Dakar."),
    ] = "UTC",
) -> None:
    """
    Say in words what measurements are good for, before anything is imported.

    Reads every file once and stores nothing; memory stays flat. Broken rows are left out and named.
    Ends with 0 unless there was nothing to read.
    """
    options = Options(zone=zone_of(time_zone), fast=True)
    examined = Examined()
    for path in paths:
        if not path.exists():
            err.print(f"{path}: no such file", highlight=False, soft_wrap=True)
            raise typer.Exit(USAGE)
    with file_bar(err, transient=True) as bar:
        for path in paths:
            examine(path, options, examined, bar)
    found = examined.tally.checkup()
    if found is not None:
        out.print(_table(examined, found))
        for verdict in verdicts(found, examined.account, dict(examined.roles)):
            _say(verdict)
    for sentence in examined.beside:
        out.print(f"left alone: {sentence}", highlight=False, soft_wrap=True)
    for sentence in examined.unreadable[:MOST_UNREADABLE]:
        err.print(f"[yellow]not read[/] {sentence}", highlight=False, soft_wrap=True)
    if len(examined.unreadable) > MOST_UNREADABLE:
        err.print(f"[yellow]not read[/] {len(examined.unreadable) - MOST_UNREADABLE:,} more")
    if found is None:
        err.print("[red]nothing could be read[/]: docs/formats.md has what is known")
        raise typer.Exit(FAULT)


def _say(verdict: Verdict) -> None:
    """The sentence, and what to do about it indented under it; both wrapped at words."""
    sign, colour = SIGNS[verdict.mark]
    table = Table.grid(padding=(0, 1))
    table.add_row(Text(sign, colour), Text(verdict.words))
    if verdict.advice:
        table.add_row("", Text(f"-> {verdict.advice}", "dim"))
    out.print(table)


def _table(examined: Examined, found: Checkup) -> Table:
    """The figures, a line a subject."""
    table = Table(title="what is there", title_justify="left", show_header=False)
    for name, words in _figures(examined, found):
        table.add_row(name, words)
    return table


def _figures(examined: Examined, found: Checkup) -> list[tuple[str, str]]:
    formats = [f"{name}: {n} file{'s' * (n > 1)}" for name, n in examined.formats.items()]
    roles = ", ".join(f"{count:,} {role}" for role, count in examined.roles.items())
    rows = examined.account.rows or found.readings
    pace = f"one each {found.interval_s:.1f} s at {found.speed_mps * 3.6:.0f} km/h"
    return [
        ("formats", ", ".join(formats)),
        ("drives", f"{found.drives:,}" + (f" ({roles})" if roles else "")),
        ("when", _when(found)),
        ("devices", _devices(found)),
        ("driven", _driven(found)),
        ("samples", f"{found.samples:,} of {rows:,} rows, {pace}"),
        ("positions", _positions(found)),
        ("cells", _cells(found)),
        ("RSRP", _levels(found)),
        ("left out", _dropped(examined)),
        *_ground(found),
    ]


def _driven(found: Checkup) -> str:
    return f"{found.kilometres:,.1f} km in {found.hours:,.1f} h, stood {found.standing:.0%}"


def _cells(found: Checkup) -> str:
    alone = f"{found.serving_only:.0%} of samples hear one only"
    return f"{found.cells:,} different, {found.cells_per_sample:.1f} a sample; {alone}"


def _levels(found: Checkup) -> str:
    weakest, median, strongest = found.rsrp_dbm
    steps = f"in steps of {found.rsrp_step_db:g} dB"
    return f"{weakest:.0f} to {strongest:.0f} dBm, half below {median:.0f}, {steps}"


def _ground(found: Checkup) -> list[tuple[str, str]]:
    ground = found.ground
    often = f"twice or three times {ground.few:.0%}, more often {ground.often:.0%}"
    both = f"in both directions {ground.both_ways:.0%}"
    return [
        ("ground", f"{ground.length_m / 1000:,.1f} km: driven once {ground.once:.0%}, {often}"),
        ("", f"on several days {ground.several_days:.0%}, {both}"),
    ]


def _when(found: Checkup) -> str:
    if found.first is None or found.last is None:
        return "without dates"
    first, last = f"{found.first:%Y-%m-%d}", f"{found.last:%Y-%m-%d}"
    span = first if first == last else f"{first} to {last}"
    undated = f", {found.undated:,} drives without a date" if found.undated else ""
    return f"{span}, {found.days} day{'s' * (found.days > 1)}{undated}"


def _devices(found: Checkup) -> str:
    at_once = f"; {found.overlapping:,} drives at the same time as another" * bool(
        found.overlapping
    )
    return f"{found.devices:,}{at_once}"


def _positions(found: Checkup) -> str:
    lat, lon = (f"{'more than 7' if n > 7 else n}" for n in found.decimals)
    told = [f"decimals: lat {lat}, lon {lon}"]
    if found.jitter_m is not None:
        told.append(jitter_words(found.jitter_m))
    if found.accuracy_m is not None:
        told.append(f"accuracy told {found.accuracy_m:.0f} m")
    told.append(f"{found.jumps:,} jumps")
    return ", ".join(told)


def _dropped(examined: Examined) -> str:
    dropped = examined.account.dropped.most_common()
    return ", ".join(f"{reason}: {rows:,}" for reason, rows in dropped) or "nothing"
