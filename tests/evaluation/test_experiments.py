"""One run from plan to page: reproducible, resumable, and the page says what the files say."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from app.evaluation.experiments import tables
from app.evaluation.experiments.execute import execute, finish
from app.evaluation.experiments.plan import EXPERIMENTS, Ask, jobs, plan
from app.evaluation.experiments.score import mean_interval, reliability, score
from app.evaluation.experiments.tables import SCHEMA, Shelf
from app.evaluation.report import verdict
from app.evaluation.report.write import Run, write_report

ALL = ("paper", "rwknn", "gift", "cf-els", "exhaustive", "roadprint")
ASK = Ask("paper", None, ALL, 10)
PINNED_M = {
    ("anywhere", "paper"): 209.85089994121898,
    ("anywhere", "rwknn"): 61.875085660644615,
    ("anywhere", "gift"): 0.510323287510513,
    ("anywhere", "cf-els"): 146.67193849439676,
    ("anywhere", "exhaustive"): 0.16305833244686135,
    ("anywhere", "roadprint"): 0.16305833244686135,
    ("aligned", "paper"): 177.30277744750117,
    ("aligned", "rwknn"): 7.712193090202014,
    ("aligned", "gift"): 0.35268998933345275,
    ("aligned", "cf-els"): 96.66706665026817,
    ("aligned", "exhaustive"): 0.2200266547880545,
    ("aligned", "roadprint"): 0.2200266547880545,
}
SAME_M = 1e-9
RESULTS = [name for name in SCHEMA.names if name != "delay_ms"]


def tiny():
    """One setting: three cells, both protocols."""
    return [point for point in plan(ASK, ("cells",), 1) if point.x == 3]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The tiny experiment, run in this process."""
    folder = tmp_path_factory.mktemp("one")
    for job in jobs(tiny()):
        finish(job, folder)
    return folder


@pytest.fixture(scope="module")
def reported(finished):
    points = [*tiny(), *(replace(tiny()[0], experiment=name) for name in ("cdf", "recall"))]
    points.append(replace(tiny()[0], experiment="reliability"))
    return write_report(Run(points, jobs(tiny()), {"source": "paper"}), finished)


def test_every_setting_is_run_once():
    """Points of different figures share what they need in common."""
    points = plan(ASK, tuple(EXPERIMENTS), 2)
    wanted = jobs(points)
    assert len({job.setting for job in wanted}) == len(wanted) < len(points)
    assert len({job.key for job in wanted}) == len(wanted)
    asked = {(point.setting, point.case) for point in points}
    assert asked == {(job.setting, case) for job in wanted for case in job.cases}


def test_numbers_are_those_of_every_other_machine(reported):
    """Mean errors of the tiny experiment; a change of a method changes them here."""
    got = {
        (row["protocol"], row["method"]): row["mde_m"]
        for row in reported
        if row["experiment"] == "cells"
    }
    assert got.keys() == PINNED_M.keys()
    for (protocol, method), mde_m in got.items():
        assert mde_m == pytest.approx(PINNED_M[protocol, method], abs=SAME_M), (protocol, method)


