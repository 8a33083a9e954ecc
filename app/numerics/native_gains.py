"""The kernels of `app.numerics.selection`; whether they are there says `app.numerics.native`."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float, Int

with suppress(ImportError):
    from app.numerics import _native


def joined(
    key: Int[np.ndarray, " rows"], code: Int[np.ndarray, " rows"]
) -> Int[np.ndarray, " rows"]:
    """One number, from 0 on, for each distinct pair of values, which lie under the rows' count."""
    joint = np.empty(len(key), dtype=np.int64)
    _native.joined(key, code, joint)
    return joint


def gains(
    joint: Int[np.ndarray, " rows"],
    codes: Int[np.ndarray, "sets rows"],
    label: Int[np.ndarray, " rows"],
) -> Float[np.ndarray, " sets"]:
    """Twin of `GainTable`: gain in bits of the joint value together with each code."""
    gain_bits = np.empty(len(codes))
    _native.gains(joint, codes, label, gain_bits)
    return gain_bits
