"""How probably a sample that hears a cell's carrier hears the cell, along a road."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import gaussian_filter1d

from app.numerics.carriers import NOTHING_KNOWN

BANDWIDTH_M = 12.0  # hearing changes over a house or two
DOUBT_SAMPLES = 1.0  # one more sample, which heard nothing, tempers a single one
DOUBT_PASSES = 0.7  # samples of a pass hear alike: what other days hear, held-out passes tell
MAPPED_FROM = 0.02  # less than this share of samples about a place: the cell is not mapped there
LISTENING_M = 25.0  # about a reading, the pass that has it listened to the reading's carrier
STRANGER_HEARD = 0.012  # of rows hear a cell that many passes never heard there
DOUBT_STRANGER_PASSES = 0.19  # passes more of which nothing is known: 5 % after one pass


def heard_probability(
    chainage_m: Float[np.ndarray, " samples"],
    heard: Float[np.ndarray, "samples cells"],
    size: int,
    step_m: float,
    carrier: Int[np.ndarray, " cells"],
) -> Float[np.ndarray, "grid cells"]:
    """
    Kernel estimate of the share of samples that hear each cell, on a grid from chainage 0, among
    those that hear any cell of its carrier.

    It says what these passes heard; what another will hear is for `for_another_pass` to say.

    Args:
        heard: Share of each sample's readings that heard the cell, 0..1.
        size: Number of grid points, ``step_m`` apart.
        carrier: Number of each cell's carrier.

    Returns:
        Probabilities; 0 where no sample near the place heard the cell.
    """
    at = np.clip(np.rint(chainage_m / step_m).astype(int), 0, size - 1)
    sigma = BANDWIDTH_M / step_m
    effective = 2.0 * np.sqrt(np.pi) * sigma  # samples that the kernel averages, at one a step
    out = np.zeros((size, heard.shape[1]))
    for number in range(int(carrier.max(initial=-1)) + 1):
        own = np.flatnonzero(carrier == number)
        hits = np.zeros((size, len(own)))
        np.add.at(hits, at, heard[:, own])
        tries = np.bincount(at, listening(heard[:, own]), minlength=size)
        smooth_hits = gaussian_filter1d(hits, sigma, axis=0, mode="constant", truncate=3.0)
        smooth_tries = gaussian_filter1d(tries, sigma, mode="constant", truncate=3.0)
        weight = effective * smooth_tries + DOUBT_SAMPLES
        out[:, own] = (effective * smooth_hits) / weight[:, None]
    return out


def listening(heard: Float[np.ndarray, "samples cells"]) -> Float[np.ndarray, " samples"]:
    """Share of each sample's readings, at the least, that heard any of a carrier's cells."""
    return np.asarray(heard.max(axis=1))


def listened(
    chainage_m: Float[np.ndarray, " samples"],
    heard: Float[np.ndarray, "samples cells"],
    grid_m: Float[np.ndarray, " grid"],
    reach_m: float,
    carrier: Int[np.ndarray, " cells"],
) -> Bool[np.ndarray, "grid cells"]:
    """Whether one pass heard any cell of each cell's carrier within ``reach_m`` of a grid point."""
    out = np.zeros((len(grid_m), heard.shape[1]), dtype=bool)
    for number in range(int(carrier.max(initial=-1)) + 1):
        own = carrier == number
        there_m = np.sort(chainage_m[listening(heard[:, own]) > 0.0])
        edges = np.searchsorted(there_m, np.stack([grid_m - reach_m, grid_m + reach_m]))
        out[:, own] = (edges[1] > edges[0])[:, None]
    return out


def for_another_pass(
    share: Float[np.ndarray, "grid cells"], passes: Float[np.ndarray, "grid cells"]
) -> Float[np.ndarray, "grid cells"]:
    """
    Probability that a new pass hears what these heard: as if `DOUBT_PASSES` more had come by that
    heard the cells of this road as often as the road does on the whole.

    Args:
        share: Of these passes' samples, from `heard_probability`.
        passes: How many of them listened to the cell's carrier by each grid point.
    """
    driven = passes > 0
    usual = float(share[driven].mean()) if driven.any() else 0.0
    return np.asarray((passes * share + DOUBT_PASSES * usual) / (passes + DOUBT_PASSES))


def stranger_chance(passes: Float[np.ndarray, "grid cells"]) -> Float[np.ndarray, "grid cells"]:
    """
    Probability that a new pass hears a cell that none of these did.

    Args:
        passes: How many of them listened to its carrier; none of them: nothing is known.
    """
    doubt = DOUBT_STRANGER_PASSES
    return np.asarray((passes * STRANGER_HEARD + doubt * NOTHING_KNOWN) / (passes + doubt))
