"""Two scales lose nothing: `locate` is `locate_exhaustively`, and both are right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Direction, Window
from app.evaluation.scenario import drive, windows
from app.numerics import odometer_prior
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.matching import locate, shortlist
from app.numerics.query import ask
from tests.factories import line_at, model_of
from tests.numerics.cities import (
    city_of,
    error_m,
    index_of,
    index_with,
    models_of,
    thinned,
    with_gaps,
    with_strangers,
)
from tests.numerics.tiny import map_of

NEAR_AN_END_M = 4.0
ROUNDING_M = 1e-4  # of sums of float32 in two orders, in C and in numpy


def mixed(cells: int, length_m: float, count: int):
    """Windows of one length: whole, irregular, with gaps, with strangers, with all of it."""
    every = windows(city_of(cells=cells), count, length_m=length_m)
    changes = (
        lambda one, _: one,
        thinned,
        with_gaps,
        with_strangers,
        lambda one, seed: with_strangers(with_gaps(thinned(one, seed), seed), seed),
    )
    return [changes[i % len(changes)](one, i) for i, one in enumerate(every)]


def compared(index, labelled):
    """Both answers to every window, and whether the answer lies near an end of its road."""
    for window, _ in labelled:
        fast, slow = locate(index, window), locate_exhaustively(index, window)
        assert fast.road_posterior == pytest.approx(slow.road_posterior, abs=1e-3)
        assert fast.off_map_posterior == pytest.approx(slow.off_map_posterior, abs=1e-3)
        assert fast.cells_unknown == slow.cells_unknown
        if slow.candidates[0].posterior > 0.5:
            assert (fast.road_id, fast.direction) == (slow.road_id, slow.direction)
            length_m = index.roads[index.road_ids.index(slow.road_id)].length_m
            to_end_m = min(slow.chainage_m, length_m - slow.chainage_m)
            yield fast, slow, to_end_m < NEAR_AN_END_M


@pytest.mark.parametrize(
    ("cells", "length_m", "count"),
    [(6, 8.0, 60), (6, 30.0, 60), (6, 120.0, 30), (2, 30.0, 60), (2, 80.0, 30)],
)
def test_two_scales_are_the_exhaustive_answer(cells, length_m, count):
    """Same road, direction and place, probabilities within 0.001, for windows of every kind."""
    # What the coarse scale leaves out may move a broad peak's mean: 1e-4 of its mass by 15 m.
    within_m = 2e-3 if length_m < 30.0 else ROUNDING_M
    for fast, slow, at_an_end in compared(index_of(cells=cells), mixed(cells, length_m, count)):
        assert at_an_end or fast.chainage_m == pytest.approx(slow.chainage_m, abs=within_m)
        assert fast.accuracy_m == pytest.approx(slow.accuracy_m, rel=0.02, abs=0.1)


def test_two_scales_agree_on_impaired_drives():
    """With offsets, odometer errors, drift and a sample each 8 m the two scales agree as well."""
    many = windows(city_of("harsh"), 50, length_m=100.0)
    for fast, slow, at_an_end in compared(index_of("harsh"), many):
        assert at_an_end or fast.chainage_m == pytest.approx(slow.chainage_m, abs=ROUNDING_M)


def test_two_scales_agree_at_the_ends_of_roads():
    """Places within metres of a road's end are refined alike, too."""
    many = [
        one
        for length_m in (16.0, 30.0, 100.0)
        for one in windows(city_of(), 200, length_m=length_m)
        if one.truth.chainage_m < NEAR_AN_END_M
    ]
    assert many
    for fast, slow, _ in compared(index_of(), many):
        assert fast.chainage_m == pytest.approx(slow.chainage_m, abs=1e-6)


def test_six_cells_find_road_direction_and_place():
    """Windows of 30 m with 2 dB noise: roads and directions right, 0.6 m off on average."""
    index = index_of()
    found = [(locate(index, window), truth) for window, truth in windows(city_of(), 120)]
    errors_m = np.array([error_m(fix, truth) for fix, truth in found])
    assert np.mean(errors_m < 1000.0) >= 0.995
    assert errors_m.mean() <= 0.6
    assert np.mean([fix.direction is truth.direction for fix, truth in found]) >= 0.995


