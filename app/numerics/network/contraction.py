"""
Runs of one street drawn together: each step moves sideways to where the street's drives lie.

The clarification of traces by Cao and Krumm (2009) as a blurring mean shift: only neighbours that
are driven in parallel attract (either way round), and only across the direction of travel, so that
crossing streets and the ends of streets stay where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from app.numerics.geodesy import Floats
from app.numerics.network.runs import Run
from app.numerics.network.steps import STEP_M

REACH_M = 25.0  # sideways: half the distance of the closest parallel streets
WIDTH_M = 10.0  # of the attraction: GPS in a street canyon, and the width of a street
PARALLEL_COS = float(np.cos(np.radians(30.0)))
ROUNDS = 5
DIRECTIONS = 12  # headings modulo 180 degrees, in sectors of 15


@dataclass(frozen=True, slots=True, eq=False)
class _Cloud:
    """
    Steps of all runs in small boxes of place and heading, so that cost follows the streets.

    Attributes:
        box: Box of each step, runs one after the other.
        xy_m, axis: Mean place and axis of travel of each box. Shape ``(boxes, 2)``.
        weight: Runs that come through each box.
    """

    box: Int[np.ndarray, " steps"]
    xy_m: Float[np.ndarray, "boxes 2"]
    axis: Float[np.ndarray, "boxes 2"]
    weight: Float[np.ndarray, " boxes"]


def contract(runs: Sequence[Run]) -> list[Floats]:
    """The runs' places after contraction, in the runs' order; each of shape ``(steps, 2)``."""
    if not runs:
        return []
    cloud = _cloud(runs)
    across = np.stack([-cloud.axis[:, 1], cloud.axis[:, 0]], axis=1)
    at = cloud.xy_m
    near = _neighbours(cloud)
    for _ in range(ROUNDS):
        at = at + _pull(at, across, cloud, near)[:, None] * across
    xy_m = np.concatenate([run.xy_m for run in runs])
    normal = across[cloud.box]
    moved = xy_m + ((at[cloud.box] - xy_m) * normal).sum(axis=1, keepdims=True) * normal
    return np.split(moved, np.cumsum([len(run.xy_m) for run in runs])[:-1])


def _cloud(runs: Sequence[Run]) -> _Cloud:
    xy_m = np.concatenate([run.xy_m for run in runs])
    heading = np.concatenate([run.heading for run in runs])
    number = np.repeat(np.arange(len(runs)), [len(run.xy_m) for run in runs])
    doubled = np.arctan2(heading[:, 1], heading[:, 0]) * 2.0  # an axis has no sense of direction
    sector = np.floor((doubled / (2.0 * np.pi)) % 1.0 * DIRECTIONS).astype(np.int64)
    keys = np.column_stack([np.floor(xy_m / STEP_M).astype(np.int64), sector])
    _, box, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    box = box.ravel()

    def mean(values: Floats) -> Floats:
        return np.bincount(box, weights=values, minlength=len(count)) / count

    half = np.arctan2(mean(np.sin(doubled)), mean(np.cos(doubled))) / 2.0
    through = np.unique(np.column_stack([box, number]), axis=0)[:, 0]
    return _Cloud(
        box,
        np.stack([mean(xy_m[:, 0]), mean(xy_m[:, 1])], axis=1),
        np.stack([np.cos(half), np.sin(half)], axis=1),
        np.bincount(through, minlength=len(count)).astype(float),
    )


def _neighbours(cloud: _Cloud) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of boxes, both ways round and each with itself, that may attract each other."""
    pairs = cKDTree(cloud.xy_m).query_pairs(REACH_M, output_type="ndarray")
    parallel = np.abs((cloud.axis[pairs[:, 0]] * cloud.axis[pairs[:, 1]]).sum(axis=1))
    pairs = pairs[parallel > PARALLEL_COS]
    own = np.arange(len(cloud.weight))
    return np.concatenate([pairs, pairs[:, ::-1], np.stack([own, own], axis=1)])


def _pull(at: Floats, across: Floats, cloud: _Cloud, near: Int[np.ndarray, "pairs 2"]) -> Floats:
    """How far each box moves sideways, metres to the left of its axis."""
    one, other = near.T
    away = at[other] - at[one]
    sideways = (away * across[one]).sum(axis=1)
    along = (away * cloud.axis[one]).sum(axis=1)
    weight = cloud.weight[other] * np.exp(-0.5 * (sideways**2 + along**2) / WIDTH_M**2)
    size = len(cloud.weight)
    total = csr_array((weight, (one, other)), shape=(size, size)).sum(axis=1)
    moved = csr_array((weight * sideways, (one, other)), shape=(size, size)).sum(axis=1)
    return np.asarray(moved / total)
