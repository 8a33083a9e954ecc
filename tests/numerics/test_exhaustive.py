"""The exhaustive answer against an implementation in plain loops: places, roads, directions."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from app.domain import Calibration, Direction
from app.numerics.exhaustive import locate_exhaustively
from tests.numerics import plain
from tests.numerics.tiny import as_laid, gentle_models, map_of, window_along

SIGN = {1: Direction.FORWARD, -1: Direction.BACKWARD}
CALIBRATION = Calibration(information_each=1.0 / 3.0, offset_sd_db=2.0)


def literal(models, window):
    """Posterior by plain loops: of every grid position, of roads, and of roads and directions."""
    every = plain.posterior(as_laid(models), window, CALIBRATION.offset_sd_db, 3.0)
    roads, ways = Counter(), Counter()
    for (road, sign, _), mass in every.items():
        roads[road] += mass
        ways[road, sign] += mass
    return every, roads, ways


@pytest.mark.parametrize("seed", range(8))
def test_the_answer_is_the_plain_loops_answer(seed):
    """Best road, direction and metre are those of the loops, probabilities to a few percent."""
    models = gentle_models(100 + 10 * seed)
    sign = 1 if seed % 2 else -1
    window = window_along(models[seed % 3], seed, sign=sign)
    index = map_of(models, CALIBRATION)
    fix = locate_exhaustively(index, window)
    every, roads, ways = literal(models, window)
    (road, way, place), most = every.most_common(1)[0]
    on_map = 1.0 - fix.off_map_posterior
    assert fix.road_id == roads.most_common(1)[0][0]
    assert fix.road_posterior / on_map == pytest.approx(roads[fix.road_id], abs=0.05)
    for found in (1, -1):
        told = sum(
            one.posterior
            for one in fix.candidates
            if one.road_id == fix.road_id and one.direction is SIGN[found]
        )
        assert told / on_map == pytest.approx(ways[fix.road_id, found], abs=0.05)
    if road == fix.road_id and most > 0.5:
        assert fix.direction is SIGN[way]
        assert fix.chainage_m == pytest.approx(place, abs=1.0)


def test_the_truth_is_found():
    """A window read off a road's own curves ends where it was read, either way."""
    models = gentle_models(200)
    index = map_of(models, replace(CALIBRATION, information_each=10.0))
    for number, sign, end in ((0, 1, 50), (1, -1, 7), (2, 1, 31), (2, -1, 28)):
        model = models[number]
        travelled_m = np.array([0.0, 2.0, 3.0, 5.0, 7.0, 9.0, 12.0, 14.0, 17.0, 20.0])
        rows = (end - sign * (travelled_m[-1] - travelled_m)).astype(int)
        window = replace(
            window_along(model, 1),
            cells=model.cells,
            distance_m=travelled_m,
            rsrp_dbm=model.mean_dbm[rows].astype(float),
        )
        fix = locate_exhaustively(index, window)
        assert (fix.road_id, fix.direction) == (model.road_id, SIGN[sign])
        assert fix.chainage_m == pytest.approx(end, abs=0.3)


@pytest.mark.parametrize("temperature", [1.0, 4.0, 30.0])
def test_candidates_are_the_loops_sub_segments(temperature):
    """Each sub-segment's and direction's probability is the sum of its metres', within 0.05."""
    models = gentle_models(300)
    window = window_along(models[0], 3)
    index = map_of(models, replace(CALIBRATION, information_each=1.0 / temperature))
    fix = locate_exhaustively(index, window)
    every = plain.posterior(as_laid(models), window, CALIBRATION.offset_sd_db, temperature)
    expected = Counter()
    for (road, sign, place), mass in every.items():
        edges_m = index.roads[index.road_ids.index(road)].edges_m
        segment = int(np.searchsorted(edges_m[1:-1], float(place), side="right"))
        expected[road, segment, SIGN[sign]] += mass
    told = Counter()
    for one in fix.candidates:
        told[one.road_id, one.segment_index, one.direction] += one.posterior
    for key, mass in expected.items():
        assert told[key] / (1.0 - fix.off_map_posterior) == pytest.approx(mass, abs=0.05)
