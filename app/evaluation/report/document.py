"""
The generated parts of `docs/evaluation.md`: tables, figures and verdicts, from results folders.

The document says itself what it shows and where:

    <!-- from paper: table cells anywhere mde_m -->
    (generated, replaced at every refresh)
    <!-- end -->

`refresh` fills each such part from the run of that name; a run that is not given leaves its parts
as they are. Nothing of a result is typed by hand.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.errors import RoadprintError

PART = re.compile(r"<!-- from (\w+): (.+?) -->\n.*?<!-- end -->", re.DOTALL)
PICTURES = "figures/evaluation"
PERCENT = "%"
FORMS = {  # how a column of points.csv is written; PERCENT: a share in percent, one decimal
    "windows": "d",
    "recall": ".6f",
    "least_recall": ".4f",
    "bound_m": ".3f",
    "located_rate": PERCENT,
    "road_rate": PERCENT,
    "direction_rate": PERCENT,
    "direction_given_road_rate": PERCENT,
    "segment_rate": PERCENT,
    "ece": PERCENT,
    "coverage68": PERCENT,
    "coverage95": PERCENT,
}
DEFAULT_FORM = ".2f"
SCORES = ("windows", "mde_m", "interval", "median_m", "p75_m", "p90_m", "p95_m", "median_along_m")
RATES = (
    "road_rate",
    "direction_rate",
    "direction_given_road_rate",
    "median_delay_ms",
    "mean_delay_ms",
)
TITLES = {
    "interval": "95 % interval",
    "mde_m": "MDE m",
    "median_m": "median m",
    "ece": "ECE %",
    "direction_given_road_rate": "direction on the right road %",
}


class BadPart(RoadprintError):
    """A part of the document asks for what the results do not have; the message says what."""

    code = "bad-part"
    title = "The document asks for what is not there"


@dataclass(frozen=True, slots=True)
class Results:
    """A finished run: its folder, the rows of ``points.csv`` and the summary."""

    name: str
    folder: Path
    rows: list[dict[str, str]]
    summary: dict[str, Any]

    @classmethod
    def read(cls, name: str, folder: Path) -> Results:
        """What `roadprint evaluate` left in a folder."""
        with (folder / "points.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return cls(name, folder, rows, summary)

    def at(self, experiment: str, protocol: str | None = None) -> list[dict[str, str]]:
        """
        The rows of an experiment.

        Raises:
            BadPart: It was not run.
        """
        rows = [row for row in self.rows if row["experiment"] == experiment]
        rows = [row for row in rows if protocol is None or row["protocol"] == protocol]
        if not rows:
            raise BadPart(f"{self.folder} has no {experiment} {protocol or ''}")
        return rows


def refresh(document: Path, runs: Mapping[str, Path]) -> list[str]:
    """
    Fill the parts of a document; the names of runs whose parts were left as they are come back.

    Raises:
        BadPart: A part asks for what is not in its run's results; nothing is written.
    """
    results = {name: Results.read(name, folder) for name, folder in runs.items()}
    pictures = document.parent / PICTURES
    left: list[str] = []

    def fill(found: re.Match[str]) -> str:
        name, asked = found.groups()
        if name not in results:
            left.append(name)
            return found.group(0)
        return f"<!-- from {name}: {asked} -->\n{_part(results[name], asked)}\n<!-- end -->"

    text = PART.sub(fill, document.read_text(encoding="utf-8"))
    for run in results.values():
        for word in PART.finditer(text):
            if word.group(1) == run.name and word.group(2).startswith("figure "):
                _copy_picture(run, word.group(2).split()[1], pictures)
    document.write_text(text, encoding="utf-8")
    return list(dict.fromkeys(left))


def _part(run: Results, asked: str) -> str:
    kind, _, rest = asked.partition(" ")
    if kind not in KINDS:
        raise BadPart(f"no kind of part is called {kind!r}: there are {', '.join(KINDS)}")
    return KINDS[kind](run, rest)


def _table(run: Results, asked: str) -> str:
    """``table EXPERIMENT PROTOCOL COLUMN``: a row a place on the axis, a column a method."""
    experiment, protocol, column = asked.split()
    rows = run.at(experiment, protocol)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    with_bound = column == "mde_m" and any(row["bound_m"] for row in rows)
    head = [experiment, *methods, *(["bound"] if with_bound else [])]
    body = []
    for label in dict.fromkeys(row["label"] for row in rows):
        own = {row["method"]: row for row in rows if row["label"] == label}
        line = [label, *(_text(own.get(method, {}), column) for method in methods)]
        body.append(line + ([_text(next(iter(own.values())), "bound_m")] if with_bound else []))
    return markdown(head, body)


def _scores(run: Results, asked: str) -> str:
    """``scores EXPERIMENT``: every figure of every method at its points."""
    rows = run.at(asked)
    columns = (*SCORES, *RATES)
    head = ["at", "method", *(_title(column) for column in columns)]
    body = [[row["label"], row["method"], *(_text(row, each) for each in columns)] for row in rows]
    return markdown(head, body)


def _ours(run: Results, asked: str) -> str:
    """``ours EXPERIMENT COLUMN...``: roadprint's figures alone, a row a place on the axis."""
    experiment, *columns = asked.split()
    rows = [row for row in run.at(experiment) if row["method"] == "roadprint"]
    head = ["at", *(_title(column) for column in columns)]
    return markdown(head, [[row["label"], *(_text(row, each) for each in columns)] for row in rows])


