"""`roadprint evaluate` as typed."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from app.cli import app

RUN = CliRunner()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--scenario", "moon"], "no scenario 'moon'"),
        (["--methods", "magic"], "no method magic"),
        (["--experiments", "cells,luck"], "no experiment luck"),
        (["--scenario", "paper", "--data", "x"], "not both"),
        (["--data", "x", "--experiments", "noise"], "no experiment noise"),
    ],
)
def test_what_cannot_be_run_is_refused_by_name(tmp_path, options, said):
    """Nothing is written, and the exit code says usage."""
    result = RUN.invoke(app, ["evaluate", "--out", str(tmp_path / "out"), *options])
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
    assert not (tmp_path / "out").exists()


def test_a_small_run_leaves_a_page_and_its_files(tmp_path):
    """Two methods, one experiment, on a clean city."""
    out = tmp_path / "out"
    arguments = ["evaluate", "--out", str(out), "--scenario", "clean", "--experiments", "cdf"]
    arguments += ["--methods", "rwknn,roadprint", "--seeds", "1", "--windows", "5", "--jobs", "1"]
    result = RUN.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    names = {path.name for path in out.iterdir()}
    tables = {"fixes.csv", "fixes.parquet", "points.csv", "summary.json"}
    assert names == {"jobs", "figures", "report.html"} | tables
    assert "report.html" in result.output
