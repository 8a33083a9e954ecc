"""Seventeen real streets: imported as an operator would, located with the drives of later days."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from app.commands.client import HttpTarget
from app.commands.demo import locate_all
from app.commands.scores import Scores
from app.evaluation.dataset import is_dataset
from app.evaluation.passes import cut_windows, load_test_drives

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "santa_monica_att"

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.real_data,
    pytest.mark.skipif(not is_dataset(DATA), reason=f"the measurements are not at {DATA}"),
]


@pytest.fixture(scope="module")
def service(start_service):
    """A service with the survey passes in and the map built, by the console command."""
    url = start_service()
    done = subprocess.run(
        [sys.executable, "-m", "app", "import", str(DATA), "--url", url],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "148" in done.stdout
    with HttpTarget(url) as target:
        yield target


def test_later_drives_are_found_on_their_streets(service):
    """Windows of 200 m: road right 96 %, median error 10 m, direction right 93 %."""
    windows = cut_windows(load_test_drives(DATA), 300, length_m=200.0, seed=2024)
    scores = Scores.of(locate_all(service, windows))
    assert scores.road_right >= 0.96, scores
    assert scores.median_error_m <= 10.0, scores
    assert scores.direction_right >= 0.93, scores


def test_importing_again_changes_nothing(service):
    """Every pass is recognised, and no survey is stored a second time."""
    before = survey_count(service.url)
    command = [sys.executable, "-m", "app", "import", str(DATA), "--url", service.url, "--no-build"]
    again = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert again.returncode == 0, again.stdout + again.stderr
    assert "stored by an earlier import │ 148" in again.stdout
    assert survey_count(service.url) == before == 148


def survey_count(url: str) -> int:
    return len(httpx.get(f"{url}/v1/surveys", params={"limit": 1000}).json()["surveys"])
