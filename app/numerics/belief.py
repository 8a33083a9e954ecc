"""
Where a tracked vehicle may be: a few weighted modes over road, direction and chainage.

A belief is what one window leaves to the next. Beside its modes it holds two shares without a
place: anywhere on the map, from which a lost track recovers, and off the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from app.numerics.index import MapIndex
from app.numerics.posterior import Places

MOST_MODES = 64
MODE_REACH_M = 20.0  # places this far about a peak are one mode: what a fix calls its peak, wider
SHARP_MODES = 32  # lighter ones are drawn broadly, so that a vague belief is held whole, too
BROAD_REACH_M = 80.0
LIGHTEST = 1e-4  # lighter modes join the share that may be anywhere
LEAST_SD_M = 0.3
TAIL_SHARE = 0.1  # of motions err more than a normal: odometers slip, maps are drawn wrongly
TAIL_SPREAD = 3.0  # how much more these err


@dataclass(frozen=True, slots=True)
class Mode:
    """
    A share ``weight`` of the belief about one place: chainage ``N(chainage_m, sd_m^2)``.

    Attributes:
        moved_sd_m: How much of the spread the motion since the last window has made.
    """

    road: int
    sign: int
    chainage_m: float
    sd_m: float
    weight: float
    moved_sd_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Belief:
    """Modes, heaviest first; their weights, ``anywhere`` and ``off_map`` sum to 1."""

    modes: tuple[Mode, ...]
    anywhere: float
    off_map: float

    def with_off_map(self, off_map: float) -> Belief:
        """Another probability of being off the map, the rest shared as it was."""
        share = (1.0 - off_map) / max(1.0 - self.off_map, 1e-12)
        modes = tuple([replace(mode, weight=mode.weight * share) for mode in self.modes])
        return Belief(modes, self.anywhere * share, off_map)


def condense(places: Places, mass: Float[np.ndarray, " places"], off_map: float) -> Belief:
    """
    The modes of a posterior: about the heaviest place left, again and again.

    Args:
        mass: Of each place, summing to 1.
        off_map: Probability of being off the map.
    """
    matter = (mass > LIGHTEST * 1e-2).nonzero()[0]
    road, sign, chainage_m = places.road[matter], places.sign[matter], places.chainage_m[matter]
    own_m2 = places.width_m[matter] ** 2 / 12.0  # a place may stand for a whole sub-segment
    key, left = road * 2 + (sign < 0), mass[matter].copy()
    modes: list[Mode] = []
    while len(modes) < MOST_MODES and len(left):
        peak = int(left.argmax())
        reach_m = MODE_REACH_M if len(modes) < SHARP_MODES else BROAD_REACH_M
        near = (key == key[peak]) & (np.abs(chainage_m - chainage_m[peak]) <= reach_m)
        near &= left > 0.0
        share = left[near]
        weight = float(share.sum())
        if weight < LIGHTEST:
            break
        mean_m = float(share @ chainage_m[near]) / weight
        spread_m2 = float(share @ ((chainage_m[near] - mean_m) ** 2 + own_m2[near])) / weight
        sd_m = max(float(np.sqrt(spread_m2)), LEAST_SD_M)
        on_map = weight * (1.0 - off_map)
        modes.append(Mode(int(road[peak]), int(sign[peak]), mean_m, sd_m, on_map))
        left[near] = 0.0
    modes.sort(key=lambda mode: -mode.weight)
    placed = sum(mode.weight for mode in modes)
    return Belief(tuple(modes), max(1.0 - off_map - placed, 0.0), off_map)


class Prior:
    """
    What a belief says before the window is heard: log density per metre of road and direction.

    Args:
        anywhere: Weight that is spread evenly over all roads and both directions.
        total: What all weights are counted against: of everything that is on the map.
    """

    def __init__(
        self, index: MapIndex, modes: Sequence[Mode], anywhere: float, total: float
    ) -> None:
        every_m = 2.0 * sum(road.length_m for road in index.roads)
        self._everywhere = anywhere / total / every_m
        self._group = np.full((len(index.roads), 2), -1, dtype=np.intp)
        grouped: dict[tuple[int, int], list[Mode]] = {}
        for mode in modes:
            grouped.setdefault((mode.road, int(mode.sign < 0)), []).append(mode)
        self._modes: list[Float[np.ndarray, "4 modes"]] = []
        for (road, way), ones in grouped.items():
            self._group[road, way] = len(self._modes)
            columns = [
                (one.chainage_m, one.sd_m, one.moved_sd_m, one.weight / total) for one in ones
            ]
            self._modes.append(np.array(columns).T)

    def log_density(
        self,
        road: Int[np.ndarray, " places"],
        sign: Int[np.ndarray, " places"],
        chainage_m: Float[np.ndarray, " places"],
        blur_m: float = 0.0,
    ) -> Float[np.ndarray, " places"]:
        """
        Of each place.

        Args:
            blur_m: Spread to add, so that no mode falls between places far apart.
        """
        density = np.full(len(road), self._everywhere)
        group = self._group[road, (sign < 0).astype(np.intp)]
        for number in np.unique(group[group >= 0]).tolist():
            here = (group == number).nonzero()[0]
            density[here] += _mixture(chainage_m[here], self._modes[number], blur_m)
        return np.log(np.maximum(density, 1e-300))


def _mixture(
    chainage_m: Float[np.ndarray, " places"], modes: Float[np.ndarray, "4 modes"], blur_m: float
) -> Float[np.ndarray, " places"]:
    """Sum of the modes' densities, each a normal with a broader one mixed in, as motions err."""
    mean_m, sd_m, moved_m, weight = modes
    total = np.zeros(len(chainage_m))
    for spread, share in ((1.0, 1.0 - TAIL_SHARE), (TAIL_SPREAD, TAIL_SHARE)):
        wide_m = np.sqrt(sd_m**2 + (spread**2 - 1.0) * moved_m**2 + blur_m**2)
        z = (chainage_m[:, None] - mean_m) / wide_m
        total += np.exp(-0.5 * z * z) @ (share * weight / (wide_m * np.sqrt(2.0 * np.pi)))
    return total
