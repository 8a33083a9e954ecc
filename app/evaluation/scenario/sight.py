"""Who sees whom: line of sight in plan, between buildings that are taller than any antenna."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from app.evaluation.scenario.layout import Site

PARALLEL_M = 1e-9  # a path of less extent runs along the other axis


def sees(
    x_m: Float[np.ndarray, " points"],
    y_m: Float[np.ndarray, " points"],
    site: Site,
    buildings: Float[np.ndarray, "buildings 4"],
) -> Bool[np.ndarray, " points"]:
    """True where the straight path to the site crosses no building's inside (slab method)."""
    west, south, east, north = (wall[:, None] for wall in buildings.T)
    along_x, along_y = _extent(x_m, site.x_m), _extent(y_m, site.y_m)
    first_x, second_x = (west - x_m) / along_x, (east - x_m) / along_x
    first_y, second_y = (south - y_m) / along_y, (north - y_m) / along_y
    enter = np.maximum(np.minimum(first_x, second_x), np.minimum(first_y, second_y))
    leave = np.minimum(np.maximum(first_x, second_x), np.maximum(first_y, second_y))
    hidden = np.maximum(enter, 0.0) < np.minimum(leave, 1.0)
    return ~hidden.any(axis=0)


def _extent(from_m: Float[np.ndarray, " points"], to_m: float) -> Float[np.ndarray, " points"]:
    """Signed length of the path along one axis, never 0."""
    extent_m = to_m - from_m
    return np.where(np.abs(extent_m) < PARALLEL_M, PARALLEL_M, extent_m)


def seen_share(seen: Bool[np.ndarray, " points"], reach: int) -> Float[np.ndarray, " points"]:
    """Moving average of the flags over ``reach`` points to each side; ends count on as they are."""
    padded = np.pad(seen.astype(float), reach, mode="edge")
    total = np.concatenate([[0.0], np.cumsum(padded)])
    width = 2 * reach + 1
    return (total[width:] - total[:-width]) / width
