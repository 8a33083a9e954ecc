"""Whole drives of a real city, no network given: the streets appear, and windows are located."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest

from app.commands.client import HttpTarget
from app.commands.demo import locate_all
from app.commands.scores import Scores
from app.domain import Line
from app.evaluation.dataset import is_dataset, read_roads
from app.evaluation.passes import cut_windows, load_test_drives
from app.numerics.lines import length_m, point_at, project

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
CITY, SUBURB = DATA / "santa_monica_att", DATA / "pcat"

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.real_data,
    pytest.mark.skipif(not is_dataset(CITY), reason=f"the measurements are not at {CITY}"),
]


def import_drives(folder: Path, into: Path, url: str) -> subprocess.CompletedProcess[str]:
    """The survey drives of a folder, without the passes that were cut from them by hand."""
    into.mkdir()
    for name in ("drives.csv.gz", "drives_index.csv"):
        shutil.copy(folder / name, into)
    return subprocess.run(
        [sys.executable, "-m", "app", "import", str(into / "drives.csv.gz"), "--url", url],
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


def found_lines(url: str) -> dict[str, Line]:
    roads = httpx.get(f"{url}/v1/roads", params={"limit": 1000}).json()["roads"]
    assert all(road["pass_count"] > 0 for road in roads)
    return {
        road["id"]: Line(*np.array(road["line"]["coordinates"], dtype=float).T) for road in roads
    }


@pytest.fixture(scope="module")
def service(start_service, tmp_path_factory):
    """A service with the survey drives in, and nothing said of any road."""
    url = start_service()
    done = import_drives(CITY, tmp_path_factory.mktemp("city") / "drives", url)
    assert done.returncode == 0, done.stdout + done.stderr
    with HttpTarget(url) as target:
        yield target


def test_the_streets_of_the_city_appear(service):
    """All 17 streets lie within 12 m of one found road over 90 % of their length."""
    lines = found_lines(service.url)
    for street in read_roads(CITY):
        places = point_at(street.line, np.arange(0.0, length_m(street.line), 5.0))
        covered = max(
            np.mean(np.abs(project(line, places.lon, places.lat).offset_m) <= 12.0)
            for line in lines.values()
        )
        assert covered >= 0.9, (street.road_id, covered)
    assert len(lines) <= 25


def test_windows_of_later_drives_are_found_on_that_map(service):
    """Windows of 200 m within one street: median at most 15 m, most of them on the right street."""
    windows = cut_windows(load_test_drives(CITY), 300, length_m=200.0, seed=2024)
    scores = Scores.of(locate_all(service, windows))
    assert scores.median_error_m <= 15.0, scores


def test_importing_again_changes_nothing(service, tmp_path):
    """No survey is stored twice, and every road keeps its id."""
    before = found_lines(service.url)
    done = import_drives(CITY, tmp_path / "again", service.url)
    assert done.returncode == 0, done.stdout + done.stderr
    assert set(found_lines(service.url)) == set(before)


def test_a_suburban_route_becomes_one_road(start_service, tmp_path):
    """Forty drives whose latitudes are rounded to 11 m: one road of 8.3 km within 2 %."""
    url = start_service()
    done = import_drives(SUBURB, tmp_path / "drives", url)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = found_lines(url).values()
    assert length_m(line) == pytest.approx(8300.0, rel=0.02)


def test_one_drive_more_keeps_every_id(service):
    """A drive along a known street, posted by itself, adds a pass and moves no id."""
    before = found_lines(service.url)
    one = load_test_drives(CITY)[0]
    with httpx.Client(base_url=service.url, timeout=60.0) as client:
        posted = service.post_trace(replace(one.trace, road_id=None), "one-more")
        build = service.request_build(None)
        assert list(service.follow(build.build_id))[-1].status == "successful"
        roads = client.get(f"/v1/surveys/{posted.survey_id}").json()["roads"]
    assert set(found_lines(service.url)) == set(before)
    assert set(roads) <= set(before)
    assert roads
