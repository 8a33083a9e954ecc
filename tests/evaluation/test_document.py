"""docs/evaluation.md is made from results folders: every figure is that of the files."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

from app.evaluation.experiments.execute import finish
from app.evaluation.experiments.plan import EXPERIMENTS, Ask, jobs, plan
from app.evaluation.report.document import KINDS, PART, BadPart, refresh
from app.evaluation.report.write import Run, write_report

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = ROOT / "docs" / "evaluation.md"
ABOUT = {
    "source": "paper",
    "experiments": "cdf",
    "methods": "rwknn, roadprint",
    "seeds": 1,
    "windows a point and seed": 5,
    "processes": 1,
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A finished run of two methods, one setting."""
    folder = tmp_path_factory.mktemp("results")
    points = plan(Ask("paper", None, ("rwknn", "roadprint"), 5), ("cdf",), 1)
    for job in jobs(points):
        finish(job, folder)
    write_report(Run(points, jobs(points), ABOUT), folder)
    return folder


def filled(tmp_path, results, *asked, name="paper"):
    parts = [f"<!-- from paper: {each} -->\nold\n<!-- end -->" for each in asked]
    document = tmp_path / "page.md"
    document.write_text("Before.\n\n" + "\n\n".join(parts) + "\n\nAfter.\n")
    left = refresh(document, {name: results})
    return document.read_text(), left


def test_tables_are_those_of_the_points(tmp_path, results):
    """Each figure is the file's, in the form that its column has."""
    text, _ = filled(tmp_path, results, "table cdf anywhere mde_m", "scores cdf")
    with (results / "points.csv").open(newline="") as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    ours, theirs = rows["roadprint"], rows["rwknn"]
    mde = [f"{float(row['mde_m']):.2f}" for row in (theirs, ours)]
    assert f"| 2 cells, 2 m grid | {mde[0]} | {mde[1]} | {float(ours['bound_m']):.3f} |" in text
    assert f"{100 * float(theirs['road_rate']):.1f} |" in text
    assert "old" not in text
    assert text.startswith("Before.\n\n<!-- from paper: table cdf anywhere mde_m -->\n| cdf |")
    assert text.endswith("<!-- end -->\n\nAfter.\n")


def test_filling_twice_changes_nothing(tmp_path, results):
    """The parts keep saying what they are."""
    asked = ("about", "verdict", "improvement", "ours cdf ece coverage68", "figure cdf The CDF")
    text, _ = filled(tmp_path, results, *asked)
    document = tmp_path / "page.md"
    refresh(document, {"paper": results})
    assert document.read_text() == text
    assert "![The CDF](figures/evaluation/paper-cdf.png)" in text
    copied = tmp_path / "figures" / "evaluation" / "paper-cdf.png"
    assert copied.read_bytes() == (results / "figures" / "cdf.png").read_bytes()


def test_the_verdict_counts_what_the_summary_found(tmp_path, results):
    """Every lost comparison is on the page."""
    text, _ = filled(tmp_path, results, "verdict")
    found = json.loads((results / "summary.json").read_text())["verdict"]
    lost = [each["text"] for each in found if not each["wins"]]
    assert f"in {len(found) - len(lost)} of {len(found)} comparisons" in text
    assert all(f"- {each}" in text for each in lost)


def test_parts_of_other_runs_are_left_alone(tmp_path, results):
    """One may refresh the simulation without the measurements at hand."""
    text, left = filled(tmp_path, results, "verdict", name="streets")
    assert "old" in text
    assert left == ["paper"]


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        ("table noise anywhere mde_m", "no noise"),
        ("table cdf anywhere luck_m", "luck_m"),
        ("poem", "poem"),
        ("figure moon The moon", "moon.png"),
    ],
)
def test_what_is_not_there_is_refused_and_nothing_written(tmp_path, results, asked, complaint):
    """A half-filled document would mix runs."""
    with pytest.raises(BadPart, match=complaint):
        filled(tmp_path, results, "verdict", asked)
    assert "old" in (tmp_path / "page.md").read_text()


def test_the_document_asks_for_what_the_command_makes():
    """Known runs, kinds, experiments; every experiment of the lab is shown."""
    text = DOCUMENT.read_text()
    parts = [found.groups() for found in PART.finditer(text)]
    assert text.count("<!-- from ") == len(parts) == text.count("<!-- end -->")
    assert {run for run, _ in parts} == {"paper", "streets", "route"}
    shown = set()
    for _, asked in parts:
        kind, *words = asked.split()
        assert kind in KINDS
        if kind in {"table", "scores", "ours"}:
            assert words[0] in EXPERIMENTS
            shown.add(words[0])
    assert shown == set(EXPERIMENTS)


def test_the_document_shows_every_figure_of_the_paper():
    """Delay and error against base stations and grid, the CDF, the table of delays."""
    asked = " ".join(
        asked for _, asked in (found.groups() for found in PART.finditer(DOCUMENT.read_text()))
    )
    for name in ("cells-mde", "cells-delay", "grid-mde", "grid-delay", "cdf"):
        assert re.search(rf"figure {name} ", asked), name


def test_the_code_for_a_search_of_ones_own_runs():
    """What the document tells a stranger to type works, on fewer windows."""
    (code,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    known: dict[str, object] = {}
    exec(code.replace("300", "3"), known)  # noqa: S102  # the document's own code
    assert known["estimate"].road_id == known["truth"].road_id
