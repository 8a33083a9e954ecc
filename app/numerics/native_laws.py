"""The kernels of laws of levels; whether they are there says `app.numerics.native`."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from jaxtyping import Float32

from app.numerics import elsewhere
from app.numerics.native import Aimed, Likelihood, Told

with suppress(ImportError):
    from app.numerics import _native

ANY_ROAD = (
    elsewhere.MEAN_SD_DB**2,
    elsewhere.FIELD_SD_DB**2,
    elsewhere.FIELD_M,
    elsewhere.NOISE_DB**2,
    elsewhere.READING_LOG,
)


def log_evidence(told: Told, temperature: float) -> float:
    """Twin of `app.numerics.elsewhere.log_evidence`."""
    return _native.elsewhere(
        told.block, told.samples, len(told.group), *ANY_ROAD, min(temperature, 1.0)
    )


def log_likelihoods(
    aimed: Aimed,
    rows: Float32[np.ndarray, "rows columns"],
    at: tuple[int, float, int, float, float],
    laws: tuple[float, float, float, float, float, float, float, float, float],
    devices: Likelihood,
) -> tuple[float, float, float, float, float]:
    """
    Twin of `app.numerics.this_road.log_likelihoods`.

    Args:
        rows: Of the road's profile.
        at: Grid position, share of the way to the next, +1 or -1, the road's step, and what
            distances are multiplied by.
        laws: Variance and reach of drift, of much of it and of shadowing, how much more noise a
            noisier device has, the log of a reading's background, and the window's temperature, 1
            at most.
        devices: Of the prior of offsets.
    """
    low, share, sign, step_m, factor = at
    return _native.this_road(
        *aimed, rows, low, share, sign, step_m, factor, *laws, *ANY_ROAD, devices
    )
