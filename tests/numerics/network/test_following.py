"""Map matching: the roads that a drive went along, not those that lie nearest for a moment."""

from __future__ import annotations

import numpy as np
import pytest

from app.numerics.network.cleaning import clean
from app.numerics.network.following import OFF_ROAD, Network
from app.numerics.network.stretches import passes_of
from tests.numerics.network.towns import way

MAIN = np.array([[0.0, 0.0], [600.0, 0.0]])
SIDE = np.array([[300.0, -300.0], [300.0, 300.0]])
FRONTAGE = np.array([[0.0, 30.0], [600.0, 30.0]])


def followed(lines, *corners, seed=1, noise_m=4.0):
    rng = np.random.default_rng(seed)
    places = way(*corners)
    places += rng.normal(0.0, noise_m, places.shape)
    (piece,) = clean(0, places, np.arange(len(places), dtype=float))
    return piece, Network(lines).follow(piece.xy_m)


@pytest.mark.parametrize("seed", range(5))
def test_a_crossing_is_driven_over(seed):
    """On the main street the side street is not entered for a moment."""
    piece, along = followed([MAIN, SIDE], (0.0, 0.0), (600.0, 0.0), seed=seed)
    assert set(along.road.tolist()) == {0}
    (one,) = passes_of(piece, along)
    assert (one.road, one.first) == (0, 0)
    assert one.end == 68


@pytest.mark.parametrize("seed", range(5))
def test_a_turn_is_a_pass_on_either_road(seed):
    """The main street to the crossing, then the side street."""
    corners = ((0.0, 0.0), (300.0, 0.0), (300.0, 300.0))
    piece, along = followed([MAIN, SIDE], *corners, seed=seed)
    passes = passes_of(piece, along)
    assert [one.road for one in passes] == [0, 1]
    assert passes[0].end == pytest.approx(34, abs=3)
    assert passes[1].first == pytest.approx(34, abs=3)


@pytest.mark.parametrize("seed", range(5))
def test_a_parallel_road_is_not_hopped_to(seed):
    """With 8 m of noise a drive stays on its road though another runs 30 m beside it."""
    _, along = followed([MAIN, FRONTAGE], (0.0, 0.0), (600.0, 0.0), seed=seed, noise_m=8.0)
    assert set(along.road.tolist()) == {0}


def test_off_every_road_is_on_none():
    """A field 200 m from the street is no street."""
    _, along = followed([MAIN], (0.0, 0.0), (200.0, 0.0), (200.0, 400.0), (400.0, 400.0))
    assert OFF_ROAD in along.road[60:].tolist()
    assert np.all(np.isnan(along.chainage_m[along.road == OFF_ROAD]))


def test_turning_round_on_the_road_makes_two_passes():
    """Each pass goes one way."""
    piece, along = followed([MAIN], (50.0, 0.0), (500.0, 0.0), (100.0, 0.0), noise_m=1.0)
    passes = passes_of(piece, along)
    assert len(passes) == 2
    assert passes[0].end == pytest.approx(51, abs=4)
    assert passes[1].first == pytest.approx(50, abs=4)


def test_a_short_visit_is_no_pass():
    """Thirty metres of a road hold no window."""
    piece, along = followed([MAIN], (570.0, 0.0), (640.0, 0.0), (640.0, 500.0), noise_m=0.1)
    assert passes_of(piece, along) == []


def test_chainages_are_those_of_the_road():
    """On a road without noise the chainage grows as the way does."""
    piece, along = followed([MAIN], (100.0, 0.0), (400.0, 0.0), noise_m=1e-6)
    np.testing.assert_allclose(along.chainage_m, piece.xy_m[:, 0], atol=0.01)


def test_no_roads_is_no_match():
    """An empty network has nothing to follow."""
    _, along = followed([], (0.0, 0.0), (300.0, 0.0))
    assert set(along.road.tolist()) == {OFF_ROAD}
