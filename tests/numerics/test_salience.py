"""Salient features of a road: what tells its stretches apart, and nothing that does not."""

from __future__ import annotations

import numpy as np
import pytest

from app.domain import FEATURE_KINDS
from app.numerics.salience import STRONGEST_CELLS, select_salient

EDGES_M = np.array([0.0, 60.0, 120.0, 180.0, 240.0])


def surface(cells: int, seed: int = 1):
    """Curves of 240 m, all flat but the first cell, which has another level on each stretch."""
    mean_dbm = np.full((241, cells), -90.0)
    mean_dbm[:, 0] = -70.0 - 12.0 * np.minimum(np.arange(241) // 60, 3)
    spread_db = np.full_like(mean_dbm, 2.0)
    return mean_dbm, spread_db, np.full_like(mean_dbm, 0.9)


def test_the_telling_cell_is_chosen():
    """Where one cell alone changes from stretch to stretch, features of it alone are salient."""
    road, parts = select_salient(*surface(6), 1.0, EDGES_M, reference=1)
    assert road.mask[:, 0].any()
    assert not road.mask[:, 2:].any()
    assert len(parts) == 4
    for part in parts:
        assert not part.mask[:, 2:].any()


def test_flat_roads_have_nothing_salient():
    """Where nothing differs no feature is chosen, and the gain is 0 bits."""
    mean_dbm, spread_db, heard = surface(4)
    road, _ = select_salient(np.full_like(mean_dbm, -90.0), spread_db, heard, 1.0, EDGES_M, 0)
    assert road.gain_bits == pytest.approx(road.full_gain_bits)
    # At the road's start windows are shorter; that alone may tell the first stretch.
    assert road.gain_bits < 0.5


def test_differences_below_the_noise_do_not_count():
    """A change that no vehicle could hear is not salient."""
    mean_dbm, spread_db, heard = surface(3)
    mean_dbm[:, 0] = -90.0 - 0.05 * (np.arange(241) // 60)
    road, _ = select_salient(mean_dbm, spread_db, heard, 1.0, EDGES_M, 1)
    flat, _ = select_salient(np.full_like(mean_dbm, -90.0), spread_db, heard, 1.0, EDGES_M, 1)
    assert road.full_gain_bits == pytest.approx(flat.full_gain_bits, abs=1e-9)


def test_masks_have_the_papers_shape():
    """A mask is the diagonal of W: a row a kind and a column a cell, for road and stretches."""
    rng = np.random.default_rng(3)
    mean_dbm = -90.0 + np.cumsum(rng.normal(0.0, 0.7, (241, 5)), axis=0)
    _, spread_db, heard = surface(5)
    road, parts = select_salient(mean_dbm, spread_db, heard, 1.0, EDGES_M, 0)
    for found in (road, *parts):
        assert found.mask.shape == (len(FEATURE_KINDS), 5)
        assert found.mask.any()
        assert found.gain_bits >= found.full_gain_bits - 0.02 - 1e-9
    assert road.full_gain_bits <= np.log2(4) + 1e-9
    assert all(part.full_gain_bits <= 1.0 + 1e-9 for part in parts)


def test_cells_that_are_seldom_heard_are_not_salient():
    """Only the cells heard most are considered."""
    rng = np.random.default_rng(4)
    cells = STRONGEST_CELLS + 6
    mean_dbm = -90.0 + np.cumsum(rng.normal(0.0, 0.7, (241, cells)), axis=0)
    heard = np.tile(np.linspace(0.95, 0.05, cells), (241, 1))
    spread_db = np.full_like(mean_dbm, 2.0)
    road, parts = select_salient(mean_dbm, spread_db, heard, 1.0, EDGES_M, 0)
    for found in (road, *parts):
        assert not found.mask[:, STRONGEST_CELLS:].any()


def test_half_mapped_cells_are_no_trouble():
    """A cell mapped on half the road tells the halves apart, without a warning."""
    mean_dbm, spread_db, heard = surface(3)
    mean_dbm[:, 0] = -90.0
    mean_dbm[:120, 2] = spread_db[:120, 2] = np.nan
    road, _ = select_salient(mean_dbm, spread_db, heard, 1.0, EDGES_M, 1)
    assert road.mask[:, 2].any()
    assert road.gain_bits > 0.5
