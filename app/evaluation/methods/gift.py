"""
`gift`: a map of the sign of the RSRP change, followed by a particle filter.

Source: Y. Shu et al., "Gradient-based fingerprinting for indoor localization and tracking", IEEE
Transactions on Industrial Electronics 63(4), 2016. The gradient map (Gmap) holds, for neighbouring
places, whether each cell gets stronger, weaker or stays; particles move by the measured travel and
are weighed by how well the signs heard on the way agree with the map's.

What the source leaves open on a road: the places are the reference points; a change is looked at
over ``baseline_m`` (4, 8, 16) of way after readings are averaged over as much, "stays" is a change
below ``threshold_db`` (0.5, 1.5). An agreeing sign weighs ``(1 - e)``, an opposite one ``e``, one
against "stays" halfway between (e = 0.1, 0.25). All three are chosen on held-out survey windows. A
drive starts with particles spread evenly over all roads both ways; its later windows go on with the
particles of the one before. Particles spread by 0.3 m plus 3 % of the way a step and are redrawn
when half of them carry the weight. When none fits, they start anew. The answer is the mean of the
weight within 15 m of its peak.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from app.domain import Direction, Window
from app.evaluation.methods.base import Estimate, Previous, Survey
from app.evaluation.methods.references import References, lay_references, recent_mean_dbm
from app.evaluation.methods.tuning import choose
from app.evaluation.streams import Purpose, stream
from app.numerics.geodesy import Floats

name = "gift"

PARTICLES_A_METRE = 1.5
PARTICLES = (1500, 12000)  # fewest and most
SPREAD_M, SPREAD_SHARE = 0.3, 0.03
PEAK_M = 15.0
PEAK_BIN_M = 5.0
LEAST_LOG = -60.0  # log weight of a particle that every sign speaks against


@dataclass(frozen=True, slots=True)
class Parameters:
    """What is chosen on the survey."""

    baseline_m: float
    threshold_db: float
    error: float


CHOICES = tuple(Parameters(*each) for each in product((4.0, 8.0, 16.0), (0.5, 1.5), (0.1, 0.25)))


def fit(survey: Survey, seed: int) -> Gift:
    """Draw the gradient map and choose the parameters."""
    best = choose(
        CHOICES, lambda train, each: Gift(lay_references(train), each, seed), survey, seed
    )
    return Gift(lay_references(survey), best, seed)


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Particles: road, direction of travel, chainage, logarithm of the weight."""

    road: Int[np.ndarray, " particles"]
    sign: Int[np.ndarray, " particles"]
    chainage_m: Float[np.ndarray, " particles"]
    log_weight: Float[np.ndarray, " particles"]


