"""Between the metres: the score of a straight curve is met exactly, and mass is conserved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, Window
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.posterior import masses
from app.numerics.query import ask
from app.numerics.refinement import AROUND, PARTS, refine
from app.numerics.stretches import whole_roads
from tests.numerics import plain
from tests.numerics.tiny import as_laid, gentle_models, map_of

STILL = Calibration(offset_sd_db=0.01)  # a device like the survey's: the offset stays where it is


def between(model, place: float):
    """Expected levels at a place between grid positions."""
    low = int(np.floor(place))
    share = place - low
    high = min(low + 1, len(model.mean_dbm) - 1)
    level_dbm = np.asarray(model.mean_dbm, dtype=float)
    return (1.0 - share) * level_dbm[low] + share * level_dbm[high]


def window_ending(model, end: float, sign: int, noise_db: float = 0.0) -> Window:
    distance_m = np.arange(0.0, 25.0)
    at = end - sign * (distance_m[-1] - distance_m)
    rng = np.random.default_rng(9)
    rsrp_dbm = np.array([between(model, place) for place in at])
    return Window(model.cells, distance_m, rsrp_dbm + rng.normal(0.0, noise_db, rsrp_dbm.shape))


@pytest.mark.parametrize("sign", [1, -1])
def test_scores_between_metres_are_those_of_the_straight_curve(sign):
    """A refined place scores as plain loops on the curve interpolated there."""
    models = gentle_models(400)
    index = map_of(models, STILL)
    end = 40.0 if sign > 0 else 18.0
    window = window_ending(models[0], end + 0.4, sign, noise_db=1.0)
    query = ask(index, window)
    fine = refine(index, query, whole_roads(index, query))
    best = int(fine.score.argmax())
    assert abs(float(fine.chainage_m[best]) - end - 0.4) < 1.0
    found = plain.readings(window, set(index.cells), as_laid(models))
    near = np.flatnonzero(
        (fine.road == 0) & (fine.sign == sign) & (np.abs(fine.chainage_m - end) <= AROUND - 1)
    )
    assert len(near) >= PARTS * 2
    laid = as_laid(models)[0]
    for column in near.tolist():
        place = float(fine.chainage_m[column])
        low = int(np.floor(place + 1e-6))
        shifted = np.array(
            [between(laid, max(min(row + place - low, 59.999), 0.0)) for row in range(61)]
        )
        moved = replace(laid, mean_dbm=shifted[:60].astype(np.float32))
        score, _ = plain.marginal(moved, found, low, sign, 0.1)
        assert fine.score[column] == pytest.approx(score, abs=0.08)


def test_refining_replaces_metres_by_as_many():
    """Lengths add up to the map's before and after, and all other places stay."""
    models = gentle_models(410)
    index = map_of(models, STILL)
    query = ask(index, window_ending(models[1], 30.3, 1))
    whole = whole_roads(index, query)
    fine = refine(index, query, whole)
    assert fine.width_m.sum() == pytest.approx(whole.width_m.sum(), rel=1e-9)
    assert len(fine) > len(whole)
    kept = {tuple(row) for row in whole.values[:3].T.tolist()}
    refined = [tuple(row) for row in fine.values[:3].T.tolist() if tuple(row) not in kept]
    assert len(refined) <= 2 * AROUND * PARTS + 1
    assert masses(fine, 1.0).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_fix_follows_the_truth_without_a_jump(sign):
    """As the truth moves by centimetres so does the fix: no step beyond 0.05 m a centimetre."""
    models = gentle_models(420)
    index = map_of(models, Calibration(information_each=1.0 / 0.3))
    ends_m = np.arange(30.0, 31.5, 0.01)
    fixes = [
        locate_exhaustively(index, window_ending(models[2], end, sign)).chainage_m for end in ends_m
    ]
    assert np.abs(np.diff(fixes)).max() < 0.05
    assert np.abs(np.array(fixes) - ends_m).max() < 0.4


def test_without_noise_the_fix_is_finer_than_the_grid():
    """Truths between metres are met within a fifth of one."""
    models = gentle_models(430)
    index = map_of(models, Calibration(information_each=10.0))
    for end in (25.1, 25.3, 25.5, 25.7, 25.9):
        fix = locate_exhaustively(index, window_ending(models[0], end, 1))
        assert fix.chainage_m == pytest.approx(end, abs=0.2)


@pytest.mark.parametrize("end", [0.0, 1.0, 58.0, 59.0])
def test_ends_of_a_road_are_refined_too(end):
    """A window that ends at either end of a road is answered there."""
    models = gentle_models(440)
    index = map_of(models, Calibration(information_each=20.0, offset_sd_db=0.01))
    sign = 1 if end > 30 else -1
    fix = locate_exhaustively(index, window_ending(models[0], end, sign))
    assert fix.chainage_m == pytest.approx(end, abs=0.5)
    assert 0.0 <= fix.chainage_m <= index.roads[0].length_m
