"""`roadprint simulate` writes what `roadprint import` reads."""

from __future__ import annotations

import pytest

from app.evaluation.dataset import read_index, read_roads
from app.evaluation.scenario import PRESETS


def test_a_scenario_becomes_a_data_set(run, tmp_path):
    """Roads and passes as many as asked for."""
    words = ("--scenario", "city", "--roads", 12, "--cells", 30, "--survey-passes", 2)
    done = run("simulate", *words, "--seed", 3, "--out", tmp_path / "city")
    assert done.exit_code == 0, done.output
    assert len(read_roads(tmp_path / "city")) == 12
    roles = [entry.role for entry in read_index(tmp_path / "city").values()]
    assert (roles.count("survey"), roles.count("test")) == (24, 24)


@pytest.mark.parametrize("words", [["--scenario", "mild"], ["--cells", "7"], ["--roads", "5"]])
def test_impossible_cities_are_refused(run, tmp_path, words):
    """Exit code 2 and the reason, nothing written."""
    done = run("simulate", *words, "--out", tmp_path / "city")
    assert done.exit_code == 2
    assert words[1] in done.stderr
    assert not (tmp_path / "city").exists()


def test_help_names_every_scenario(run):
    """What can be asked for is listed."""
    assert all(name in run("simulate", "--help").stdout for name in PRESETS)