class Gift:
    """A gradient map and its filter."""

    def __init__(self, points: References, parameters: Parameters, seed: int) -> None:
        self.parameters = parameters
        self._points = points
        self._seed = seed
        self._signs = _gradient_map(points, parameters)
        self._length_m = points.chainage_m[points.start[1:] - 1]
        count = int(np.clip(PARTICLES_A_METRE * 2.0 * self._length_m.sum(), *PARTICLES))
        self._count = count

    def locate(self, window: Window, previous: Previous | None) -> Estimate:
        """Filter the window's signs, from the last window's particles where there are any."""
        rng = stream(self._seed, Purpose.GIFT)
        distance_m = window.distance_m - window.distance_m[-1]
        known = previous.estimate.memory if previous is not None else None
        cloud, since_m = self._fresh(rng), float(distance_m[0])
        if isinstance(known, Cloud) and previous is not None:
            since_m = max(float(distance_m[0]), -previous.since_m)
            gap_m = previous.since_m + since_m
            cloud = self._moved(known, gap_m, rng) if gap_m > 0 else known
        columns = self._points.columns(window)
        mean = recent_mean_dbm(columns, distance_m, self.parameters.baseline_m)
        for before, after in self._steps(distance_m, since_m):
            way_m = float(distance_m[after] - max(distance_m[before], since_m))
            cloud = self._weighed(
                self._moved(cloud, way_m, rng), mean[after] - self._back(mean, distance_m, after)
            )
            since_m = float(distance_m[after])
            cloud = self._kept(cloud, rng)
        return self._tell(cloud)

    def _steps(self, distance_m: Floats, since_m: float) -> list[tuple[int, int]]:
        """Pairs of samples half a baseline apart, those that were weighed already left out."""
        stride_m = self.parameters.baseline_m / 2.0
        steps, last = [], int(np.searchsorted(distance_m, since_m - 1e-6))
        last = min(last, len(distance_m) - 1)
        for sample in range(last + 1, len(distance_m)):
            end = sample == len(distance_m) - 1
            if distance_m[sample] - distance_m[last] >= stride_m - 1e-6 or end:
                steps.append((last, sample))
                last = sample
        return steps

    def _back(self, mean: Floats, distance_m: Floats, sample: int) -> Floats:
        """The averaged readings one baseline earlier."""
        earlier_m = distance_m[sample] - self.parameters.baseline_m + 1e-6
        return mean[max(int(np.searchsorted(distance_m, earlier_m)) - 1, 0)]

    def _fresh(self, rng: np.random.Generator) -> Cloud:
        """Evenly over all roads, both ways."""
        bounds = np.cumsum(self._length_m)
        at = (np.arange(self._count) + rng.uniform()) / self._count * 2.0 * bounds[-1]
        sign = np.where(at < bounds[-1], 1, -1)
        along = np.where(sign > 0, at, at - bounds[-1])
        road = np.minimum(np.searchsorted(bounds, along, side="right"), len(bounds) - 1)
        chainage_m = along - (bounds[road] - self._length_m[road])
        return Cloud(road, sign, chainage_m, np.zeros(self._count))

    def _moved(self, cloud: Cloud, way_m: float, rng: np.random.Generator) -> Cloud:
        spread_m = SPREAD_M + SPREAD_SHARE * way_m
        step_m = way_m + spread_m * rng.normal(size=len(cloud.road))
        chainage_m = cloud.chainage_m + cloud.sign * step_m
        off_m = np.maximum(-chainage_m, chainage_m - self._length_m[cloud.road])
        lost = np.where(off_m > 5.0, LEAST_LOG, 0.0)
        return Cloud(cloud.road, cloud.sign, chainage_m, cloud.log_weight + lost)

    def _weighed(self, cloud: Cloud, change_db: Floats) -> Cloud:
        """Weigh by the signs; a cell heard at both ends only."""
        heard = np.flatnonzero(~np.isnan(change_db))
        seen = _signs(change_db[heard], self.parameters.threshold_db)
        points, error = self._points, self.parameters.error
        # The newer mean is centred half a baseline back, the older one and a half.
        centre_m = cloud.chainage_m - cloud.sign * self.parameters.baseline_m
        size = (points.start[1:] - points.start[:-1])[cloud.road]
        row = np.clip(np.rint(centre_m / points.grid_m).astype(np.intp), 0, size - 1)
        there = self._signs[points.start[cloud.road] + row][:, heard]
        apart = np.abs(there * cloud.sign[:, None] - seen)
        table = np.log(np.array([1.0 - error, 0.5, error, 0.5]))  # 3: the map lacks the cell
        index = np.where(there == 2, 3, np.minimum(apart, 2))
        weight = table[index].sum(axis=1)
        return Cloud(cloud.road, cloud.sign, cloud.chainage_m, cloud.log_weight + weight)

    def _kept(self, cloud: Cloud, rng: np.random.Generator) -> Cloud:
        """Redraw when few particles carry the weight; start anew when none is on a road."""
        top = cloud.log_weight.max()
        if top < LEAST_LOG:
            return self._fresh(rng)
        weight = np.exp(cloud.log_weight - top)
        weight /= weight.sum()
        if 1.0 / (weight**2).sum() > 0.5 * len(weight):
            return Cloud(cloud.road, cloud.sign, cloud.chainage_m, cloud.log_weight - top)
        pick = (np.arange(self._count) + rng.uniform()) / self._count
        chosen = np.minimum(np.searchsorted(np.cumsum(weight), pick), len(weight) - 1)
        return Cloud(
            cloud.road[chosen], cloud.sign[chosen], cloud.chainage_m[chosen], np.zeros(self._count)
        )

    def _tell(self, cloud: Cloud) -> Estimate:
        points = self._points
        weight = np.exp(cloud.log_weight - cloud.log_weight.max())
        on_m = np.clip(cloud.chainage_m, 0.0, self._length_m[cloud.road])
        bins = (on_m / PEAK_BIN_M).astype(np.int64)
        key = (cloud.road * 2 + (cloud.sign < 0)) * (int(bins.max()) + 1) + bins
        best = int(np.bincount(key, weight).argmax())
        peak_m = float(on_m[key == best].mean())
        at = int(np.flatnonzero(key == best)[0])
        road, sign = int(cloud.road[at]), int(cloud.sign[at])
        near = (cloud.road == road) & (cloud.sign == sign) & (np.abs(on_m - peak_m) <= PEAK_M)
        chainage_m = float((weight[near] @ on_m[near]) / weight[near].sum())
        rows = slice(points.start[road], points.start[road + 1])
        x_m = float(np.interp(chainage_m, points.chainage_m[rows], points.x_m[rows]))
        y_m = float(np.interp(chainage_m, points.chainage_m[rows], points.y_m[rows]))
        place = points.frame.to_lonlat(x_m, y_m)
        direction = Direction.FORWARD if sign > 0 else Direction.BACKWARD
        return Estimate(
            points.road_ids[road],
            chainage_m,
            float(place.lon),
            float(place.lat),
            direction,
            memory=cloud,
        )


def _gradient_map(points: References, parameters: Parameters) -> Int[np.ndarray, "points cells"]:
    """Sign of the change of averaged levels about each point, chainage growing; 2 = not heard."""
    reach_m = parameters.baseline_m
    blocks = []
    for first, end in zip(points.start[:-1], points.start[1:], strict=True):
        chainage_m, levels = points.chainage_m[first:end], points.rsrp_dbm[first:end]
        mean = recent_mean_dbm(levels, chainage_m, reach_m)  # centred half a baseline back
        after = np.minimum(
            np.searchsorted(chainage_m, chainage_m + reach_m - 1e-6), end - first - 1
        )
        behind = np.searchsorted(chainage_m, chainage_m - 1e-6)
        change = mean[after] - mean[behind]
        missing = np.isnan(change)
        signs = _signs(np.where(missing, 0.0, change), parameters.threshold_db)
        blocks.append(np.where(missing, 2, signs))
    return np.concatenate(blocks).astype(np.int8)


def _signs(change_db: Floats, threshold_db: float) -> Int[np.ndarray, "..."]:
    return np.where(np.abs(change_db) < threshold_db, 0, np.sign(change_db)).astype(np.int8)
