"""
Masks of salient features for a road and its sub-segments, from its fitted curves.

Windows of one length that end at each place are described by their features, each cut into steps
of its own noise: two places count as different only where a vehicle could tell them apart. The
features of a road are salient when they tell its sub-segments apart, those of a sub-segment when
they tell it from the rest of the road.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from app.domain import FEATURE_KINDS, Salience
from app.numerics.features import feature_matrix
from app.numerics.selection import select

WINDOW_M = 30.0  # what a vehicle has in hand after a few seconds
PLACE_STEP_M = 8.0
STRONGEST_CELLS = 12  # a salient cell is one that is usually heard; rarer ones are not considered
INDEPENDENT_READINGS = 3.0  # in a window of 30 m, shadowing forgetting over some 10 m


def select_salient(
    mean_dbm: Float[np.ndarray, "grid cells"],
    spread_db: Float[np.ndarray, "grid cells"],
    heard: Float[np.ndarray, "grid cells"],
    step_m: float,
    edges_m: Float[np.ndarray, " edges"],
    reference: int,
) -> tuple[Salience, list[Salience]]:
    """
    Salience of the road, and of each of its sub-segments.

    Args:
        mean_dbm, spread_db, heard: The road's model on its grid.
        edges_m: Boundaries of the sub-segments.
        reference: Column of the reference cell.
    """
    stride = max(1, round(PLACE_STEP_M / step_m))
    places = np.arange(0, len(mean_dbm), stride)
    segment = np.searchsorted(edges_m[1:-1], places * step_m, side="right")
    codes = _window_codes(mean_dbm, spread_db, places, step_m, reference)
    road = _salience(codes, segment, _strongest(heard))
    parts = []
    for index in range(len(edges_m) - 1):
        first, last = int(edges_m[index] / step_m), int(np.ceil(edges_m[index + 1] / step_m))
        parts.append(
            _salience(codes, (segment == index).astype(int), _strongest(heard[first : last + 1]))
        )
    return road, parts


def _strongest(heard: Float[np.ndarray, "grid cells"]) -> Int[np.ndarray, " chosen"]:
    order = np.argsort(-heard.mean(axis=0), kind="stable")
    return np.sort(order[:STRONGEST_CELLS])


def _salience(
    codes: Int[np.ndarray, "places kinds cells"],
    label: Int[np.ndarray, " places"],
    cells: Int[np.ndarray, " chosen"],
) -> Salience:
    kinds = len(FEATURE_KINDS)
    found = select(codes[:, :, cells].reshape(len(codes), -1), label)
    mask: Bool[np.ndarray, "kinds cells"] = np.zeros((kinds, codes.shape[2]), dtype=bool)
    for feature in found.features:
        mask[feature // len(cells), cells[feature % len(cells)]] = True
    return Salience(mask, found.gain_bits, found.full_gain_bits, found.search)


def _window_codes(
    mean_dbm: Float[np.ndarray, "grid cells"],
    spread_db: Float[np.ndarray, "grid cells"],
    places: Int[np.ndarray, " places"],
    step_m: float,
    reference: int,
) -> Int[np.ndarray, "places kinds cells"]:
    """Features of the window that ends at each place, in steps of their noise; -1 = not heard."""
    reach = round(WINDOW_M / step_m)
    noise_db = np.nan_to_num(np.nanmedian(spread_db, axis=0), nan=3.0)
    widths = _noise(noise_db)
    codes = []
    for end in places.tolist():
        part = mean_dbm[max(0, end - reach) : end + 1]
        features = feature_matrix(part, np.arange(len(part)) * step_m, reference)
        with np.errstate(invalid="ignore"):
            steps = np.rint(features / (2.0 * widths))  # 0, where many lie, is no step's edge
        codes.append(np.where(np.isnan(steps), -(2.0**20), steps))
    return np.array(codes).astype(np.int64)


def _noise(noise_db: Float[np.ndarray, " cells"]) -> Float[np.ndarray, "kinds cells"]:
    """Standard deviation of each feature of a window, from that of its readings."""
    mean = noise_db / np.sqrt(INDEPENDENT_READINGS)
    return np.stack(
        [
            mean * np.sqrt(12.0) / WINDOW_M,  # slope of readings spread evenly over the window
            mean,
            noise_db**2 * np.sqrt(2.0 / INDEPENDENT_READINGS),
            mean * np.sqrt(2.0),
            noise_db * 2.0,  # the range rests on the two extreme readings
        ]
    )
