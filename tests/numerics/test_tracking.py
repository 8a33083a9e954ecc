"""Tracking: what one window leaves to the next sharpens it, and a track that is lost comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, Window
from app.evaluation.scenario.tours import Leg, tour_of
from app.numerics import matching, native, tracking
from app.numerics.belief import Belief, Mode
from app.numerics.calibration import UNTRIED
from app.numerics.index import MapIndex
from tests.numerics.cities import city_of, index_of
from tests.numerics.drives import follow_tour

ROADS = ("road-south", "road-east", "road-north", "road-west")


def sides(cells: int, number: int = 0):
    """A tour along each road of the square, both ways."""
    city = city_of(cells=cells)
    for place, road_id in enumerate(ROADS):
        for ends in ((10.0, 390.0), (390.0, 10.0)):
            yield tour_of(city, Leg(road_id, *ends), number=number + 10 * place)


def err_together(index: MapIndex) -> Calibration:
    """The map's, had its samples errors in common as on real streets."""
    said = {"information_once": 0.4, "information_each": 0.1, "off_map": UNTRIED.off_map}
    return replace(index.calibration, **said)


def total(tracked: tracking.Tracked) -> float:
    return sum(one.posterior for one in tracked.fix.candidates) + tracked.fix.off_map_posterior


def test_the_first_window_is_the_ordinary_fix():
    """To the last bit, by the kernels in C and without; its state is all that is new."""
    index = index_of(cells=2)
    for tour in list(sides(2))[:3]:
        window = tour.window(100, 130)
        for in_c in {False, native.BUILT}:
            first = tracking.begin(index, window, in_c=in_c)
            assert first.fix == matching.locate(index, window, in_c=in_c)


@pytest.mark.parametrize("cells", [1, 2])
def test_successive_windows_sharpen_ambiguous_ones(cells: int):
    """With one or two cells a window of 30 m is often in several places; a track is in one."""
    index = index_of(cells=cells)
    alone, tracked = [], []
    for tour in sides(cells):
        steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)
        for step in steps[3:]:
            window = tour.window(step.last - 30, step.last)
            fix = matching.locate(index, window, in_c=False)
            alone.append(fix.road_id == step.road_id and fix.direction.sign == step.sign)
            tracked.append(step.right)
    assert np.mean(tracked) >= np.mean(alone)
    assert np.mean(tracked) >= (0.9 if cells == 1 else 0.99)


def test_a_track_is_more_sure_of_the_truth_than_its_windows_are():
    """Averaged over drives the log probability of the true place grows."""
    index = index_of(cells=1)
    gains = []
    for tour in sides(1):
        steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)
        for step in steps[1:]:
            window = tour.window(step.last - 30, step.last)
            alone = replace(step, tracked=tracking.begin(index, window, in_c=False))
            truth = [max(one.posterior_at_truth(), 1e-3) for one in (step, alone)]
            gains.append(np.log(truth[0] / truth[1]))
    assert np.mean(gains) > 0.0


@pytest.mark.parametrize("step_m", [5.0, 12.0, 30.0])
def test_all_probabilities_sum_to_one(step_m: float):
    """However much the windows overlap, of the fix and of the belief it leaves."""
    index = index_of(cells=2)
    tour = next(sides(2))
    for step in follow_tour(index, tour, length_m=30.0, step_m=step_m):
        belief = step.tracked.belief
        assert total(step.tracked) == pytest.approx(1.0, abs=1e-9)
        whole = sum(one.weight for one in belief.modes) + belief.anywhere + belief.off_map
        assert whole == pytest.approx(1.0, abs=1e-9)


def test_standing_still_teaches_nothing():
    """The same window again, no metre farther, moves no probability and no position."""
    index = index_of(cells=1)
    tour = next(sides(1))
    window = tour.window(60, 90)
    first = tracking.begin(index, window, in_c=False)
    again = first
    for _ in range(20):
        again = tracking.follow(index, window, again.belief, 0.0, in_c=False)
    assert again.fix.road_posterior == pytest.approx(first.fix.road_posterior, abs=0.02)
    assert again.fix.chainage_m == pytest.approx(first.fix.chainage_m, abs=0.5)
    assert again.belief == first.belief


