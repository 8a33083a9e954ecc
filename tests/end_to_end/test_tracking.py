"""A vehicle tracked over HTTP along a simulated area, by one odometer and round a corner."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from app.commands.client import HttpTarget
from app.commands.demo import survey_and_build
from app.commands.target import window_document
from app.evaluation.scenario import build_city, preset
from app.evaluation.scenario.tours import Leg, tour_of
from app.numerics.lines import point_at

pytestmark = pytest.mark.end_to_end

SEED = 11
LENGTH_M = 30.0
CORNER = (Leg("road-south", 100.0, 400.0), Leg("road-east", 0.0, 300.0))


@pytest.fixture(scope="module")
def city():
    """Two cells, so that a window alone is often in two places."""
    return build_city(replace(preset("paper"), cells=2), SEED)


@pytest.fixture(scope="module")
def service(start_service, city):
    """A service with the area's map."""
    with HttpTarget(start_service()) as target:
        survey_and_build(target, city)
        yield target


def followed(service, tour, step_m: float, **way):
    """Errors in metres and roads right of a tour's windows, and those of the windows alone."""
    state, errors, right, alone = None, [], [], []
    for end_m in np.arange(LENGTH_M, tour.travelled_m[-1], step_m):
        last = int(np.searchsorted(tour.travelled_m, end_m, side="right")) - 1
        first = max(last - int(LENGTH_M), 0)
        window = tour.window(first, last)
        document = window_document(window)
        leg = tour.legs[tour.leg[last]]
        alone.append(is_right(service.locate(document), leg))
        document["distance_m"] = tour.travelled_m[first : last + 1].tolist()
        fix = service.locate({**document, "state": state, **way})
        state = fix["state"]
        right.append(is_right(fix, leg))
        if right[-1]:
            errors.append(abs(fix["position"]["chainage_m"] - tour.chainage_m[last]))
    return errors, right, alone


def is_right(fix, leg: Leg) -> bool:
    """Road and direction are those driven."""
    way = "forward" if leg.sign > 0 else "backward"
    return fix["status"] == "located" and (
        (fix["road"]["id"], fix["position"]["direction"]) == (leg.road_id, way)
    )


@pytest.mark.parametrize("step_m", [10.0, 30.0])
def test_a_vehicle_is_followed_round_a_corner(service, city, step_m: float):
    """Overlapping or back to back: at least as often right as alone, and to a metre."""
    errors, right, alone = followed(service, tour_of(city, *CORNER), step_m)
    assert np.mean(right[1:]) >= 0.97
    assert np.mean(right) >= np.mean(alone)
    assert np.median(errors) <= 1.0


def test_the_console_follows_a_drive(service, city, tmp_path):
    """`roadprint locate --track` prints a line a window of a drive's CSV."""
    tour = tour_of(city, Leg("road-north", 20.0, 381.0))
    line = city.by_id["road-north"].line
    drive = tmp_path / "drive.csv"
    drive.write_text(csv_of(tour, line))
    command = [sys.executable, "-m", "app", "locate", str(drive), "--track", "--length-m", "40"]
    done = subprocess.run(
        [*command, "--json", "--url", service.url],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    fixes = json.loads(done.stdout)
    assert len(fixes) == 9
    assert all(fix["road"]["id"] == "road-north" for fix in fixes[1:])
    table = subprocess.run(
        [*command, "--url", service.url], capture_output=True, text=True, timeout=60, check=True
    )
    assert table.stdout.count("road-north") >= 8


def csv_of(tour, line) -> str:
    """A tidy CSV of a tour along one road."""
    place = point_at(line, tour.chainage_m)
    rows = ["time_s,lon,lat,cell_id,rsrp_dbm"]
    for i in range(len(tour.travelled_m)):
        for cell, level in zip(tour.cells, tour.rsrp_dbm[i], strict=True):
            if not np.isnan(level):
                rows.append(f"{i},{place.lon[i]:.8f},{place.lat[i]:.8f},{cell},{level:.1f}")
    return "\n".join(rows) + "\n"
