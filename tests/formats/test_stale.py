"""Levels that a phone repeats until its modem has measured anew count once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.formats import account as reasons

from . import samples
from .conftest import read_text

HEAD = "time_s,lon,lat,cell_id,rsrp_dbm,serving\n"


def table(levels: np.ndarray, *, step_s: float = 1.0, serving: int | None = 0) -> str:
    """A row a finite level; the first column is the serving cell's unless ``serving`` is None."""
    rows = [
        f"{samples.START_S + step_s * i},11.0,{48 + 1e-4 * i:.4f},850:{k},{level:g},"
        f"{'' if serving is None else int(k == serving)}"
        for i, row in enumerate(levels)
        for k, level in enumerate(row)
        if np.isfinite(level)
    ]
    return HEAD + "\n".join(rows) + "\n"


@given(st.integers(1, 7), st.integers(3, 6), st.integers(0, 10_000))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_held_levels_count_where_they_were_measured(hold, neighbours, seed):
    """The serving cell has all samples, the others those at which the modem measured."""
    rng = np.random.default_rng(seed)
    levels = rng.choice(np.arange(-120, -60), (12 * hold, 1 + neighbours)).astype(float)
    levels[:, 1:] = np.repeat(levels[::hold, 1:], hold, axis=0)
    levels[::hold, 1] = np.where(np.arange(12) % 2, -80.0, -81.0)  # each refresh differs
    levels[:, 1] = np.repeat(levels[::hold, 1], hold)
    found = read_text(table(levels))
    (drive,) = found.drives
    read = drive.trace.rsrp_dbm
    np.testing.assert_array_equal(read[:, 0], levels[:, 0])
    np.testing.assert_array_equal(read[::hold], levels[::hold])
    assert np.isfinite(read[:, 1:]).sum() == 12 * neighbours
    assert found.account.dropped[reasons.REPEATED_NEIGHBOURS] == 12 * (hold - 1) * neighbours


@pytest.mark.parametrize(
    "case", ["two neighbours", "one differs", "one more", "one less", "long silence", "all move"]
)
def test_what_may_be_measured_anew_is_kept(case):
    """Few equal levels are chance; any other level, cell or a long silence is a measurement."""
    levels = np.full((6, 6), -90.0)
    levels[:, 0] = -70.0 - np.arange(6)
    if case == "two neighbours":
        levels[:, 3:] = np.nan
    elif case == "one differs":
        levels[::2, 4] = -91.0
    elif case == "one more":
        levels[1::2, 5] = np.nan
    elif case == "one less":
        levels[::2, 5] = np.nan
    elif case == "all move":
        levels -= np.arange(6)[:, None]
    found = read_text(table(levels, step_s=11.0 if case == "long silence" else 1.0))
    assert not found.account.dropped
    np.testing.assert_array_equal(
        np.isfinite(found.drives[0].trace.rsrp_dbm).sum(), np.isfinite(levels).sum()
    )


@pytest.mark.parametrize("serving", [None, 9])
def test_rows_without_a_serving_cell_are_kept_with_their_places(serving):
    """Nothing would be left of such a sample, and where the car drove would be lost with it."""
    levels = np.repeat([[-90.0, -95.0, -99.0, -80.0], [-91.0, -95.0, -99.0, -80.0]], 3, axis=0)
    found = read_text(table(levels, serving=serving))
    assert found.account.samples == 6
    assert not found.account.dropped