@pytest.mark.parametrize("direction", list(Direction))
def test_both_directions_are_right(direction):
    """Windows driven either way are told as driven that way, with the heading to match."""
    index = index_of()
    driven = [one for one in windows(city_of(), 80) if one.truth.direction is direction]
    assert len(driven) > 20
    for window, truth in driven:
        fix = locate(index, window)
        assert fix.direction is direction
        other = locate(index, Window(window.cells, window.distance_m, window.rsrp_dbm[::-1]))
        assert other.direction is not direction
        if other.road_id == fix.road_id:
            turn = (other.heading_deg - fix.heading_deg) % 360.0
            assert turn == pytest.approx(180.0, abs=1e-6)
        assert truth.road_id == fix.road_id


def test_zero_noise_gives_back_the_truth():
    """Without noise and steps, windows of 30 m are met within 0.3 m."""
    index, city = index_of("clean"), city_of("clean")
    errors_m = [error_m(locate(index, window), truth) for window, truth in windows(city, 60)]
    assert max(errors_m) < 0.3


@pytest.mark.parametrize("offset_db", [-5.0, 5.0])
def test_a_common_offset_is_returned_and_moves_little(offset_db):
    """Another device shifts half the positions by less than 0.5 m, and its offset is told."""
    index = index_of()
    moved_m, told_db = [], []
    for window, _ in windows(city_of(), 60, length_m=60.0):
        here = locate(index, window)
        there = locate(index, replace(window, rsrp_dbm=window.rsrp_dbm + offset_db))
        moved_m.append(error_m(there, here))
        told_db.append(there.device_offset_db - here.device_offset_db)
    assert np.median(moved_m) < 0.5
    assert np.median(told_db) == pytest.approx(offset_db, abs=1.0)


def test_one_sample_is_answered():
    """A window of one sample has an answer, less certain than that of 30 m."""
    index = index_of()
    for window, _ in windows(city_of(), 30):
        one = Window(window.cells, window.distance_m[-1:], window.rsrp_dbm[-1:])
        short, whole = locate(index, one), locate(index, window)
        assert short.samples_used == 1
        assert short.accuracy_m > whole.accuracy_m
        assert short.candidates[0].posterior < whole.candidates[0].posterior + 1e-9
        assert locate_exhaustively(index, one).road_posterior == pytest.approx(
            short.road_posterior, abs=1e-3
        )


def test_standing_still_tells_no_direction():
    """Where no distance was travelled both directions are as likely as each other."""
    index = index_of()
    for window, _ in windows(city_of(), 30):
        still = Window(window.cells, np.full(9, 40.0), np.repeat(window.rsrp_dbm[-1:], 9, axis=0))
        fix = locate(index, still)
        ways = {
            way: sum(
                one.posterior
                for one in fix.candidates
                if one.direction is way and one.road_id == fix.road_id
            )
            for way in Direction
        }
        assert ways[Direction.FORWARD] == pytest.approx(ways[Direction.BACKWARD], rel=0.2)


def test_standing_still_is_answered_both_ways():
    """A standing vehicle's candidates come both ways, with the true road among them."""
    index = index_of()
    for window, truth in windows(city_of(), 30):
        still = Window(window.cells, np.full(9, 40.0), np.repeat(window.rsrp_dbm[-1:], 9, axis=0))
        fix = locate(index, still)
        best = fix.candidates[0]
        ways = {
            one.direction
            for one in fix.candidates
            if (one.road_id, one.segment_index) == (best.road_id, best.segment_index)
        }
        assert ways == set(Direction)
        assert truth.road_id in {one.road_id for one in fix.candidates}


@pytest.mark.parametrize("direction", list(Direction))
def test_a_window_longer_than_its_road_is_answered(direction):
    """
    Of 750 m of readings the last 150 m lie on the road, which is found all the same, and the place
    on it as well as an odometer tells 150 m.
    """
    index, city = index_of(), city_of()
    for number, truth in enumerate(city.roads):
        trace = drive(city, truth.road_id, direction)
        rng = np.random.default_rng(number)
        elsewhere_dbm = rng.normal(-100.0, 6.0, (600, len(trace.cells)))
        rsrp_dbm = np.vstack([elsewhere_dbm, trace.rsrp_dbm[:151].astype(float)])
        fix = locate(index, Window(trace.cells, np.arange(751.0), rsrp_dbm))
        assert (fix.road_id, fix.direction) == (truth.road_id, direction)
        there_m = fix.chainage_m if direction is Direction.FORWARD else 400.0 - fix.chainage_m
        assert there_m == pytest.approx(150.0, rel=odometer_prior.SCALE_SD)
        assert fix.samples_used < 751


