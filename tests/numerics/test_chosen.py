"""What is aligned and what stands for the rest: a window that fits in many places loses none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Candidate, RadioMap
from app.evaluation.scenario import windows
from app.numerics import native, native_chosen, native_summary, tapes
from app.numerics.answer import as_candidates
from app.numerics.chosen import UNNAMED, Scale, choose, rest_of, sum_rest
from app.numerics.coarse import score_roads, tapes_of
from app.numerics.exhaustive import locate_exhaustively
from app.numerics.index import MapIndex
from app.numerics.matching import locate, stretches_of
from app.numerics.posterior import heaviest
from app.numerics.query import ask
from app.numerics.stretches import whole_roads
from tests.numerics.cities import city_of, index_of, models_of

built = pytest.mark.skipif(not native.BUILT, reason="installed without a C compiler")
SEEDS = st.integers(0, 10_000)


def recall_of(fast, slow) -> float:
    """Share of the definition's posterior in sub-segments and directions that are named."""
    named = {(one.road_id, one.segment_index, one.direction) for one in fast.candidates}
    mass = {(c.road_id, c.segment_index, c.direction): c.posterior for c in slow.candidates}
    return sum(mass[one] for one in mass.keys() & named) / sum(mass.values())


@pytest.mark.parametrize(("cells", "length_m"), [(1, 2.0), (1, 10.0), (1, 50.0), (2, 5.0)])
def test_windows_that_fit_everywhere_lose_no_place(cells, length_m):
    """Every sub-segment and direction that may be it is named; its share is near the true one."""
    index = index_of(cells=cells)
    for window, _ in windows(city_of(cells=cells), 25, length_m=length_m):
        fast, slow = locate(index, window), locate_exhaustively(index, window)
        assert recall_of(fast, slow) >= 0.999
        assert fast.road_posterior == pytest.approx(slow.road_posterior, abs=0.01)


def a_rest(seed: int):
    """Scores, runs of them, covered ones and a scale."""
    rng = np.random.default_rng(seed)
    score = rng.normal(0.0, 8.0, int(rng.integers(1, 200))).astype(np.float32)
    score = np.round(score) if seed % 2 else score  # ties
    inner = np.flatnonzero(rng.random(len(score) - 1) < 0.2) + 1
    covered = np.flatnonzero(rng.random(len(score)) < rng.choice([0.0, 0.1, 0.9]))
    scale = Scale(rng.uniform(0.3, 5.0), 4.0, rng.uniform(0.0, 30.0), rng.uniform(0.0, 50.0))
    return score, np.concatenate(([0], inner)), covered, scale


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_a_place_of_the_rest_weighs_what_it_stands_for(seed):
    """Width times density is the mass of the positions not covered; little is left out."""
    score, runs, covered, scale = a_rest(seed)
    rest = sum_rest(score, runs, covered, scale)
    level = np.minimum(score.astype(np.float64), scale.highest) - scale.highest
    mass_m = scale.step_m * np.exp(level / scale.temperature)
    mass_m[covered] = 0.0
    density = np.exp(level[rest.best] / scale.temperature)
    for best, mass in zip(rest.best, rest.width_m * density, strict=True):
        run = int(runs.searchsorted(best, side="right")) - 1
        end = runs[run + 1] if run + 1 < len(runs) else len(score)
        assert mass == pytest.approx(mass_m[runs[run] : end].sum(), rel=1e-5)
        assert best not in covered
    left_out = mass_m.sum() - (rest.width_m * density).sum()
    assert left_out <= 1.01 * UNNAMED * (mass_m.sum() + scale.aligned_m) + 1e-9
    assert (rest.width_m >= scale.step_m * (1.0 - 1e-6)).all()


@built
@settings(max_examples=100, deadline=None)
@given(SEEDS)
def test_the_rest_is_the_same_in_c(seed):
    """The same positions, but for those whose mass is the least that counts, and as wide."""
    score, runs, covered, scale = a_rest(seed)
    wanted = sum_rest(score, runs, covered, scale)
    against = (scale.temperature, scale.step_m, scale.highest, scale.aligned_m)
    best, width_m = native_chosen.rest(score, runs, covered, against, UNNAMED)
    ours, known = dict(zip(best, width_m, strict=True)), dict(zip(*_of(wanted), strict=True))
    for one in ours.keys() & known.keys():
        assert ours[one] == pytest.approx(known[one], rel=1e-5)
    assert len(ours.keys() ^ known.keys()) <= len(_borderline(score, runs, covered, scale))


def _of(rest):
    return rest.best, rest.width_m


