"""Laws of the doctor's counting: motion, positions, cells and ground of simulated drives."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from app.domain import Trace
from app.numerics import ground as ground_module
from app.numerics.drive_quality import motion_of
from app.numerics.ground import Ground
from app.numerics.tally import Tally
from tests.factories import FRAME

START = datetime(2021, 5, 8, 10, tzinfo=UTC)


def drive(
    x_m,
    y_m,
    *,
    seconds: float = 1.0,
    start: datetime | None = START,
    cells: int = 3,
    device: str | None = None,
    decimals: int | None = None,
) -> Trace:
    """A drive through these metres, a sample each ``seconds``."""
    x_m, y_m = np.broadcast_arrays(np.asarray(x_m, float), np.asarray(y_m, float))
    place = FRAME.to_lonlat(x_m, y_m)
    lon, lat = np.asarray(place.lon), np.asarray(place.lat)
    if decimals is not None:
        lon, lat = np.round(lon, decimals), np.round(lat, decimals)
    rsrp = np.full((len(x_m), cells), -90.0, np.float32)
    rsrp[:, 0] += np.arange(len(x_m)) % 7
    return Trace(
        cells=tuple(f"850:{k}" for k in range(cells)),
        time_s=seconds * np.arange(len(x_m)),
        lon=lon,
        lat=lat,
        rsrp_dbm=rsrp,
        device=device,
        recorded_at=start,
    )


ALONG = np.arange(0.0, 2000.0, 10.0)


def checkup(*drives: Trace):
    tally = Tally()
    for one in drives:
        tally.add(one)
    found = tally.checkup()
    assert found is not None
    return found


def test_a_straight_drive_is_what_it_is():
    """Two kilometres at 10 m/s: way, time, speed, pace, no stop, no jump."""
    found = checkup(drive(ALONG, 0.0))
    assert found.kilometres == pytest.approx(1.99, abs=0.03)
    assert found.hours == pytest.approx(199 / 3600)
    assert found.speed_mps == pytest.approx(10.0, abs=0.2)
    assert (found.interval_s, found.jumps, found.drives, found.days) == (1.0, 0, 1, 1)
    assert found.standing < 0.02
    assert found.ground.length_m == pytest.approx(2000.0, rel=0.03)
    assert found.ground.once == 1.0


def test_a_stop_is_time_and_no_way():
    """Jitter of a standing car is not driven."""
    rng = np.random.default_rng(5)
    stop = np.full(200, 1000.0)
    x = np.concatenate([ALONG[:100], stop, ALONG[100:]])
    noise = rng.normal(0.0, 0.3, (2, len(x)))
    found = checkup(drive(x + noise[0], noise[1]))
    assert found.standing == pytest.approx(0.5, abs=0.03)
    assert found.kilometres == pytest.approx(2.0, abs=0.06)


def test_jumps_are_counted_and_not_driven():
    """A fix three kilometres off is two impossible steps."""
    x = ALONG.copy()
    x[50] += 3000.0
    found = checkup(drive(x, 0.0))
    assert found.jumps == 2
    assert found.kilometres == pytest.approx(2.0, abs=0.06)


def test_jitter_is_measured_across_the_way():
    """Independent errors of 6 m are found within a fifth."""
    rng = np.random.default_rng(7)
    found = checkup(drive(ALONG, rng.normal(0.0, 6.0, len(ALONG))))
    assert found.jitter_m == pytest.approx(6.0, rel=0.2)


@pytest.mark.parametrize("decimals", [3, 4, 5, 6])
def test_rounding_is_seen(decimals):
    """Fewest decimals that the values need; unrounded ones need more than seven."""
    slanted = drive(ALONG, 0.3 * ALONG, decimals=decimals)
    assert checkup(slanted).decimals == (decimals, decimals)
    assert checkup(drive(ALONG, 0.3 * ALONG)).decimals == (8, 8)


def test_driving_again_is_seen_by_count_day_and_direction():
    """Same way twice, another day, the other way; some metres beside each other."""
    later = START + timedelta(days=1)
    once = checkup(drive(ALONG, 0.0))
    twice = checkup(drive(ALONG, 0.0), drive(ALONG, 6.0))
    assert (once.ground.once, twice.ground.once) == (1.0, 0.0)
    assert (twice.ground.few, twice.ground.several_days, twice.ground.both_ways) == (1.0, 0.0, 0.0)
    another_day = checkup(drive(ALONG, 0.0), drive(ALONG, 6.0, start=later))
    assert another_day.ground.several_days == 1.0
    back = checkup(drive(ALONG, 0.0), drive(ALONG[::-1], 6.0))
    assert back.ground.both_ways == pytest.approx(1.0, abs=0.02)
    five = checkup(*(drive(ALONG, 0.0) for _ in range(5)))
    assert five.ground.often == 1.0
    assert five.ground.length_m == pytest.approx(2000.0, rel=0.03)


def test_a_drive_that_turns_back_drives_twice_itself():
    """There and back in one drive are two visits, both ways, and one length of ground."""
    found = checkup(drive(np.concatenate([ALONG, ALONG[::-1]]), 0.0))
    assert found.ground.few == pytest.approx(1.0, abs=0.15)  # but the end, where it turned
    assert found.ground.both_ways == pytest.approx(1.0, abs=0.15)
    assert found.ground.length_m == pytest.approx(2000.0, rel=0.1)


def test_the_order_of_drives_moves_no_share():
    """Whoever came first."""
    rng = np.random.default_rng(3)
    drives = [
        drive(ALONG + 500.0 * k, rng.normal(0, 2, len(ALONG)), start=START + timedelta(days=k))
        for k in range(4)
    ]
    first, second = checkup(*drives).ground, checkup(*drives[::-1]).ground
    assert first.length_m == pytest.approx(second.length_m, rel=0.01)
    assert (first.once, first.few, first.several_days) == (
        second.once, second.few, second.several_days,
    )  # fmt: skip


def test_old_and_young_ground_are_one(monkeypatch):
    """However often squares are merged, the answer is the same."""
    drives = [drive(ALONG + 300.0 * k, 0.0) for k in range(6)]
    before = checkup(*drives).ground
    monkeypatch.setattr(ground_module, "YOUNG_SQUARES", 50)
    assert checkup(*drives).ground == before


def test_cells_and_levels_are_counted():
    """Cells a sample, whole decibels or finer, weakest and strongest."""
    alone, several = checkup(drive(ALONG, 0.0, cells=1)), checkup(drive(ALONG, 0.0, cells=4))
    assert (alone.serving_only, alone.cells_per_sample, alone.cells) == (1.0, 1.0, 1)
    assert (several.serving_only, several.cells_per_sample) == (0.0, 4.0)
    assert several.rsrp_dbm == pytest.approx((-90.0, -90.0, -84.0))
    assert several.rsrp_step_db == 1.0
    fine = drive(ALONG, 0.0)
    shifted = replace(fine, rsrp_dbm=fine.rsrp_dbm + np.float32(0.3))
    assert checkup(shifted).rsrp_step_db == 0.1


def test_drives_at_one_time_are_several_devices():
    """Overlapping times are told; drives after each other are not."""
    two = checkup(drive(ALONG, 0.0, device="a"), drive(ALONG, 4.0, device="b"))
    assert (two.overlapping, two.devices) == (1, 2)
    later = START + timedelta(hours=1)
    assert checkup(drive(ALONG, 0.0), drive(ALONG, 0.0, start=later)).overlapping == 0


def test_drives_without_a_date_are_of_no_day():
    """And count as one day together."""
    found = checkup(drive(ALONG, 0.0, start=None), drive(ALONG, 0.0, start=None))
    assert (found.days, found.undated, found.first) == (0, 2, None)
    assert found.ground.several_days == 0.0


def test_nothing_has_no_checkup():
    """Before the first drive."""
    assert Tally().checkup() is None
    assert Ground().summary().length_m == 0.0


def test_two_samples_are_a_drive():
    """The shortest that an importer gives."""
    found = checkup(drive(ALONG[:2], 0.0))
    assert found.samples == 2
    assert found.jitter_m is None


def test_a_silence_is_no_way():
    """Ten minutes and a kilometre without a fix are neither driven nor ground."""
    one = drive(ALONG, 0.0)
    time_s = one.time_s + np.where(np.arange(len(ALONG)) >= 100, 600.0, 0.0)
    lon = FRAME.to_lonlat(ALONG + np.where(np.arange(len(ALONG)) >= 100, 1000.0, 0.0), 0.0).lon
    found = motion_of(time_s, np.asarray(lon), one.lat)
    assert found.travelled_m == pytest.approx(1980.0, abs=40.0)
    assert found.driven_s < 200.0
    assert len(found.paths) == 2