def test_processes_move_no_number(tmp_path, monkeypatch):
    """Two processes, started anew, give what one gives; delays aside."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # as the command does
    ask = Ask("paper", None, ("rwknn", "gift", "roadprint"), 6)
    wanted = jobs([point for point in plan(ask, ("cells",), 1) if point.x in {2, 3}])
    for processes in (1, 2):
        told = []
        execute(wanted, tmp_path / str(processes), processes, told.append)
        assert told == [12, 12]
    for job in wanted:
        one, two = (Shelf(tmp_path / name).read(job).select(RESULTS) for name in "12")
        assert one.equals(two)


def test_a_finished_job_is_not_run_again(finished):
    """Resuming reads what is there."""
    files = list((finished / "jobs").iterdir())
    before = [file.stat().st_mtime_ns for file in files]
    told = []
    execute(jobs(tiny()), finished, 1, told.append)
    assert [file.stat().st_mtime_ns for file in files] == before
    assert told == [20]


def test_a_job_of_other_code_is_run_again(finished, monkeypatch):
    """Resuming never mixes the results of two states of the methods."""
    job = jobs(tiny())[0]
    assert Shelf(finished).has(job)
    monkeypatch.setattr(tables, "fingerprint", lambda: "another")
    assert not Shelf(finished).has(job)


def test_every_method_is_asked_the_same_windows(finished):
    """Each window appears once a method, with one truth."""
    rows = Shelf(finished).read(jobs(tiny())[0]).to_pylist()
    truths = {}
    for row in rows:
        name = (row["protocol"], row["number"])
        truth = (row["true_road"], row["true_chainage_m"], row["samples"])
        assert truths.setdefault(name, truth) == truth
    assert len(truths) == 20
    assert len(rows) == 20 * len(ALL)


def test_every_fix_is_in_both_tables(finished, reported):
    """CSV and Parquet hold the same rows, and the errors are those of their positions."""
    table = pq.read_table(finished / "fixes.parquet")
    with (finished / "fixes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == table.num_rows == 120
    errors = np.array([float(row["error_m"]) for row in rows])
    np.testing.assert_array_equal(errors, table["error_m"].to_numpy())


def test_points_are_the_scores_of_their_fixes(finished, reported):
    """points.csv can be worked out anew from fixes.parquet."""
    table = pq.read_table(finished / "fixes.parquet").to_pylist()
    with (finished / "points.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            own = [
                fix["error_m"]
                for fix in table
                if fix["method"] == row["method"] and fix["protocol"] == row["protocol"]
            ]
            assert float(row["mde_m"]) == pytest.approx(np.mean(own), abs=1e-12)
            assert float(row["p90_m"]) == pytest.approx(np.quantile(own, 0.9), abs=1e-12)


SCORED = {"cells", "cdf"}
CALIBRATION = ("ece", "coverage68", "coverage95")


def two(value):
    return f"{float(value):.2f}" if value else "–"


def percent(value):
    return f"{float(value):.1%}" if value else "–"


def test_the_page_says_what_the_files_say(finished, reported):
    """Every row of points.csv is on the page, digit by digit; figures are the files' own."""
    page = (finished / "report.html").read_text()
    with (finished / "points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(reported)
    for row in (each for each in rows if each["experiment"] in SCORED):
        cells = [row["protocol"], row["label"], row["method"], row["windows"]]
        cells += [two(row["mde_m"]), f"{two(row['mde_low_m'])} to {two(row['mde_high_m'])}"]
        cells += [two(row[name]) for name in ("median_m", "p75_m", "p90_m", "p95_m")]
        cells += [two(row["median_along_m"]), f"{float(row['bound_m']):.3f}"]
        cells += [percent(row["road_rate"]), percent(row["direction_rate"])]
        cells += [percent(row["direction_given_road_rate"])]
        cells += [f"{float(row[name]):.3f}" for name in ("median_delay_ms", "mean_delay_ms")]
        assert "".join(f"<td>{cell}</td>" for cell in cells) in page, row["method"]
    (ours,) = (r for r in rows if r["experiment"] == "reliability" and r["method"] == "roadprint")
    cells = [ours["label"], "roadprint", *(percent(ours[name]) for name in CALIBRATION)]
    assert "".join(f"<td>{cell}</td>" for cell in cells) in page
    (ours,) = (r for r in rows if r["experiment"] == "recall" and r["method"] == "roadprint")
    cells = [ours["label"], f"{float(ours['recall']):.6f}", f"{float(ours['least_recall']):.4f}"]
    assert "".join(f"<td>{cell}</td>" for cell in cells) in page
    drawn = sorted((finished / "figures").glob("*.svg"))
    assert [file.stem for file in drawn] == ["cdf", "cells-delay", "cells-mde", "reliability"]
    for file in drawn:
        assert file.read_text() in page
        assert file.with_suffix(".png").stat().st_size > 5000


def test_the_page_needs_nothing_else(finished, reported):
    """No script, no style sheet, no picture from elsewhere."""
    page = (finished / "report.html").read_text()
    links = re.findall(r'(?:src|href)="([^"#][^"]*)"', page)
    assert not links
    assert "<script" not in page


def test_the_summary_names_versions_parameters_and_points(finished, reported):
    """Enough to run it again."""
    summary = json.loads((finished / "summary.json").read_text())
    assert {"roadprint", "numpy", "scipy"} <= summary["versions"].keys()
    assert summary["jobs"][0]["setting"]["scenario"]["noise_db"] == 2.0
    assert "slack_m" in summary["jobs"][0]["methods"]["rwknn"]["parameters"]
    assert [row["mde_m"] for row in summary["points"]] == [row["mde_m"] for row in reported]


def test_the_interval_holds_the_mean_and_narrows_with_drives():
    """Whole drives are redrawn, always the same way."""
    rng = np.random.default_rng(1)
    few, many = rng.exponential(size=40), rng.exponential(size=4000)
    few_low, few_high = mean_interval(few, [str(i // 4) for i in range(40)])
    low, high = mean_interval(many, [str(i // 4) for i in range(4000)])
    assert few_low < few.mean() < few_high
    assert high - low < few_high - few_low
    assert mean_interval(few, [str(i // 4) for i in range(40)]) == (few_low, few_high)


def fixes(**columns):
    rows = len(next(iter(columns.values())))
    full = {name: [None] * rows for name in SCHEMA.names} | columns
    return pa.table(full, schema=SCHEMA)


def test_reliability_counts_what_was_said_and_what_was_right():
    """Nine of ten right at 0.9 is calibrated; none of ten is off by 0.9."""
    base = {
        "job": ["j"] * 20,
        "drive": list(range(20)),
        "error_m": [1.0] * 20,
        "delay_ms": [1.0] * 20,
    }
    said = [0.95] * 10 + [0.45] * 10
    right = [True] * 10 + [False] * 10
    table = fixes(**base, posterior=said, segment_right=right, radius68_m=[2.0] * 10 + [0.5] * 10)
    assert [each["right"] for each in reliability(table)] == [0.0, 1.0]
    scored = score(table)
    assert scored["ece"] == pytest.approx(0.5 * 0.05 + 0.5 * 0.45)
    assert scored["coverage68"] == 0.5
    assert scored["coverage95"] is None


def test_direction_counts_over_all_windows_and_over_those_on_the_right_road():
    """The direction on a wrong road counts among all windows, not among those on the right road."""
    base = {"job": ["j"] * 4, "drive": [0] * 4, "error_m": [1.0] * 4, "delay_ms": [1.0] * 4}
    road = [True, True, True, False]
    scored = score(fixes(**base, road_right=road, direction_right=[True, True, False, True]))
    assert scored["road_rate"] == 0.75
    assert scored["direction_rate"] == 0.75
    assert scored["direction_given_road_rate"] == pytest.approx(2.0 / 3.0)
    lost = score(fixes(**base, road_right=[False] * 4, direction_right=[False] * 4))
    assert lost["direction_given_road_rate"] is None


def row(method, mde_m, delay_ms, road_rate):
    return {
        "experiment": "cells", "protocol": "anywhere", "label": "2", "method": method,
        "mde_m": mde_m, "mde_low_m": mde_m, "mde_high_m": mde_m, "median_m": mde_m,
        "median_delay_ms": delay_ms, "road_rate": road_rate,
    }  # fmt: skip


def test_the_verdict_names_who_is_better():
    """Lower MDE or delay of a method that finds the road as often is said plainly."""
    ours = row("roadprint", 1.0, 0.5, 0.99)
    found = verdict.judge([ours, row("gift", 0.8, 5.0, 0.99), row("paper", 90.0, 0.2, 0.5)])
    assert [each.wins for each in found] == [False, False, True]
    assert "gift has a lower MDE, 0.8 against 1 m" in found[0].text
    assert "gift has a lower median error, 0.8 against 1 m" in found[1].text


def test_a_fast_guess_is_no_rival():
    """A method below 95 % of our road rate is not compared; at 95 % it is."""
    ours = row("roadprint", 1.0, 0.5, 1.0)
    assert all(each.wins for each in verdict.judge([ours, row("paper", 90.0, 0.2, 0.949)]))
    assert not all(each.wins for each in verdict.judge([ours, row("paper", 90.0, 0.2, 0.951)]))


def test_improvements_are_differences_of_the_curves():
    """All ours at 0, all theirs at 1 m: half of 0 to 2 m between the curves, none at 2 m."""
    (gain,) = verdict.improvements({"gift": np.full(9, 1.0), "roadprint": np.zeros(9)})
    assert gain["mean_0_to_2_m"] == pytest.approx(0.5)
    assert gain["at_2_m"] == 0.0
    assert gain["mean_whole_range"] == pytest.approx(1.0)
