"""From finished jobs to the folder a person opens: tables, figures, summary, page."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from app.evaluation.experiments.fingerprint import fingerprint
from app.evaluation.experiments.plan import Job, Point
from app.evaluation.experiments.score import Row, pick, reliability, score_points
from app.evaluation.experiments.tables import Shelf, write_fixes, write_rows
from app.evaluation.methods import METHODS
from app.evaluation.report import figures, page, verdict
from app.numerics.geodesy import Floats

TITLES = {
    "cells": ("Base stations", "number of base stations"),
    "grid": ("Survey grid", "spacing of survey samples and reference points"),
    "window": ("Window length", "length of the window"),
    "noise": ("Noise", "noise of a reading"),
    "impairments": ("Each impairment of harsh alone", ""),
    "passes": ("Survey passes, in harsh", "survey passes over each road"),
    "roads": ("Cost against the size of the map", "number of roads"),
}
PACKAGES = ("roadprint", "numpy", "scipy", "ruptures", "pyarrow", "matplotlib")
DELAYED = {"cells", "grid", "window", "roads"}  # experiments with a figure of delays


@dataclass(frozen=True, slots=True)
class Run:
    """What was asked for and what came of it."""

    points: Sequence[Point]
    jobs: Sequence[Job]
    about: dict[str, Any]


def write_report(run: Run, folder: Path) -> list[Row]:
    """Write everything beside the jobs; the rows of ``points.csv`` come back."""
    shelf = Shelf(folder)
    fixes = write_fixes(folder, [shelf.read(job) for job in run.jobs])
    keys = {job: job.key for job in run.jobs}
    rows = score_points(run.points, keys, fixes)
    write_rows(folder / "points.csv", rows)
    drawings = folder / "figures"
    drawings.mkdir(exist_ok=True)
    findings = verdict.judge(rows)
    parts = [_intro(run), "<h2>Verdict</h2>", page.verdict(findings)]
    summary: dict[str, Any] = {
        "about": run.about,
        "versions": {name: version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "code": fingerprint(),
        "jobs": [
            {
                "key": job.key,
                **asdict(job),
                "methods": shelf.methods(job),
                "took_s": shelf.took_s(job),
            }
            for job in run.jobs
        ],
        "points": rows,
        "verdict": [asdict(each) for each in findings],
    }
    for experiment in dict.fromkeys(point.experiment for point in run.points):
        here = [row for row in rows if row["experiment"] == experiment]
        mine = [point for point in run.points if point.experiment == experiment]
        if experiment == "cdf":
            parts += _cdf(here, pick(fixes, mine, keys), drawings, summary)
        elif experiment == "reliability":
            parts += _reliability(here, mine, keys, fixes, drawings, summary)
        elif experiment == "recall":
            parts += _recall(here)
        else:
            parts += _curves(experiment, here, drawings)
    parts += ["<h2>What each method chose</h2>", _chosen(run, shelf)]
    text = page.page("roadprint: evaluation", parts)
    (folder / "report.html").write_text(text, encoding="utf-8")
    plain = json.dumps(summary, indent=1, default=str)
    (folder / "summary.json").write_text(plain + "\n", encoding="utf-8")
    return rows


def _intro(run: Run) -> str:
    about = "; ".join(f"{name}: {value}" for name, value in run.about.items())
    sources = "".join(
        f"<li><b>{name}</b>: {escape(_first_sentence(method.__doc__))}</li>"
        for name, method in METHODS.items()
    )
    return (
        f'<p class="note">{escape(about)}.</p>'
        "<p>All methods learn from the same survey and are asked the very same windows, one after "
        "the other in one process, taking turns at going first. The answer is where the window's "
        "last sample was taken. MDE is the mean distance error; its interval is a bootstrap over "
        "whole drives. Under <i>anywhere</i> windows of a given length end anywhere; under "
        "<i>aligned</i> a drive is cut at its own singular points. Dotted: the Cramer-Rao bound "
        "for the true RSRP and noise, as mean absolute error, sqrt(2/pi) of the standard "
        f"deviation; no unbiased method can do better.</p><ul>{sources}</ul>"
    )


def _first_sentence(doc: str | None) -> str:
    first = " ".join((doc or "").strip().split("\n\n")[0].split())
    return first.split(": ", 1)[-1].replace("`", "")


def _curves(experiment: str, rows: list[Row], folder: Path) -> list[str]:
    title, x_label = TITLES[experiment]
    error = figures.lines(rows, "mde_m", x_label, "mean distance error, m")
    error.write(folder, f"{experiment}-mde")
    parts = [f"<h2>{escape(title)}</h2>", error.svg]
    if experiment in DELAYED:
        delay = figures.lines(rows, "mean_delay_ms", x_label, "mean delay, ms")
        delay.write(folder, f"{experiment}-delay")
        parts.append(delay.svg)
    return [*parts, page.score_table(rows)]


def _cdf(rows: list[Row], fixes: pa.Table, folder: Path, summary: dict[str, Any]) -> list[str]:
    errors_m = _errors_m(fixes)
    drawn = figures.cdf(errors_m)
    drawn.write(folder, "cdf")
    gains = verdict.improvements(errors_m)
    summary["improvement"] = gains
    head = [
        ("method", "against"),
        ("mean_0_to_2_m", "mean, 0 to 2 m"),
        ("at_2_m", "at 2 m"),
        ("mean_whole_range", "mean, whole range"),
    ]
    cells = [
        {name: page.text(row[name], "" if name == "method" else "+.1%") for name, _ in head}
        for row in gains
    ]
    delays = [
        {"method": row["method"], "mean_delay_ms": page.text(row["mean_delay_ms"], ".3f")}
        for row in rows
    ]
    return [
        "<h2>CDF of errors, 2 m grid</h2>",
        drawn.svg,
        "<p>How many points roadprint's curve lies above each other's:</p>",
        page.table(head, cells),
        page.score_table(rows),
        "<h3>Mean delay of a located position</h3>",
        page.table([("method", "method"), ("mean_delay_ms", "mean delay, ms")], delays),
    ]


def _errors_m(fixes: pa.Table) -> dict[str, Floats]:
    methods = list(dict.fromkeys(fixes["method"].to_pylist()))
    return {
        name: np.asarray(fixes.filter(pc.equal(fixes["method"], name))["error_m"].to_numpy())
        for name in methods
    }


def _reliability(
    rows: list[Row],
    points: list[Point],
    keys: dict[Job, str],
    fixes: pa.Table,
    folder: Path,
    summary: dict[str, Any],
) -> list[str]:
    groups: dict[str, list[Row]] = {}
    for label in dict.fromkeys(point.label for point in points):
        own = pick(fixes, [point for point in points if point.label == label], keys)
        bins = reliability(own.filter(pc.equal(own["method"], verdict.OURS)))
        if bins:
            groups[label] = bins
    if not groups:
        return []
    summary["reliability"] = groups
    drawn = figures.reliability(groups)
    drawn.write(folder, "reliability")
    head = [
        ("label", "at"),
        ("method", "method"),
        ("ece", "ECE"),
        ("coverage68", "within 68 % radius"),
        ("coverage95", "within 95 % radius"),
    ]
    cells = [
        {
            name: page.text(row[name], "" if name in {"label", "method"} else ".1%")
            for name, _ in head
        }
        for row in rows
        if row["method"] in {"paper", verdict.OURS}
    ]
    return ["<h2>Reliability</h2>", drawn.svg, page.table(head, cells)]


def _recall(rows: list[Row]) -> list[str]:
    head = [
        ("label", "at"),
        ("recall", "mean recall"),
        ("least_recall", "least"),
        ("mde", "MDE m"),
        ("exhaustive", "MDE of exhaustive m"),
    ]
    whole = {row["label"]: row["mde_m"] for row in rows if row["method"] == "exhaustive"}
    cells = [
        {
            "label": row["label"],
            "recall": page.text(row["recall"], ".6f"),
            "least_recall": page.text(row["least_recall"], ".4f"),
            "mde": page.text(row["mde_m"], ".3f"),
            "exhaustive": page.text(whole.get(row["label"]), ".3f"),
        }
        for row in rows
        if row["method"] == verdict.OURS and row["recall"] is not None
    ]
    note = (
        "<p>Share of the exhaustive posterior that lies in the two-scale search's candidates.</p>"
    )
    return ["<h2>Recall of the two-scale candidates</h2>", note, page.table(head, cells)]


def _chosen(run: Run, shelf: Shelf) -> str:
    """How often each parameter set was chosen, and how long learning took."""
    seen: dict[tuple[str, str], list[float]] = {}
    for job in run.jobs:
        for name, about in shelf.methods(job).items():
            key = (name, about["parameters"] or "nothing to choose")
            seen.setdefault(key, []).append(float(about["fit_s"]))
    order = sorted(seen, key=lambda key: (list(METHODS).index(key[0]), -len(seen[key]), key[1]))
    cells = [
        {
            "method": name,
            "parameters": chosen,
            "times": str(len(seen[name, chosen])),
            "fit": f"{np.median(seen[name, chosen]):.2f}",
        }
        for name, chosen in order
    ]
    head = [
        ("method", "method"),
        ("parameters", "chosen on the survey"),
        ("times", "settings"),
        ("fit", "median s to learn"),
    ]
    return page.table(head, cells)