def test_what_was_heard_counts_once():
    """Windows that overlap make a track no surer than windows that do not."""
    index = index_of(cells=1)
    sure = {}
    for step_m in (6.0, 30.0):
        steps = [follow_tour(index, t, length_m=30.0, step_m=step_m)[-1] for t in sides(1)]
        sure[step_m] = np.mean([step.tracked.fix.road_posterior for step in steps])
    assert sure[6.0] <= sure[30.0] + 0.05


def test_a_turn_at_a_junction_is_followed():
    """Round three corners of the square, windows across the corners included."""
    index, city = index_of(cells=2), city_of(cells=2)
    tour = tour_of(
        city,
        Leg("road-south", 150.0, 400.0),
        Leg("road-east", 0.0, 400.0),
        Leg("road-north", 0.0, 400.0),
        Leg("road-west", 0.0, 200.0),
    )
    steps = follow_tour(index, tour, length_m=30.0, step_m=15.0)
    assert np.mean([step.right for step in steps[2:]]) >= 0.97
    assert np.median([step.error_m for step in steps]) <= 1.0


def test_a_u_turn_is_found_out():
    """Within a hundred metres of turning round amid a road the direction is right again."""
    index, city = index_of(cells=2), city_of(cells=2)
    tour = tour_of(city, Leg("road-south", 50.0, 250.0), Leg("road-south", 250.0, 20.0))
    steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)
    back = [step for step in steps if step.sign < 0]
    assert all(step.right for step in back[3:])


def test_a_lost_track_comes_back():
    """A belief that is surely on the wrong road is mended by what is heard."""
    index = index_of(cells=6)
    wrong = Belief((Mode(index.road_ids.index("road-north"), -1, 200.0, 1.0, 1.0),), 0.0, 0.0)
    for tour in list(sides(6))[:2]:
        belief = wrong
        for last in range(30, 331, 30):
            tracked = tracking.follow(index, tour.window(last - 30, last), belief, 30.0, in_c=False)
            belief = tracked.belief
        assert tracked.fix.road_id == tour.legs[0].road_id
        assert abs(tracked.fix.chainage_m - tour.chainage_m[330]) < 5.0


def test_an_unlikely_long_gap_begins_anew():
    """After kilometres unheard of, a belief says nothing of the place."""
    index = index_of(cells=6)
    wrong = Belief((Mode(1, 1, 100.0, 1.0, 1.0),), 0.0, 0.0)
    tour = next(sides(6))
    window = tour.window(100, 130)
    anew = tracking.follow(index, window, wrong, 50_000.0, in_c=False)
    alone = matching.locate(index, window, in_c=False)
    assert (anew.fix.road_id, anew.fix.direction) == (alone.road_id, alone.direction)
    assert anew.fix.chainage_m == pytest.approx(alone.chainage_m, abs=1.0)


def test_a_young_track_is_asked_as_one_window():
    """Until 400 m its fix is that of all readings so far; only being off the map is the track's."""
    index = index_of(cells=2)
    for tour in list(sides(2))[:3]:
        steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)
        joined = [step for step in steps[1:] if step.tracked.heard is not None]
        assert len(joined) >= 8
        for step in joined:
            whole = matching.locate(index, tour.window(0, step.last), in_c=False)
            if whole.off_map_posterior <= tracking.FITS_NOWHERE:
                assert step.tracked.fix.road_id == whole.road_id
                assert step.tracked.fix.chainage_m == pytest.approx(whole.chainage_m, abs=1e-6)
                assert step.tracked.fix.samples_used == whole.samples_used
            assert total(step.tracked) == pytest.approx(1.0, abs=1e-9)


def test_where_samples_err_apart_a_track_goes_on_as_its_last_metres(monkeypatch):
    """Beyond what a window may be long; real streets' belief goes on without readings."""
    monkeypatch.setattr(tracking, "LONGEST_M", 120.0)
    index, tour = index_of(cells=2), next(sides(2))
    steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)[5:]
    assert len(steps) >= 6
    for step in steps:
        kept = step.tracked.fix.samples_used
        assert kept in (120, 121)  # a sample a metre; the oldest may lie 120 m back, or just beyond
        last = matching.locate(index, tour.window(step.last - kept + 1, step.last), in_c=False)
        assert step.tracked.heard is not None
        assert step.tracked.fix.chainage_m == pytest.approx(last.chainage_m, abs=1e-6)
    steps = follow_tour(index.recalibrated(err_together(index)), tour, length_m=30.0, step_m=30.0)
    assert [step.tracked.heard is None for step in steps] == [False] * 4 + [True] * (len(steps) - 4)