def _improvement(run: Results, asked: str) -> str:
    """``improvement``: points that our CDF of errors lies above each other's."""
    del asked
    if "improvement" not in run.summary:
        raise BadPart(f"{run.folder} has no CDF")
    columns = {
        "mean_0_to_2_m": "mean, 0 to 2 m",
        "at_2_m": "at 2 m",
        "mean_whole_range": "mean, whole range",
    }
    body = [
        [row["method"], *(f"{100 * row[name]:+.1f}" for name in columns)]
        for row in run.summary["improvement"]
    ]
    return markdown(["against", *columns.values()], body)


def _figure(run: Results, asked: str) -> str:
    """``figure NAME alternative text``."""
    name, _, words = asked.partition(" ")
    return f"![{words}]({PICTURES}/{run.name}-{name}.png)"


def _verdict(run: Results, asked: str) -> str:
    """``verdict``: how often roadprint has the lowest figure, and every place where it has not."""
    del asked
    findings = run.summary["verdict"]
    lost = [each["text"] for each in findings if not each["wins"]]
    won = len(findings) - len(lost)
    head = f"roadprint has the lowest figure in {won} of {len(findings)} comparisons."
    if not lost:
        return head
    return "\n".join([head + " Where it has not:", "", *(f"- {text}" for text in lost)])


def _about(run: Results, asked: str) -> str:
    """``about``: what was run, with what, and how long it took."""
    del asked
    about, versions = run.summary["about"], run.summary["versions"]
    seconds = sum(job["took_s"] for job in run.summary["jobs"])
    known = ", ".join(f"{name} {version}" for name, version in versions.items())
    return (
        f"{about['source']}: {about['experiments']}; {about['methods']}. "
        f"{about['seeds']} seeds, {about['windows a point and seed']} windows a point and seed; "
        f"{len(run.summary['jobs'])} settings, {seconds:.0f} s of computing over "
        f"{about['processes']} processes. Python {run.summary['python']}, {known}."
    )


KINDS: dict[str, Callable[[Results, str], str]] = {
    "about": _about,
    "figure": _figure,
    "improvement": _improvement,
    "ours": _ours,
    "scores": _scores,
    "table": _table,
    "verdict": _verdict,
}
"""What a part can be; the first word after the run's name."""


def markdown(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = [head, ["---"] * len(head), *body]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _title(column: str) -> str:
    if column in TITLES:
        return TITLES[column]
    form = FORMS.get(column)
    name = column.removesuffix("_rate").removesuffix("_m").removesuffix("_ms").replace("_", " ")
    unit = " %" if form == PERCENT else " ms" if column.endswith("_ms") else ""
    return name + unit


def _text(row: Mapping[str, str], column: str) -> str:
    """A figure as the document writes it; a dash where there is none."""
    if column == "interval":
        return f"{float(row['mde_low_m']):.2f} to {float(row['mde_high_m']):.2f}"
    if not row:
        return "–"
    if column not in row:
        raise BadPart(f"points.csv has no column {column}")
    if not row[column]:
        return "–"
    form = FORMS.get(column, DEFAULT_FORM)
    if form == PERCENT:
        return f"{100.0 * float(row[column]):.1f}"
    return format(int(row[column]) if form == "d" else float(row[column]), form)


def _copy_picture(run: Results, name: str, pictures: Path) -> None:
    drawn = run.folder / "figures" / f"{name}.png"
    if not drawn.is_file():
        raise BadPart(f"{drawn} is not there")
    pictures.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(drawn, pictures / f"{run.name}-{name}.png")
