"""`roadprint roads`: the network that drives are laid on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from app.commands.console import FAULT, Url, err, open_target, out, progress_bar, reported
from app.commands.networks import read_network
from app.commands.settings import DataDir

roads = typer.Typer(
    no_args_is_help=True, help="Import a network of roads, or list the roads that are known."
)


@roads.command("import")
def import_roads(
    file: Annotated[
        Path,
        typer.Argument(help="GeoJSON lines, an Overpass answer (JSON), or an extract `.osm.pbf`."),
    ],
    url: Url = None,
    data: DataDir = None,
) -> None:
    """
    Take a network of roads in; drives that name no road are laid on it by the next build.

    GeoJSON lines are roads as they are drawn (`road_id`, `id` and `name` are theirs). Ways of
    OpenStreetMap are joined to streets; only those for cars are taken. Importing again changes
    nothing.
    """
    with reported():
        network = read_network(file)
    if not network:
        err.print(f"[red]{file}[/] holds no road", soft_wrap=True)
        raise typer.Exit(FAULT)
    with open_target(url, data) as target, progress_bar("roads") as bar:
        for road in bar.track(network, description="importing"):
            target.put_road(road)
    out.print(f"{len(network)} roads are in; `roadprint build` lays the stored drives on them")


@roads.command("list")
def list_roads(url: Url = None, data: DataDir = None) -> None:
    """List the roads with their lengths, and the surveys and passes along each."""
    table = Table(title_justify="left")
    for column, side in (("road", "left"), ("name", "left"), ("metres", "right"),
                         ("surveys", "right"), ("passes in the map", "right")):  # fmt: skip
        table.add_column(column, justify="left" if side == "left" else "right")
    with open_target(url, data) as target:
        for road in target.list_roads():
            metres = "" if road.length_m is None else f"{road.length_m:.0f}"
            counts = (str(road.survey_count), str(road.pass_count))
            table.add_row(road.road_id, road.name or "", metres, *counts)
    out.print(table)
    out.print(f"{table.row_count} roads")
