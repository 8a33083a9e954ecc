"""Jitter of a receiver is taken out of a drive's progress, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from app.numerics.smoothing import MIN_FIXES, smooth_chainage


def steady(count: int) -> np.ndarray:
    """A car at 6 to 12 m/s that hardly accelerates, its speed each second."""
    return 9.0 + 3.0 * np.sin(np.arange(float(count)) / 15.0)


def stop_and_go(count: int) -> np.ndarray:
    """A car that brakes from 10 m/s at 1.5 m/s^2 and stands for 12 s, again and again."""
    brake = 10.0 - 1.5 * np.arange(7)
    once = np.concatenate([np.full(15, 10.0), brake, np.zeros(12), brake[::-1]])
    return np.resize(once, count)


def drive(seed: int, jitter_m: float, count: int = 120, speed=steady):
    """A car's progress, a fix a second, with the fixes' errors along and across the road."""
    rng = np.random.default_rng(seed)
    speed_mps = speed(count)
    truth_m = np.concatenate([[0.0], np.cumsum((speed_mps[1:] + speed_mps[:-1]) / 2.0)])
    along_m, across_m = rng.normal(0.0, jitter_m, (2, count))
    return truth_m, truth_m + along_m, across_m, np.arange(float(count))


@pytest.mark.parametrize("jitter_m", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("speed", [steady, stop_and_go])
def test_jitter_shrinks_however_the_car_drives(speed, jitter_m):
    """Smoothing takes at least a third off white jitter: on steady drives and from stop to stop."""
    errors_m = []
    for seed in range(8):
        truth_m, chainage_m, offset_m, time_s = drive(seed, jitter_m, speed=speed)
        errors_m.append(smooth_chainage(chainage_m, offset_m, time_s).chainage_m - truth_m)
    assert np.sqrt(np.mean(np.square(errors_m))) < jitter_m * 2 / 3


def test_a_steady_speed_shows_through_strong_jitter():
    """Where the speed hardly changes, all but a third of the jitter goes, whatever its size."""
    for jitter_m in (1.0, 3.0):
        errors_m = []
        for seed in range(8):
            constant = lambda count: np.full(count, 25.0 / 3.0)  # noqa: E731
            truth_m, chainage_m, offset_m, time_s = drive(seed, jitter_m, speed=constant)
            errors_m.append(smooth_chainage(chainage_m, offset_m, time_s).chainage_m - truth_m)
        assert np.sqrt(np.mean(np.square(errors_m))) < jitter_m / 3.0


def test_a_quiet_receiver_is_left_alone():
    """Where fixes lie within half a metre of a smooth path nothing is changed, bit by bit."""
    _, chainage_m, offset_m, time_s = drive(1, 0.2)
    np.testing.assert_array_equal(
        smooth_chainage(chainage_m, offset_m, time_s).chainage_m, chainage_m
    )


def test_few_fixes_are_left_alone():
    """Too few fixes to tell jitter from driving stay as they are."""
    _, chainage_m, offset_m, time_s = drive(2, 4.0, count=MIN_FIXES - 1)
    np.testing.assert_array_equal(
        smooth_chainage(chainage_m, offset_m, time_s).chainage_m, chainage_m
    )


def test_driving_back_mirrors_the_smoothing():
    """Falling chainages are smoothed as growing ones."""
    _, chainage_m, offset_m, time_s = drive(3, 4.0)
    there = smooth_chainage(chainage_m, offset_m, time_s).chainage_m
    back = smooth_chainage(1000.0 - chainage_m, offset_m, time_s).chainage_m
    np.testing.assert_allclose(back, 1000.0 - there, atol=1e-6)


@pytest.mark.parametrize("speed", [steady, stop_and_go])
def test_the_doubt_is_as_large_as_the_error(speed):
    """By some third, for jitters from one metre to four; nothing smoothed, nothing doubted."""
    for jitter_m in (1.0, 2.0, 4.0):
        errors_m, doubts_m = [], []
        for seed in range(8):
            truth_m, chainage_m, offset_m, time_s = drive(seed, jitter_m, speed=speed)
            smooth = smooth_chainage(chainage_m, offset_m, time_s)
            errors_m.append(smooth.chainage_m - truth_m)
            doubts_m.append(smooth.doubt_m)
        error_m = float(np.sqrt(np.mean(np.square(errors_m))))
        assert np.mean(doubts_m) == pytest.approx(error_m, rel=0.35)
    _, chainage_m, offset_m, time_s = drive(1, 0.1)
    assert smooth_chainage(chainage_m, offset_m, time_s).doubt_m == 0.0


def test_a_steady_drive_at_uneven_times_stays_straight():
    """Progress at a constant speed has no acceleration to change, however uneven the fixes."""
    rng = np.random.default_rng(4)
    time_s = np.cumsum(rng.uniform(0.2, 2.0, 60))
    smooth = smooth_chainage(8.0 * time_s, rng.normal(0.0, 3.0, 60), time_s)
    np.testing.assert_allclose(smooth.chainage_m, 8.0 * time_s, atol=1e-5)


def test_samples_of_one_moment_stay_together():
    """Fixes that carry the same time get the same place."""
    _, chainage_m, offset_m, time_s = drive(5, 4.0)
    smooth_m = smooth_chainage(
        np.repeat(chainage_m, 2), np.repeat(offset_m, 2), np.repeat(time_s, 2)
    ).chainage_m
    np.testing.assert_array_equal(smooth_m[::2], smooth_m[1::2])
    once_m = smooth_chainage(chainage_m, offset_m, time_s).chainage_m
    np.testing.assert_allclose(smooth_m[::2], once_m)
