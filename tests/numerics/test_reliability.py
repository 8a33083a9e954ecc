"""How often a map's probabilities came true: what is counted, and what is done about it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, RadioMap
from app.numerics.calibration import HELD, MOST_WIDENED, _wide_enough, calibrate, held
from app.numerics.index import MapIndex
from app.numerics.reliability import auroc, reliability
from app.numerics.trials import ask_all
from app.numerics.unseen import ask_at_home, held_out_windows
from tests.numerics.cities import models_of


def test_radii_are_widened_until_they_hold():
    """Truths that lie farther off than the likeliest error says widen it, twice at most."""
    models, learnt = models_of("harsh"), Calibration(position_sd_m=3.0, information_each=20.0)
    index = MapIndex.build(RadioMap(0, models, learnt))
    trials = ask_all(index, models, ask_at_home(index, models, held_out_windows(models)[::6]))
    off = [
        replace(one, truth=replace(one.truth, chainage_m=one.places.chainage_m[best] + 4.0))
        for one in trials
        for best in [int(one.places.score.argmax())]
        if one.places.road[best] == one.road
    ]
    narrow = reliability(index, off, learnt)
    found = _wide_enough(index, off, learnt)
    assert held(narrow) < HELD
    assert 3.0 < found.position_sd_m <= 3.0 * MOST_WIDENED
    assert held(found.reliability) > held(narrow)
    enough = replace(learnt, position_sd_m=11.0)
    assert _wide_enough(index, off, enough).position_sd_m == 11.0


def test_sub_segments_learn_the_likeliest_position_error_not_the_widened_one():
    """Widening serves the radius's tails; boundaries are blurred by what made the truths likely."""
    models, learnt = models_of("harsh"), Calibration(position_sd_m=3.0, segment_sd_m=3.0)
    index = MapIndex.build(RadioMap(0, models, learnt))
    trials = ask_all(index, models, ask_at_home(index, models, held_out_windows(models)[::6]))
    sure = [replace(one, truth=replace(one.truth, chainage_m=200.0)) for one in trials]
    found = _wide_enough(index, sure, learnt)
    assert found.position_sd_m > found.segment_sd_m == 3.0


def test_a_map_tells_its_reliability():
    """Every share is one, bins hold all windows, and coverage grows with the confidence."""
    told = calibrate(models_of(cells=2)).reliability
    assert told.window_count == sum(count for _, _, count in told.curve) > 100
    shares = (told.road_right, told.ece, told.refused, told.strangers_refused, told.off_map_auroc)
    assert all(0.0 <= share <= 1.0 for share in shares)
    held = [share for _, share in told.coverage]
    assert held == sorted(held)
    right = sum(right * count for _, right, count in told.curve) / told.window_count
    assert right == pytest.approx(told.road_right)
    assert told.segment_right is not None
    assert told.segment_ece is not None
    assert 0.5 < told.segment_right <= told.road_right
    assert 0.0 <= told.segment_ece < 0.06


def test_sub_segments_come_as_often_as_they_are_said_to():
    """On the mean over three maps' held-out windows, 720."""
    told = [calibrate(models_of(cells=cells)).reliability.segment_ece for cells in (2, 3, 4)]
    assert None not in told
    assert np.mean(told) < 0.055


def test_auroc_is_the_chance_to_be_ordered_right():
    """Against every pair counted; ties count half."""
    rng = np.random.default_rng(2)
    positive, negative = rng.integers(0, 9, 40) * 1.0, rng.integers(0, 6, 30) * 1.0
    pairs = [(p > n) + 0.5 * (p == n) for p in positive for n in negative]
    assert auroc(positive, negative) == pytest.approx(np.mean(pairs))
