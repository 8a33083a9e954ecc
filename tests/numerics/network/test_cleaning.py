"""A cleaned drive holds what was driven: no jumps, no standing about, no guesses over gaps."""

from __future__ import annotations

import numpy as np
import pytest

from app.numerics.network.cleaning import clean
from app.numerics.network.steps import STEP_M
from tests.numerics.network.towns import way

STREET = way((0.0, 0.0), (900.0, 0.0))


def seconds(places: np.ndarray) -> np.ndarray:
    return np.arange(len(places), dtype=float)


def test_a_straight_drive_is_one_piece_of_its_length():
    """Without any error the piece is the way itself, in even steps."""
    (piece,) = clean(7, STREET, seconds(STREET))
    assert piece.drive == 7
    assert piece.length_m == pytest.approx(900.0, abs=STEP_M)
    np.testing.assert_allclose(piece.xy_m[:, 1], 0.0, atol=1e-6)


def test_steps_are_even_and_samples_grow():
    """Every step is as long as the next, and time does not run backwards."""
    rng = np.random.default_rng(11)
    noisy = STREET + rng.normal(0.0, 4.0, STREET.shape)
    (piece,) = clean(0, noisy, seconds(noisy))
    assert np.all(np.diff(piece.sample) >= 0.0)
    assert np.hypot(*np.diff(piece.xy_m, axis=0).T).max() <= STEP_M + 1e-6


@pytest.mark.parametrize("jump_m", [(0.0, 90.0), (400.0, -700.0), (3000.0, 3000.0)])
@pytest.mark.parametrize("lasts", [1, 4])
def test_a_jump_and_back_leaves_no_trace(jump_m, lasts):
    """Some fixes far off, at once or for some seconds, move nothing."""
    wild = STREET.copy()
    wild[40 : 40 + lasts] += jump_m
    (piece,) = clean(0, wild, seconds(wild))
    assert np.abs(piece.xy_m[:, 1]).max() < 1.0
    assert piece.length_m == pytest.approx(900.0, abs=10.0)


def test_a_jump_at_the_very_start_is_dropped():
    """The first fix of a receiver is often its last one of yesterday."""
    late = np.concatenate([[[5000.0, 5000.0]], STREET])
    (piece,) = clean(0, late, seconds(late))
    assert piece.xy_m[0] == pytest.approx([0.0, 0.0], abs=2.0)


def test_a_standing_car_does_not_travel():
    """Two minutes at a light with 3 m of jitter add less than a car's length or two."""
    rng = np.random.default_rng(5)
    stop = np.full((120, 2), STREET[50]) + rng.normal(0.0, 3.0, (120, 2))
    stood = np.concatenate([STREET[:50], stop, STREET[50:]])
    (piece,) = clean(0, stood, seconds(stood))
    assert piece.length_m == pytest.approx(900.0, abs=15.0)
    assert piece.sample[-1] == len(stood) - 1


def test_a_crawling_car_travels():
    """At 1.2 m/s in a jam every sample is where it was, to some metres."""
    crawl = way((0.0, 0.0), (300.0, 0.0), every_m=1.2)
    (piece,) = clean(0, crawl, seconds(crawl))
    at_m = np.interp(np.arange(len(crawl)), piece.sample, piece.xy_m[:, 0])
    assert np.abs(at_m - crawl[:, 0]).max() < 8.0


def test_a_gap_cuts_the_drive():
    """Nobody knows the way over 400 m without a fix: two pieces, nothing between."""
    far = np.concatenate([STREET[:30], STREET[75:]])
    time_s = np.concatenate([seconds(STREET)[:30], seconds(STREET)[75:]])
    pieces = clean(0, far, time_s)
    assert len(pieces) == 2
    assert sum(piece.length_m for piece in pieces) < 520.0


def test_a_receiver_that_reports_rarely_is_followed_all_the_same():
    """A fix each 12 s, 110 m apart, is no drive full of gaps."""
    rare = STREET[::12]
    (piece,) = clean(0, rare, seconds(STREET)[::12])
    assert piece.length_m > 850.0


def test_a_drive_that_stands_is_none():
    """Jitter alone makes no piece."""
    rng = np.random.default_rng(3)
    assert clean(0, rng.normal(0.0, 4.0, (300, 2)), np.arange(300.0)) == []


def test_rounded_coordinates_make_no_stairs():
    """A slanting road whose latitudes are rounded to 11 m is as long as it is."""
    slanting = way((0.0, 0.0), (1500.0, 260.0))
    rounded = slanting.copy()
    rounded[:, 1] = np.round(rounded[:, 1] / 11.1) * 11.1
    (piece,) = clean(0, rounded, seconds(rounded))
    assert piece.length_m == pytest.approx(np.hypot(1500.0, 260.0), rel=0.01)


@pytest.mark.parametrize("count", [1, 2])
def test_hardly_any_samples_are_no_piece(count):
    """One or two fixes in a place say nothing, and break nothing."""
    assert clean(0, np.zeros((count, 2)), np.arange(float(count))) == []
