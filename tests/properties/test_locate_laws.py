"""Laws of locating that hold for any window: what may not move an answer, and what sums to 1."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Fix, Window
from app.numerics.matching import locate
from tests.numerics.cities import city_of, index_of

CELLS = ("unknown:1", "unknown:2")
KNOWN = sorted({cell for truth in city_of().roads for cell in truth.cells})
laws = settings(derandomize=True, deadline=None, max_examples=40)


@st.composite
def any_window(draw) -> Window:
    """Any readings of some of the map's cells at any distances: sense or nonsense."""
    seed = draw(st.integers(0, 1_000_000))
    samples = draw(st.sampled_from([1, 2, 3, 9, 31, 80]))
    known = draw(st.integers(0, 6))
    rng = np.random.default_rng(seed)
    cells = (*rng.permutation(KNOWN)[:known], *CELLS[: 0 if known else 1])
    gaps_m = rng.choice([0.0, 0.3, 1.0, 7.5, 40.0], samples)
    start_dbm = rng.uniform(-120.0, -60.0, len(cells))
    rsrp_dbm = start_dbm + np.cumsum(rng.normal(0.0, 2.0, (samples, len(cells))), axis=0)
    rsrp_dbm = np.clip(np.round(rsrp_dbm), -140.0, -44.0)
    rsrp_dbm[rng.random(rsrp_dbm.shape) < draw(st.sampled_from([0.0, 0.3, 0.95]))] = np.nan
    return Window(tuple(str(cell) for cell in cells), np.cumsum(gaps_m), rsrp_dbm)


def told(fix: Fix) -> dict[str, object]:
    """All that a fix says, for comparing two bit by bit."""
    return {one.name: getattr(fix, one.name) for one in fields(fix)}


@laws
@given(window=any_window(), seed=st.integers(0, 1000))
def test_permuting_cells_moves_nothing(window, seed):
    """Columns in another order are the same window: the whole answer is the same, bit by bit."""
    order = np.random.default_rng(seed).permutation(len(window.cells))
    turned = Window(
        tuple(window.cells[i] for i in order), window.distance_m, window.rsrp_dbm[:, order].copy()
    )
    assert told(locate(index_of(), turned)) == told(locate(index_of(), window))


@laws
@given(window=any_window(), known=st.booleans())
def test_a_cell_never_heard_moves_nothing(window, known):
    """A column of nothing but NaN, of a cell in the map or not, is no part of the answer."""
    spare = sorted(set(KNOWN) - set(window.cells))
    name = spare[0] if known and spare else "silent:9"
    silent = np.full((len(window.distance_m), 1), np.nan)
    wider = Window(
        (*window.cells, name), window.distance_m, np.column_stack([window.rsrp_dbm, silent])
    )
    assert told(locate(index_of(), wider)) == told(locate(index_of(), window))


@laws
@given(window=any_window(), confidence=st.floats(0.01, 0.999))
def test_posteriors_sum_to_one(window, confidence):
    """Candidates and off-map sum to 1, each between 0 and 1, and everything told is finite."""
    fix = locate(index_of(), window, confidence=confidence)
    posteriors = [one.posterior for one in fix.candidates]
    assert sum(posteriors) + fix.off_map_posterior == pytest.approx(1.0, abs=1e-9)
    assert all(0.0 <= one <= 1.0 for one in (*posteriors, fix.off_map_posterior))
    assert 0.0 <= fix.segment_posterior <= fix.road_posterior + 1e-9 <= 1.0 + 2e-9
    numbers = (fix.lon, fix.lat, fix.chainage_m, fix.accuracy_m, fix.device_offset_db)
    assert np.isfinite(numbers).all()
    assert fix.accuracy_m >= 0.0
    assert 0.0 <= fix.heading_deg < 360.0
    assert fix.segment_start_m - 1e-9 <= fix.chainage_m <= fix.segment_end_m + 1e-9


@laws
@given(window=any_window())
def test_a_map_may_be_asked_again(window):
    """The same question twice has the same answer: asking leaves no trace."""
    first = told(locate(index_of(), window))
    locate(index_of(), Window(("x",), np.zeros(1), np.full((1, 1), -80.0)))
    assert told(locate(index_of(), window)) == first


@laws
@given(window=any_window(), origin_m=st.sampled_from([64.0, 4096.0, -128.0]))
def test_any_origin_of_distance_will_do(window, origin_m):
    """A trip meter that starts elsewhere moves nothing but the last digits."""
    distance_m = np.round(window.distance_m * 64.0) / 64.0  # exact in binary
    here = locate(index_of(), Window(window.cells, distance_m, window.rsrp_dbm))
    there = locate(index_of(), Window(window.cells, distance_m + origin_m, window.rsrp_dbm))
    assert told(there) == told(here)


@laws
@given(window=any_window())
def test_unknown_cells_are_named_and_move_nothing(window):
    """Readings of cells that the map lacks are ignored and named, sorted."""
    rng = np.random.default_rng(len(window.distance_m))
    extra_dbm = rng.uniform(-110.0, -70.0, (len(window.distance_m), 2))
    cells = (*window.cells, "zz:2", "zz:1")
    wider = Window(cells, window.distance_m, np.column_stack([window.rsrp_dbm, extra_dbm]))
    here, there = locate(index_of(), window), locate(index_of(), wider)
    assert there.cells_unknown == (*here.cells_unknown, "zz:1", "zz:2")
    assert {**told(there), "cells_unknown": ()} == {**told(here), "cells_unknown": ()}