def _borderline(score, runs, covered, scale):
    level = (
        np.minimum(score.astype(np.float64), scale.highest) - scale.highest
    ) / scale.temperature
    mass_m = scale.step_m * np.exp(level)
    mass_m[covered] = 0.0
    each = np.add.reduceat(mass_m, runs)
    least_m = UNNAMED / len(runs) * (mass_m.sum() + scale.aligned_m)
    return np.flatnonzero(np.abs(each / least_m - 1.0) < 1e-4)


@built
@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.integers(-80, 0), min_size=1, max_size=300), st.floats(0.05, 5.0), st.integers(1, 9)
)
def test_the_heaviest_places_are_the_same_in_c(levels, temperature, most):
    """All that matter where they are few; else the best, equal ones as they stand."""
    score = np.array(levels, dtype=np.float32)
    ours = native_chosen.heaviest(score, temperature, (1e-4, 5e-3), most)
    wanted = heaviest(score.astype(np.float64), temperature, (1e-4, 5e-3), most)
    weight = np.exp((score.astype(np.float64) - score.max()) / temperature)
    gained = np.sort(weight)[::-1].cumsum() / weight.sum()
    if min(np.abs(gained - bound).min() for bound in (1.0 - 1e-4, 1.0 - 5e-3)) > 1e-6:
        assert (ours.rows.tolist(), ours.whole) == (wanted.rows.tolist(), wanted.whole)
    assert ours.total == pytest.approx(wanted.total, rel=1e-5)


def test_each_sub_segment_and_direction_keeps_one_place():
    """However many of its positions are not aligned."""
    index, most = index_of(cells=1), 0
    for window, _ in windows(city_of(cells=1), 10, length_m=2.0):
        query = ask(index, window)
        rest, _ = rest_of(index, query, choose(index, query)[0], whole_roads(index, query))
        segment = [
            int(index.roads[road].edges_m[1:-1].searchsorted(at_m, side="right"))
            for road, at_m in zip(rest.road.tolist(), rest.chainage_m.tolist(), strict=True)
        ]
        keys = set(zip(rest.road.tolist(), rest.sign.tolist(), segment, strict=True))
        assert len(keys) == len(rest.score)
        most = max(most, len(keys))
    assert most > 0


def test_roads_without_a_salient_cell_are_looked_at(monkeypatch):
    """Each road on a tape of its own, cells salient on one: a window of one cell may be on any."""
    models = models_of(cells=1)
    monkeypatch.setattr(tapes, "TAPE_COLUMNS", 1)
    monkeypatch.setattr(tapes, "salient_cells", lambda one: one.cells if one is models[0] else ())
    index = MapIndex.build(RadioMap(1, models, index_of(cells=1).calibration))
    assert len(index.tapes) == len(models)
    for window, _ in windows(city_of(cells=1), 25, length_m=10.0):
        assert tapes_of(index, ask(index, window)) == list(range(len(models)))
        assert recall_of(locate(index, window), locate_exhaustively(index, window)) >= 0.999


def some_rows(seed: int, count: int):
    """Indices, increasing; the first and the last among them in every other case."""
    rng = np.random.default_rng(seed)
    rows = np.flatnonzero(rng.random(count) < rng.choice([0.01, 0.2, 0.9]))
    return np.union1d(rows, [0, count - 1] if seed % 2 else rows[:1])


@built
@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_neighbours_and_stretches_are_the_same_in_c(seed):
    """Whichever positions are kept, of all roads; neighbours lie beside them on their own road."""
    index = index_of(cells=2)
    window = windows(city_of(cells=2), 1, length_m=20.0)[0].window
    plain, fast = ask(index, window), ask(index, window, in_c=True)
    every = score_roads(index, plain, tapes_of(index, plain), None)
    rows = some_rows(seed, len(every.score))
    wanted = every.with_neighbours(rows, in_c=False)
    assert every.with_neighbours(rows, in_c=True).tolist() == wanted.tolist()
    kept = every.take(rows)
    found = stretches_of(index, fast, kept)
    assert found == stretches_of(index, plain, kept)
    metres = sum(last - first for _, _, first, last in found)
    assert metres <= 4.0 * every.step_m * len(rows) + len(found)


@built
def test_candidates_are_the_same_in_c():
    """Named tuples of their own kind, with the objects that they were given."""
    rivals = [(1, 4, -1, 0.6, 12.5, 8.4, 49.0), (0, 0, 1, 0.2, 0.0, 8.5, 49.1)]
    names = ("a", "b")
    found = native_summary.candidates(rivals, names, 0.5)
    assert found == as_candidates(rivals, names, 0.5)
    assert {type(one) for one in found} == {Candidate}
    assert found[0].road_id is names[1]
    assert native_summary.candidates([], names, 0.5) == ()
    with pytest.raises(ValueError, match="no road 2"):
        native_summary.candidates([(2, *rivals[0][1:])], names, 0.5)
