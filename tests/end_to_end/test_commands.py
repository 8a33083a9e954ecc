"""The client-side commands against a real map: on the data folder, and over HTTP."""

from __future__ import annotations

import csv
import subprocess
import sys
from dataclasses import replace

import numpy as np
import orjson
import pytest

from app.commands.client import HttpTarget
from app.commands.target import Refused, survey_document, window_document
from app.domain import Direction
from app.evaluation.dataset import write_dataset
from app.evaluation.scenario import build_city, drive, preset, windows
from app.evaluation.simulated import city_passes

from .conftest import running_service

pytestmark = pytest.mark.end_to_end

CITY = build_city(preset("paper"), 31)


def roadprint(*words, timeout_s=120):
    command = [sys.executable, "-m", "app", *(str(word) for word in words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A data folder with the map of the paper's area, made without any service."""
    files = tmp_path_factory.mktemp("files") / "area"
    write_dataset(files, (truth.road for truth in CITY.roads), city_passes(CITY))
    store = tmp_path_factory.mktemp("data") / "store"
    done = roadprint("import", files, "--data", store)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "map version 1 is ready (4 roads)" in done.stdout
    return store


@pytest.fixture(scope="module")
def service(folder):
    with running_service(folder) as url, HttpTarget(url) as target:
        yield target


@pytest.fixture
def window_file(tmp_path):
    window, truth = windows(CITY, 1)[0]
    path = tmp_path / "window.json"
    path.write_bytes(orjson.dumps(window_document(window)))
    return path, truth


def test_a_window_is_located_on_the_folder_as_over_http(folder, service, window_file):
    """The very same answer, and close to the truth."""
    path, truth = window_file
    local = roadprint("locate", path, "--data", folder, "--json")
    remote = roadprint("locate", path, "--url", service.url, "--json")
    assert local.returncode == remote.returncode == 0, local.stderr + remote.stderr
    fix = orjson.loads(remote.stdout)
    assert orjson.loads(local.stdout) == fix
    assert fix["road"]["id"] == truth.road_id
    assert fix["position"]["chainage_m"] == pytest.approx(truth.chainage_m, abs=3.0)
    exact = roadprint("locate", path, "--data", folder, "--distance-error", "0", "--json")
    assert orjson.loads(exact.stdout)["accuracy_m"] < fix["accuracy_m"]
    wrong = roadprint("locate", path, "--data", folder, "--distance-error", "3")
    assert wrong.returncode == 1
    assert "/distance_error" in wrong.stderr


def test_the_end_of_a_drive_is_located(service, tmp_path):
    """A tidy CSV of a whole drive: its last metres are the window."""
    trace = drive(CITY, "road-north", Direction.BACKWARD)
    path = tmp_path / "drive.csv"
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", "lon", "lat", "cell_id", "rsrp_dbm"])
        for i, k in zip(*np.nonzero(np.isfinite(trace.rsrp_dbm)), strict=True):
            place = (trace.time_s[i], trace.lon[i], trace.lat[i])
            rows.writerow([*place, trace.cells[k], trace.rsrp_dbm[i, k]])
    done = roadprint("locate", path, "--url", service.url)
    assert done.returncode == 0, done.stderr
    assert "road-north" in done.stdout
    assert "backward" in done.stdout


def test_a_bad_window_is_refused_with_its_place(folder, service, window_file):
    """Exit code 1 and the pointer, over HTTP and on the folder."""
    path, _ = window_file
    document = orjson.loads(path.read_bytes())
    document["distance_m"][3] = -5.0
    path.write_bytes(orjson.dumps(document))
    for where in (("--url", service.url), ("--data", folder)):
        done = roadprint("locate", path, *where)
        assert done.returncode == 1
        assert "/distance_m/3" in done.stderr


def test_a_window_without_any_map_is_said_plainly(tmp_path, window_file):
    """An empty folder has no map."""
    done = roadprint("locate", window_file[0], "--data", tmp_path / "empty")
    assert done.returncode == 1
    assert "no-map" in done.stderr


def test_a_road_is_built_anew(service):
    """`roadprint build --road-id` makes the next version; an unknown road is refused."""
    done = roadprint("build", "--road-id", "road-west", "--url", service.url)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "map version 2 is ready (1 roads)" in done.stdout
    unknown = roadprint("build", "--road-id", "nowhere", "--url", service.url)
    assert unknown.returncode == 1
    assert "nowhere" in unknown.stderr


def test_progress_of_a_build_moves(service):
    """The followed states count up to the end and the last one is finished."""
    seen = list(service.follow(service.request_build(None).build_id))
    assert seen[-1].status == "successful"
    assert seen[-1].roads_done == seen[-1].roads_total == 4
    done = [view.roads_done for view in seen]
    assert done == sorted(done)


def test_a_refusal_carries_the_services_words(service):
    """The problem's code and pointers reach the user."""
    trace = replace(drive(CITY, "road-east"), road_id="road-east")
    document = survey_document(trace)
    document["time_s"][5] = -1.0
    with pytest.raises(Refused, match="/time_s/5") as refused:
        service.post_survey(document, None)
    assert refused.value.code == "invalid-input"