def test_an_old_track_carries_no_readings():
    """Beyond 400 m, and round a corner that it has seen, real streets' belief goes on alone."""
    index, city = index_of(cells=6), city_of(cells=6)
    index = index.recalibrated(err_together(index))
    tour = tour_of(city, Leg("road-south", 150.0, 400.0), Leg("road-east", 0.0, 350.0))
    steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)
    after_corner = [one for one in steps if tour.travelled_m[one.last] > 320.0]
    assert all(one.tracked.heard is None for one in after_corner)
    assert all(one.right for one in after_corner)
    assert all(one.tracked.heard is not None for one in steps if tour.travelled_m[one.last] < 240.0)


def test_where_samples_err_apart_a_track_begins_anew_round_a_corner():
    """The readings that it carries then are of the new road alone, and it is nearer than before."""
    index, city = index_of(cells=6), city_of(cells=6)
    tour = tour_of(city, Leg("road-south", 150.0, 400.0), Leg("road-east", 0.0, 350.0))
    corner_m = float(tour.travelled_m[np.argmax(tour.leg == 1)])
    steps = follow_tour(index, tour, length_m=30.0, step_m=30.0)
    after = [one for one in steps if tour.travelled_m[one.last] > corner_m + 60.0]
    assert len(after) >= 8
    for step in after:
        heard, since_m = step.tracked.heard, float(tour.travelled_m[step.last]) - corner_m
        assert heard is not None
        assert heard.distance_m[-1] - heard.distance_m[0] <= since_m + 1.0
        assert step.right
    assert np.median([step.error_m for step in after]) < 0.2


def test_a_standing_car_keeps_its_readings():
    """Without a metre more nothing is heard twice, and what the track carries stays."""
    index = index_of(cells=6)
    window = next(sides(6)).window(100, 130)
    first = tracking.begin(index, window, in_c=False)
    again = tracking.follow(index, window, first.belief, 0.0, heard=first.heard, in_c=False)
    assert again.heard is first.heard
    assert again.belief == first.belief


def test_the_order_of_the_cells_moves_nothing():
    """Nor does it move what is left to the next window."""
    index = index_of(cells=6)
    tour = next(sides(6))
    order = np.random.default_rng(5).permutation(len(tour.cells))
    cells = tuple(tour.cells[i] for i in order)
    plain = tracking.begin(index, tour.window(0, 30), in_c=False)
    for last in (60, 90):
        window = tour.window(last - 30, last)
        shuffled = Window(cells, window.distance_m, window.rsrp_dbm[:, order])
        heard = {"heard": plain.heard} if last == 60 else {}
        one = tracking.follow(index, window, plain.belief, 30.0, in_c=False, **heard)
        other = tracking.follow(index, shuffled, plain.belief, 30.0, in_c=False, **heard)
        assert other.fix.chainage_m == pytest.approx(one.fix.chainage_m, abs=1e-6)
        assert other.fix.road_posterior == pytest.approx(one.fix.road_posterior, abs=1e-9)


def test_silence_carries_the_track_on():
    """A tunnel in which nothing is heard leaves the track where the odometer says."""
    index = index_of(cells=6)
    tour = next(sides(6))
    first = tracking.begin(index, tour.window(100, 130), in_c=False)
    window = tour.window(130, 160)
    silent = replace(window, rsrp_dbm=np.full_like(window.rsrp_dbm, np.nan))
    later = tracking.follow(index, silent, first.belief, 30.0, in_c=False)
    assert not later.fix.off_map
    assert later.fix.road_id == tour.legs[0].road_id
    assert later.fix.chainage_m == pytest.approx(first.fix.chainage_m + 30.0, abs=2.0)


@pytest.mark.skipif(not native.BUILT, reason="no kernels in C")
def test_the_kernels_in_c_track_as_the_definition_does():
    """Step by step, corners included."""
    index, city = index_of(cells=2), city_of(cells=2)
    tour = tour_of(city, Leg("road-south", 200.0, 400.0), Leg("road-east", 0.0, 200.0))
    for one, other in zip(
        follow_tour(index, tour, length_m=30.0, step_m=20.0),
        follow_tour(index, tour, length_m=30.0, step_m=20.0, in_c=True),
        strict=True,
    ):
        assert other.tracked.fix.road_id == one.tracked.fix.road_id
        assert other.tracked.fix.chainage_m == pytest.approx(one.tracked.fix.chainage_m, abs=0.05)
