"""`roadprint simulate`: a simulated city's drives as files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from app.commands.console import USAGE, err, out
from app.evaluation.dataset import write_dataset
from app.evaluation.scenario import PRESETS, build_city, preset
from app.evaluation.simulated import city_passes


def simulate(
    folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the data set; made when absent.")
    ],
    scenario: Annotated[str, typer.Option(help=f"One of {', '.join(PRESETS)}.")] = "paper",
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same files.")] = 0,
    cells: Annotated[int | None, typer.Option(min=1, help="How many cells transmit.")] = None,
    roads: Annotated[int | None, typer.Option(min=1, help="How many roads the city has.")] = None,
    survey_passes: Annotated[int | None, typer.Option(min=1, help="Passes over each road.")] = None,
) -> None:
    """
    Simulate a city and write its survey, and test drives both ways over every road.

    The folder has the layout that `roadprint import` reads: roads.geojson, passes_index.csv and
    passes.csv.gz.
    """
    try:
        named = preset(scenario)
        chosen = replace(
            named,
            cells=cells or named.cells,
            roads=roads or named.roads,
            survey_passes=survey_passes or named.survey_passes,
        )
    except ValueError as error:
        err.print(str(error))
        raise typer.Exit(USAGE) from None
    city = build_city(chosen, seed)
    write_dataset(folder, (truth.road for truth in city.roads), city_passes(city))
    out.print(f"{scenario}, seed {seed}: {len(city.roads)} roads, {len(city.layout.sites)} cells")
    out.print(f"next: roadprint import {folder} --data DIR", soft_wrap=True)
