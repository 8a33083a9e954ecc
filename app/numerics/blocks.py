"""A tape's rows as the kernels read them: some columns of a cell at a time, line by line."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from app.numerics.observation import HEARING_WEIGHT, TERMS, Profile

MERGED = 4  # rows of a cell at the coarse scale
BLOCK = 16  # columns that lie together, the kernels' measure
LINE_BYTES = 64  # of a processor's cache


def in_blocks(
    along: Profile,
) -> tuple[Float32[np.ndarray, "cells blocks 4 16"], Float32[np.ndarray, " columns"]]:
    """Blocks and outside of a `app.numerics.tapes.CoarseProfile`."""
    terms = along.rows[:-1].reshape(-1, TERMS, along.columns)
    fixed = np.float32(HEARING_WEIGHT) * terms[:, 3] - np.float32(0.5) * terms[:, 2]
    merged = np.stack((terms[:, 0], terms[:, 1], fixed, terms[:, 4]), axis=1)
    blocks = merged.reshape(len(merged), MERGED, -1, BLOCK).swapaxes(1, 2)
    return _aligned(blocks), along.rows[-1].copy()


def _aligned(values: Float32[np.ndarray, "*shape"]) -> Float32[np.ndarray, "*shape"]:
    """A copy that begins with a line of the cache, so that no block of columns straddles two."""
    room = np.empty(values.nbytes + LINE_BYTES, dtype=np.uint8)
    first = -room.ctypes.data % LINE_BYTES
    found = room[first : first + values.nbytes].view(np.float32).reshape(values.shape)
    found[...] = values
    return found
