"""`roadprint evaluate`: the laboratory."""

from __future__ import annotations

import importlib
import os
import time
from pathlib import Path
from types import ModuleType
from typing import Annotated, NoReturn

import typer

from app.commands.console import USAGE, err, out, progress_bar, reported
from app.evaluation.experiments.plan import (
    EXPERIMENTS,
    PAPER_SUITE,
    REAL_EXPERIMENTS,
    Ask,
    jobs,
    plan,
)
from app.evaluation.methods import METHODS
from app.evaluation.scenario import PRESETS

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def evaluate(
    folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Results; run again to resume.")
    ],
    scenario: Annotated[str | None, typer.Option(help=f"One of {', '.join(PRESETS)}.")] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Real drives instead of a scenario.")
    ] = None,
    methods: Annotated[
        str, typer.Option(help=f"Names with commas, or all: {', '.join(METHODS)}.")
    ] = "all",
    experiments: Annotated[
        str,
        typer.Option(
            help=f"Names with commas, all, or suite (the paper's): {', '.join(EXPERIMENTS)}."
        ),
    ] = "all",
    seeds: Annotated[int, typer.Option(min=1, help="Cities, or draws of windows: 0 to N-1.")] = 3,
    windows: Annotated[int, typer.Option(min=1, help="Windows a point and seed.")] = 300,
    processes: Annotated[
        int, typer.Option("--jobs", min=1, help="Processes; moves no number but delays.")
    ] = max(1, os.cpu_count() or 1),
) -> None:
    """
    Compare roadprint with other methods on the very same windows.

    Writes every single fix (fixes.csv, fixes.parquet), the figures of every point (points.csv),
    summary.json, figures as PNG and SVG, and report.html, which holds all of it on one page.
    """
    if scenario is not None and data is not None:
        _refuse("give --scenario or --data, not both")
    if scenario is not None and scenario not in PRESETS:
        _refuse(f"no scenario {scenario!r}: there are {', '.join(PRESETS)}")
    known = REAL_EXPERIMENTS if data is not None else tuple(EXPERIMENTS)
    chosen = _names(experiments, known, "experiment")
    ask = Ask(
        scenario=None if data is not None else scenario or "paper",
        data=None if data is None else str(data.resolve()),
        methods=_names(methods, tuple(METHODS), "method"),
        windows=windows,
    )
    for name in ONE_THREAD:
        os.environ[name] = "1"
    lab = _laboratory()
    points = plan(ask, chosen, seeds)
    wanted = jobs(points)
    folder.mkdir(parents=True, exist_ok=True)
    began_s = time.monotonic()
    with reported(), progress_bar("windows") as bar:
        task = bar.add_task("evaluating", total=sum(lab.weight(job) for job in wanted))
        lab.execute(wanted, folder, processes, lambda count: bar.advance(task, count))
    took_s = time.monotonic() - began_s
    about = {
        "source": ask.scenario or f"data {Path(str(ask.data)).name}",
        "experiments": ", ".join(chosen),
        "methods": ", ".join(ask.methods),
        "seeds": seeds,
        "windows a point and seed": windows,
        "processes": processes,
        "took": f"{took_s:.0f} s",
    }
    rows = lab.write_report(lab.Run(points, wanted, about), folder)
    out.print(f"{len(wanted)} settings, {len(rows)} figures of points in {took_s:.0f} s")
    out.print(f"read {folder / 'report.html'}", soft_wrap=True)


def _laboratory() -> ModuleType:
    """
    What writes tables and figures: imported here, because a service is installed without it.

    Raises:
        typer.Exit: `USAGE` where it is not installed.
    """
    try:
        return importlib.import_module("app.evaluation.laboratory")
    except ModuleNotFoundError as error:
        _refuse(f"{error.name} is not installed: pip install 'roadprint[evaluation]'")


def _names(given: str, known: tuple[str, ...], noun: str) -> tuple[str, ...]:
    if given == "all":
        return known
    if given == "suite" and noun == "experiment":
        return tuple(name for name in PAPER_SUITE if name in known)
    wanted = tuple(name.strip() for name in given.split(",") if name.strip())
    unknown = [name for name in wanted if name not in known]
    if unknown or not wanted:
        _refuse(f"no {noun} {', '.join(unknown) or 'named'} here: there are {', '.join(known)}")
    return tuple(name for name in known if name in wanted)


def _refuse(why: str) -> NoReturn:
    err.print(why, soft_wrap=True)
    raise typer.Exit(USAGE)
