"""A tape's blocks hold what its rows say, each within lines of the cache."""

from __future__ import annotations

import numpy as np

from app.numerics.blocks import BLOCK, LINE_BYTES
from app.numerics.tapes import COARSE_STEPS_M
from tests.numerics.cities import index_of


def test_no_block_straddles_a_line():
    """At every step: a block of columns begins with a line."""
    for tape in index_of(cells=6).tapes:
        assert len(tape.levels) == len(COARSE_STEPS_M)
        for level in tape.levels:
            assert level.blocks.ctypes.data % LINE_BYTES == 0
            assert level.blocks.flags.c_contiguous
            assert level.blocks.shape[2:] == (4, BLOCK)
            assert BLOCK * level.blocks.itemsize % LINE_BYTES == 0


def test_blocks_are_rows_cut_into_columns():
    """Put end to end again they are finite, and as long as the tape."""
    level = index_of(cells=6).tapes[0].levels[0]
    cells = np.arange(len(level.blocks))
    rows = level.rows(cells)
    assert rows.shape == (4 * len(cells) + 1, level.columns)
    np.testing.assert_array_equal(rows[0, :BLOCK], level.blocks[0, 0, 0])
    np.testing.assert_array_equal(rows[5, BLOCK : 2 * BLOCK], level.blocks[1, 1, 1])
    assert np.isfinite(rows).all()
