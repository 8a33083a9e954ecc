"""Windows cut from whole passes end where they say, and know no more than a vehicle would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Direction
from app.evaluation.dataset import BadDataset, write_dataset
from app.evaluation.passes import cut_windows, drive_of, load_test_drives
from app.evaluation.scenario import build_city, drive, preset
from app.evaluation.simulated import city_passes
from app.numerics.lines import point_at

CITY = build_city(preset("paper"), 12)
ROAD = CITY.roads[1]


def driven(direction=Direction.FORWARD):
    trace = drive(CITY, ROAD.road_id, direction)
    return drive_of(trace, ROAD.road_id, ROAD.line, direction)


@pytest.mark.parametrize("direction", list(Direction))
def test_windows_are_the_drives_own_samples(direction):
    """Readings, way and truth of a window are those of the drive up to its last sample."""
    whole = driven(direction)
    for window, truth in cut_windows([whole], 50, length_m=50.0, seed=1):
        last = int(np.argmin(np.abs(whole.chainage_m - truth.chainage_m)))
        first = last - len(window.distance_m) + 1
        columns = [whole.trace.cells.index(cell) for cell in window.cells]
        readings = whole.trace.rsrp_dbm[first : last + 1, columns]
        np.testing.assert_array_equal(window.rsrp_dbm, readings)
        assert truth.direction is direction
        assert window.distance_m[0] == 0.0
        assert 48.9 < window.distance_m[-1] <= 50.0 + 1e-9
        place = point_at(ROAD.line, truth.chainage_m)
        assert (truth.lon, truth.lat) == (float(place.lon), float(place.lat))


def test_a_standing_car_is_not_drawn_more_often():
    """Ends are even along the way: a minute at a light adds samples, not windows."""
    whole = driven()
    stand = np.repeat(
        np.arange(len(whole.chainage_m)), np.where(np.arange(len(whole.chainage_m)) == 200, 500, 1)
    )
    trace = whole.trace
    standing = replace(
        trace,
        time_s=np.arange(len(stand)) * 0.12,
        lon=trace.lon[stand],
        lat=trace.lat[stand],
        rsrp_dbm=trace.rsrp_dbm[stand],
    )
    stood = drive_of(standing, ROAD.road_id, ROAD.line, Direction.FORWARD)
    labelled = cut_windows([stood], 700, length_m=50.0, seed=2)
    ends_m = np.array([truth.chainage_m for _, truth in labelled])
    assert np.mean(np.abs(ends_m - 200.0) < 2.0) < 0.03
    assert all(np.all(np.diff(window.distance_m) >= 0) for window, _ in labelled)


def test_steps_back_do_not_count_as_way():
    """Position noise of a standing car adds nothing to the travelled distance."""
    whole = driven()
    shaken = replace(
        whole.trace, lat=whole.trace.lat + 2e-5 * np.sin(np.arange(len(whole.trace.lat)))
    )
    noisy = drive_of(shaken, ROAD.road_id, ROAD.line, Direction.FORWARD)
    assert np.all(np.diff(noisy.travelled_m) >= 0)
    assert noisy.travelled_m[-1] == pytest.approx(whole.travelled_m[-1], abs=5.0)


def test_same_seed_same_windows():
    """And another seed other ones."""
    ends = [
        [truth.chainage_m for _, truth in cut_windows([driven()], 20, length_m=30.0, seed=seed)]
        for seed in (3, 3, 4)
    ]
    assert ends[0] == ends[1] != ends[2]


def test_drives_too_short_are_refused():
    """The message has the number."""
    with pytest.raises(ValueError, match="500"):
        cut_windows([driven()], 1, length_m=500.0, seed=5)


def test_only_test_passes_are_drives(tmp_path):
    """Surveyed passes are never windows; each drive has its road and direction."""
    write_dataset(tmp_path, (truth.road for truth in CITY.roads), city_passes(CITY))
    drives = load_test_drives(tmp_path)
    assert len(drives) == 8
    assert [each.direction for each in drives[:2]] == list(Direction)
    assert all(each.travelled_m[-1] > 390.0 for each in drives)


def test_a_pass_on_a_road_without_line_is_refused(tmp_path):
    """The pass and the road are named."""
    write_dataset(tmp_path, (truth.road for truth in CITY.roads[:3]), city_passes(CITY))
    with pytest.raises(BadDataset, match="road-west"):
        load_test_drives(tmp_path)
