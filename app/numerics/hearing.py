"""How probably a sample hears a cell, along a road."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

BANDWIDTH_M = 12.0  # hearing changes over a house or two
DOUBT_SAMPLES = 1.0  # one more sample, which heard nothing, tempers a single one
DOUBT_PASSES = 0.7  # samples of a pass hear alike: what other days hear, held-out passes tell
MAPPED_FROM = 0.02  # less than this share of samples about a place: the cell is not mapped there


def heard_probability(
    chainage_m: Float[np.ndarray, " samples"],
    heard: Float[np.ndarray, "samples cells"],
    size: int,
    step_m: float,
) -> Float[np.ndarray, "grid cells"]:
    """
    Kernel estimate of the share of samples that hear each cell, on a grid from chainage 0.

    It says what these passes heard; what another will hear is for `for_another_pass` to say.

    Args:
        heard: Share of each sample's readings that heard the cell, 0..1.
        size: Number of grid points, ``step_m`` apart.

    Returns:
        Probabilities; 0 where no sample near the place heard the cell.
    """
    at = np.clip(np.rint(chainage_m / step_m).astype(int), 0, size - 1)
    hits = np.zeros((size, heard.shape[1]))
    np.add.at(hits, at, heard)
    tries = np.bincount(at, minlength=size).astype(float)
    sigma = BANDWIDTH_M / step_m
    effective = 2.0 * np.sqrt(np.pi) * sigma  # samples that the kernel averages, at one a step
    smooth_hits = gaussian_filter1d(hits, sigma, axis=0, mode="constant", truncate=3.0)
    smooth_tries = gaussian_filter1d(tries, sigma, mode="constant", truncate=3.0)
    weight = effective * smooth_tries + DOUBT_SAMPLES
    return (effective * smooth_hits) / weight[:, None]


def for_another_pass(
    share: Float[np.ndarray, "grid cells"], passes: Float[np.ndarray, " grid"]
) -> Float[np.ndarray, "grid cells"]:
    """
    Probability that a new pass hears what these heard: as if `DOUBT_PASSES` more had come by that
    heard the cells of this road as often as the road does on the whole.

    Args:
        share: Of these passes' samples, from `heard_probability`.
        passes: How many of them drove by each grid point.
    """
    driven = passes > 0
    usual = float(share[driven].mean()) if driven.any() else 0.0
    weight = passes[:, None]
    return np.asarray((weight * share + DOUBT_PASSES * usual) / (weight + DOUBT_PASSES))