def test_no_known_cell_is_off_the_map():
    """A window of strangers only is off the map, and names them."""
    index = index_of()
    rng = np.random.default_rng(5)
    window = Window(("z:9", "q:1"), np.arange(20.0), rng.uniform(-110.0, -80.0, (20, 2)))
    fix = locate(index, window)
    assert fix.off_map
    assert fix.off_map_posterior > 0.99
    assert fix.cells_unknown == ("q:1", "z:9")
    assert fix.cells_used == 0
    assert sum(one.posterior for one in fix.candidates) == pytest.approx(
        1.0 - fix.off_map_posterior, abs=1e-9
    )


def test_silence_is_answered():
    """A window that heard nothing at all is off the map, not an error."""
    fix = locate(index_of(), Window(("x",), np.arange(5.0), np.full((5, 1), np.nan)))
    assert fix.off_map
    assert fix.cells_unknown == ()


def test_a_road_that_the_map_lacks_is_off_the_map():
    """Windows of a street whose model was left out are mostly told as off the map."""
    city, models = city_of(), models_of()
    for missing in (0, 2):
        index = index_with([model for i, model in enumerate(models) if i != missing])
        absent = city.roads[missing].road_id
        away, here = [], []
        for window, truth in windows(city, 80, length_m=60.0):
            (away if truth.road_id == absent else here).append(locate(index, window).off_map)
        assert np.mean(away) > 0.75
        assert np.mean(here) < 0.05


def test_a_road_left_out_leaves_the_others():
    """Also where no other road shares a tape with it or has heard any of the window's cells."""
    models = tuple(
        model_of(f"road-{i}", seed=i, line=line_at(900.0 * i, length_m=4000.0), cells=(cell,))
        for i, cell in enumerate("ab")
    )
    index = map_of(models)
    assert len(index.tapes) == 2
    query = ask(index, Window(("a",), np.arange(20.0), np.full((20, 1), -90.0)))
    assert set(shortlist(index, query, without=0).road.tolist()) == {1}
    assert set(shortlist(index, query, without=1).road.tolist()) == {0}


def test_confidence_widens_the_radius():
    """The radius at 95 % is larger than at 68 %, and the position is the same."""
    index = index_of(cells=2)
    for window, _ in windows(city_of(cells=2), 30):
        fixes = [locate(index, window, confidence=c) for c in (0.3, 0.68, 0.95, 0.99)]
        radii = [fix.accuracy_m for fix in fixes]
        assert radii == sorted(radii)
        assert radii[0] < radii[-1]
        assert len({fix.chainage_m for fix in fixes}) == 1
        assert [fix.confidence for fix in fixes] == [0.3, 0.68, 0.95, 0.99]


def test_the_fix_tells_one_story():
    """Road, sub-segment, direction and place of a fix fit each other and its candidates."""
    city = city_of(cells=2)
    index = index_of(cells=2)
    for window, _ in windows(city, 40):
        fix = locate(index, window)
        model = next(one for one in models_of(cells=2) if one.road_id == fix.road_id)
        segment = model.segments[fix.segment_index]
        assert (fix.segment_start_m, fix.segment_end_m) == (segment.start_m, segment.end_m)
        assert segment.start_m <= fix.chainage_m <= segment.end_m
        posteriors = [one.posterior for one in fix.candidates]
        assert posteriors == sorted(posteriors, reverse=True)
        assert sum(posteriors) + fix.off_map_posterior == pytest.approx(1.0, abs=1e-9)
        own = [one.posterior for one in fix.candidates if one.road_id == fix.road_id]
        assert sum(own) == pytest.approx(fix.road_posterior, abs=1e-6)
        keys = [(one.road_id, one.segment_index, one.direction) for one in fix.candidates]
        assert len(set(keys)) == len(keys)
        assert fix.samples_used == 31
        assert fix.cells_used == 2
