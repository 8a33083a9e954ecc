"""What a device does not list counts as silence only where it lists as many cells as surveys do."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Window
from app.numerics import native, native_readings
from app.numerics.listing import FEW, LEAST, USUAL, as_listed, silence_counts, usual_numbers
from app.numerics.matching import locate
from app.numerics.query import ask
from tests.numerics.cities import index_of, models_of
from tests.numerics.test_native import a_window, built
from tests.numerics.test_native import index_of as gentle_index


def heard_by(counts: list[int], cells: int) -> Window:
    """Samples 10 m apart, each of the first cells of one carrier."""
    rsrp_dbm = np.full((len(counts), cells), np.nan)
    for row, count in enumerate(counts):
        rsrp_dbm[row, :count] = -90.0
    names = tuple(f"100:{number}" for number in range(cells))
    return Window(names, np.arange(len(counts)) * 10.0, rsrp_dbm)


def counts_of(window: Window, usual: float) -> float:
    """For how much silence counts, where so many are usual."""
    carrier = [0] * len(window.cells)
    _, seen = native.evidence(
        window.distance_m,
        window.rsrp_dbm,
        [*range(len(window.cells))],
        1.0,
        carrier,
        [*range(len(window.cells))],
    )
    return silence_counts(seen, np.full(len(window.cells), usual))


@built
def test_silence_counts_in_full_where_as_many_are_listed_as_usual():
    """Less below seven tenths of that, never nothing."""
    assert counts_of(heard_by([5, 5, 5], 8), 5.0) == 1.0
    assert counts_of(heard_by([8, 8, 8], 8), 5.0) == 1.0
    assert counts_of(heard_by([4, 3, 4], 8), 5.0) == 1.0
    halfway = 0.5 * (FEW + USUAL)
    assert counts_of(heard_by([9, 9], 9), 9.0 / halfway) == pytest.approx(0.5)
    assert counts_of(heard_by([1, 1, 1], 8), 8.0) == LEAST


@built
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 30.0))
def test_the_kernel_says_the_same(seed, usual):
    """In place, beside all else that a window says."""
    index, window = gentle_index(seed % 5), a_window(seed)
    query = ask(index, window)
    told, seen = native.evidence(
        window.distance_m,
        window.rsrp_dbm,
        [window.cells.index(cell) for cell in query.cells],
        1.0,
        [0] * len(query.cells),
        query.group.tolist(),
    )
    each = usual * np.random.default_rng(seed).uniform(0.5, 1.5, len(query.cells))
    wanted = as_listed(dataclasses.replace(seen, share=seen.share.copy()), each)
    counts = silence_counts(seen, each)
    assert native_readings.listen(told, each) == pytest.approx(counts, rel=1e-12)
    for field in dataclasses.fields(wanted):
        ours = getattr(seen, field.name)
        np.testing.assert_allclose(ours, getattr(wanted, field.name), rtol=1e-12)


def test_usual_numbers_are_what_the_survey_heard():
    """Six cells that are always heard: six, but for what a survey leaves in doubt."""
    usual = usual_numbers(models_of(cells=6))
    assert len(usual) == 6
    assert 5.0 < min(usual.values()) <= max(usual.values()) <= 6.0


def test_usual_numbers_are_of_the_places_that_know_the_cell():
    """A road elsewhere that hears one cell alone changes nothing of the others."""
    model = models_of(cells=6)[0]
    quiet = dataclasses.replace(model, cells=tuple(f"elsewhere-{cell}" for cell in model.cells))
    alone, together = usual_numbers([model]), usual_numbers([model, quiet])
    assert {cell: together[cell] for cell in model.cells} == alone


def test_a_phone_of_one_cell_a_sample_is_not_sent_to_a_quiet_road():
    """Of six cells the strongest alone: silence counts a tenth, and the road is still found."""
    index = index_of(cells=6)
    shares = []
    for keep in (1, 6):
        road = models_of(cells=6)[0]
        rows = slice(100, 130)
        rsrp_dbm = road.mean_dbm[rows].astype(float)
        strongest = np.argsort(-rsrp_dbm, axis=1)
        for row, order in enumerate(strongest):
            rsrp_dbm[row, order[keep:]] = np.nan
        window = Window(road.cells, np.arange(30.0), rsrp_dbm)
        heard = np.isfinite(rsrp_dbm).any(axis=0)
        cells = tuple(cell for cell, there in zip(road.cells, heard, strict=True) if there)
        window = Window(cells, window.distance_m, rsrp_dbm[:, heard])
        shares.append(float(ask(index, window).fine.share.sum(axis=1).max()))
        assert locate(index, window).road_id == road.road_id
    assert shares == pytest.approx([LEAST, 1.0])
