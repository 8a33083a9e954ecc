"""Real layouts: split by session, never by sample; both kinds of folder."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from app.evaluation.dataset import BadDataset, write_dataset
from app.evaluation.realdata import load
from app.evaluation.scenario import build_city, preset
from app.evaluation.simulated import city_passes

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(scope="module")
def passes():
    city = build_city(preset("paper"), 1)
    return [truth.road for truth in city.roads], list(city_passes(city))


def test_surveys_and_tests_are_told_apart_by_role(passes, tmp_path):
    """Every pass is in one of them."""
    roads, written = passes
    write_dataset(tmp_path, roads, written)
    data = load(tmp_path)
    assert len(data.survey) == sum(entry.role == "survey" for entry, _ in written)
    assert len(data.tests) == sum(entry.role == "test" for entry, _ in written)
    assert {road.road_id for road in data.roads} == {road.road_id for road in roads}
    assert all(trace.road_id for trace in data.survey)


def test_a_session_in_both_roles_is_refused(passes, tmp_path):
    """Two phones of one drive must not be on both sides."""
    roads, written = passes
    mixed = [(replace(entry, session="s1"), trace) for entry, trace in written]
    write_dataset(tmp_path, roads, mixed)
    with pytest.raises(BadDataset, match="s1"):
        load(tmp_path)


def test_a_folder_of_neither_layout_is_refused(tmp_path):
    """The message names the folder."""
    with pytest.raises(BadDataset, match=str(tmp_path)):
        load(tmp_path)


@pytest.mark.real_data
def test_a_route_is_read_with_its_drives():
    """Fifty drives of one suburban route of some 8.4 km."""
    folder = SHARED / "pcat"
    if not folder.is_dir():
        pytest.skip(f"no measurements at {folder}")
    data = load(folder)
    with (folder / "drives_index.csv").open(newline="") as file:
        roles = [row["role"] for row in csv.DictReader(file)]
    assert len(data.survey) == roles.count("survey")
    assert len(data.tests) == roles.count("test")
    assert all(8000 < one.travelled_m[-1] < 9000 for one in data.tests)
