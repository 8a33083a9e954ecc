"""
Shadowing: a Gaussian field on the roads whose correlation along each falls as exp(-d / l).

Gudmundson, "Correlation model for shadow fading in mobile radio systems", Electronics Letters
27(23), 1991. Along one straight road that is a first-order autoregressive process, drawn exactly.
Where roads meet they must agree: the values at the crossings are drawn jointly first, and each
road's own draw is then conditioned on the values at its ends, which leaves its law along it exact.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from app.evaluation.scenario.layout import Layout, Street
from app.evaluation.streams import Purpose, stream

BLOCK_GROWTH = 1e3  # how far a block's weights may spread: keeps 13 of float64's 16 digits


def autoregressive(
    innovation: Float[np.ndarray, "steps fields"], rho: float
) -> Float[np.ndarray, "steps fields"]:
    """
    ``x[i] = rho x[i-1] + sqrt(1 - rho^2) e[i]``, ``x[0] = e[0]``: correlation ``rho^d``.

    Within a block ``x[i] = rho^i sum_j rho^-j e[j]`` is one cumulative sum; only ends are chained.
    """
    steps = len(innovation)
    scaled = innovation * np.sqrt(1.0 - rho**2)
    scaled[0] = innovation[0]
    if rho <= 1.0 / BLOCK_GROWTH:
        block = 1
    else:
        block = max(1, min(steps, int(np.log(BLOCK_GROWTH) / -np.log(rho))))
    weight = rho ** np.arange(block, dtype=float)[:, None]
    out = np.empty_like(scaled)
    last = np.zeros(innovation.shape[1])
    for start in range(0, steps, block):
        part = scaled[start : start + block]
        inner = weight[: len(part)]
        out[start : start + block] = inner * (np.cumsum(part / inner, axis=0) + rho * last)
        last = out[start + len(part) - 1]
    return out


def crossing_factor(
    x_m: Float[np.ndarray, " nodes"], y_m: Float[np.ndarray, " nodes"], correlation_m: float
) -> Float[np.ndarray, "nodes nodes"]:
    """Lower factor of the crossings' correlation ``exp(-d / l)``: turns white noise into it."""
    away_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    return np.linalg.cholesky(np.exp(-away_m / correlation_m))


def bridge(
    free: Float[np.ndarray, "steps fields"],
    start: Float[np.ndarray, " fields"],
    end: Float[np.ndarray, " fields"],
    step_m: float,
    correlation_m: float,
) -> Float[np.ndarray, "steps fields"]:
    """
    Condition draws along a road on their values at its two ends.

    ``y(s) = x(s) + w0(s) (start - x(0)) + w1(s) (end - x(L))`` with the simple-kriging weights of
    the exponential correlation, ``w0 = sinh((L - s) / l) / sinh(L / l)`` and ``w1 = w0(L - s)``.
    """
    at = np.arange(len(free)) * step_m / correlation_m
    length = at[-1]
    to_start = (np.exp(-at) - np.exp(at - 2.0 * length)) / -np.expm1(-2.0 * length)
    to_end = to_start[::-1]
    return free + to_start[:, None] * (start - free[0]) + to_end[:, None] * (end - free[-1])


class Field:
    """A Gaussian field of unit variance, one a cell, that agrees where roads meet."""

    def __init__(
        self, layout: Layout, seed: int, purposes: tuple[Purpose, Purpose], correlation_m: float
    ) -> None:
        """Draw every cell's crossings; ``purposes``: the streams of crossings and of roads."""
        self._seed = seed
        self._crossings, self._roads = purposes
        self._correlation_m = correlation_m
        x_m, y_m = np.array(layout.nodes).T
        factor = crossing_factor(x_m, y_m, correlation_m)
        # einsum without optimize adds in a fixed order; a BLAS product would not on every machine.
        self._at_nodes = np.einsum("ij,jk->ik", factor, self._white(len(x_m), len(layout.sites)))

    def along(
        self, street: Street, index: int, cells: list[int], steps: int, step_m: float
    ) -> Float[np.ndarray, "steps cells"]:
        """The field along a road, at ``steps`` even places from its start to its end."""
        draws = [stream(self._seed, self._roads, cell, index).normal(size=steps) for cell in cells]
        rho = float(np.exp(-step_m / self._correlation_m))
        free = autoregressive(np.stack(draws, axis=1), rho)
        ends = self._at_nodes[:, cells]
        start, end = ends[street.start_node], ends[street.end_node]
        return bridge(free, start, end, step_m, self._correlation_m)

    def _white(self, nodes: int, cells: int) -> Float[np.ndarray, "nodes cells"]:
        draws = [
            stream(self._seed, self._crossings, cell).normal(size=nodes) for cell in range(cells)
        ]
        return np.stack(draws, axis=1)
