"""The offline part of `paper`: sequences, singular points, salient features, fitted curves."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from ruptures.base import BaseCost
from ruptures.detection import BottomUp

from app.evaluation.methods.base import Survey
from app.evaluation.methods.references import (
    CENTRE_DBM,
    References,
    lay_references,
    recent_mean_dbm,
)
from app.numerics.geodesy import Floats
from app.numerics.selection import TOLERANCE_BITS, GainTable, branch_and_bound, greedy

KINDS = 5
CLASSES = 4
ROW_STEP_M = 4.0
EXACT_FEATURES = 10  # beyond, the search is greedy: 2^30 subsets at six cells
BRANCH_NODES = 1000
MOST_CELLS = 12  # of a city's hundreds, those heard most on the stretch
CURVE_DEGREE = 3
PLACE_STEP_M = 0.5
SHORTEST = 3  # reference points in a sub-segment


class GradientVariance(BaseCost):  # type: ignore[misc]  # ruptures ships no types
    """Eq. 5 of one sub-segment: the variance of the gradient, summed over cells."""

    model = "gradient-variance-mean"
    min_size = SHORTEST

    def fit(self, signal: Floats) -> GradientVariance:
        """Take the gradients, one row a position."""
        self.signal = np.asarray(signal, dtype=float)
        zero = np.zeros((1, self.signal.shape[1]))
        self._sums = np.concatenate([zero, np.cumsum(self.signal, axis=0)])
        self._squares = np.concatenate([[0.0], np.cumsum((self.signal**2).sum(axis=1))])
        return self

    def error(self, start: int, end: int) -> float:
        """Mean squared deviation of rows ``start:end`` from their mean, over all cells."""
        count = end - start
        mean = (self._sums[end] - self._sums[start]) / count
        return max(float((self._squares[end] - self._squares[start]) / count - mean @ mean), 0.0)


def features(
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    distance_m: Float[np.ndarray, " samples"],
    reference: int,
) -> Float[np.ndarray, " features"]:
    """Eq. 3: mean gradient, mean, variance, mean difference, range, each of all cells; NaN none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        step_m = np.diff(distance_m)
        gradient = np.diff(rsrp_dbm, axis=0)[step_m > 0] / step_m[step_m > 0][:, None]
        mean = _mean(rsrp_dbm)
        return np.concatenate(
            [
                _mean(gradient),
                mean,
                _mean((rsrp_dbm - mean) ** 2),
                _mean(rsrp_dbm - rsrp_dbm[:, [reference]]),
                np.fmax.reduce(rsrp_dbm, axis=0) - np.fmin.reduce(rsrp_dbm, axis=0),
            ]
        )


def completed(
    found: Float[np.ndarray, "*rows features"], floor_dbm: float, reference: int
) -> Float[np.ndarray, "*rows features"]:
    """
    Features with numbers for cells that the stretch does not hear: the floor, unchanging.

    Left out instead, they would make the stretch that shares no cell with a window its best match.
    """
    cells = found.shape[-1] // KINDS
    kinds = found.reshape(*found.shape[:-1], KINDS, cells)
    mean = np.where(np.isnan(kinds[..., 1, :]), floor_dbm, kinds[..., 1, :])
    difference = mean - mean[..., [reference]]
    steady = np.zeros_like(mean)
    instead = np.stack([steady, mean, steady, difference, steady], axis=-2)
    return np.where(np.isnan(kinds), instead, kinds).reshape(found.shape)


def _mean(values: Floats) -> Floats:
    known = ~np.isnan(values)
    if known.all() and len(values):
        return values.sum(axis=0) / len(values)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """One of the two spatial scales: features and masks, a row a road or sub-segment."""

    features: Float[np.ndarray, "rows features"]
    mask: Bool[np.ndarray, "rows features"]

    def distance(self, seen: Float[np.ndarray, " features"], *, select: bool) -> Floats:
        """``||W (e_u - e)||`` of every row; without selection W is the identity."""
        difference = seen - self.features
        if select:
            difference = np.where(self.mask, difference, 0.0)
        return np.sqrt((difference**2).sum(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """All roads and sub-segments, the latter road after road."""

    survey: Survey
    points: References
    reference: int
    roads: Scale
    segments: Scale
    first: Int[np.ndarray, " roads_and_end"]
    road: Int[np.ndarray, " segments"]
    start_m: Float[np.ndarray, " segments"]
    end_m: Float[np.ndarray, " segments"]
    share: Float[np.ndarray, " segments"]
    places_m: list[Floats] = field(default_factory=list)
    curves_db: list[Floats] = field(default_factory=list)


def draw_atlas(survey: Survey, cuts_per_100_m: float, smooth_m: float) -> Atlas:
    """All that is learnt from a survey."""
    points = lay_references(survey)
    heard = (~np.isnan(points.rsrp_dbm)).mean(axis=0)
    named = [trace.reference_cell for trace in survey.traces if trace.reference_cell]
    reference = points.cells.index(named[0]) if named else int(heard.argmax())
    stretches: list[tuple[int, float, float]] = []
    first, rows, row_road, row_segment = [0], [], [], []
    road_features, segment_features = [], []
    places, curves = [], []
    for number in range(len(points.road_ids)):
        part = slice(points.start[number], points.start[number + 1])
        at_m, levels = points.chainage_m[part], points.rsrp_dbm[part]
        smooth = recent_mean_dbm(levels, at_m, smooth_m)
        edges = _singular_points(smooth, points.grid_m, cuts_per_100_m)
        road_features.append(features(smooth, at_m, reference))
        for start, end in pairwise(edges):
            segment_features.append(features(smooth[start:end], at_m[start:end], reference))
            last_m = float(at_m[end] if end < len(at_m) else at_m[-1])
            stretches.append((number, float(at_m[start]), last_m))
            place_m = np.arange(at_m[start], last_m + 1e-6, PLACE_STEP_M)
            places.append(place_m)
            curves.append(_curves(at_m[start:end], levels[start:end], place_m))
        reach = max(2, round(survey.window_m / points.grid_m / 2.0))
        stride = max(1, round(ROW_STEP_M / points.grid_m))
        for middle in range(0, len(at_m), stride):
            around = slice(max(0, middle - reach), middle + reach + 1)
            rows.append(features(smooth[around], at_m[around], reference))
            row_road.append(number)
            row_segment.append(first[-1] + int(np.searchsorted(edges, middle, side="right")) - 1)
        first.append(len(segment_features))
    codes = _codes(np.array(rows))
    road_label, segment_label = np.array(row_road), np.array(row_segment)
    road, start_m, end_m = (np.array(each) for each in zip(*stretches, strict=True))
    road_mask = np.stack([_salient(codes, road_label == i) for i in range(len(points.road_ids))])
    segment_mask = np.stack(
        [
            _salient(codes[road_label == road[i]], segment_label[road_label == road[i]] == i)
            for i in range(len(stretches))
        ]
    )
    length_m = points.chainage_m[points.start[1:] - 1]
    return Atlas(
        survey=survey,
        points=points,
        reference=reference,
        roads=Scale(completed(np.array(road_features), points.floor_dbm, reference), road_mask),
        segments=Scale(
            completed(np.array(segment_features), points.floor_dbm, reference), segment_mask
        ),
        first=np.array(first),
        road=road.astype(np.intp),
        start_m=start_m,
        end_m=end_m,
        share=(end_m - start_m + points.grid_m) / (length_m[road.astype(int)] + points.grid_m),
        places_m=places,
        curves_db=curves,
    )


def _singular_points(levels: Floats, grid_m: float, per_100_m: float) -> list[int]:
    """First rows of the sub-segments, and the count of rows at the end."""
    gradient = np.nan_to_num(np.diff(levels, axis=0) / grid_m)
    wanted = max(1, round(len(gradient) * grid_m / 100.0 * per_100_m))
    wanted = min(wanted, len(gradient) // (2 * SHORTEST))
    if wanted < 1:
        return [0, len(levels)]
    search = BottomUp(custom_cost=GradientVariance(), min_size=SHORTEST, jump=1).fit(gradient)
    cuts = search.predict(n_bkps=wanted)[:-1]
    BottomUp.merge.cache_clear()  # its lru_cache would keep every road's arrays alive
    return [0, *cuts, len(levels)]


def _curves(at_m: Floats, levels: Floats, places_m: Floats) -> Floats:
    """Cubics of each cell's level (about `CENTRE_DBM`) at the places; NaN where hardly heard."""
    out = np.full((len(places_m), levels.shape[1]), np.nan)
    middle_m = float(at_m.mean())
    scale_m = max(float(np.ptp(at_m)), 1.0)
    for cell, column in enumerate(levels.T):
        known = ~np.isnan(column)
        if known.sum() >= 2:
            degree = min(CURVE_DEGREE, int(known.sum()) - 1)
            found = np.polyfit((at_m[known] - middle_m) / scale_m, column[known], degree)
            out[:, cell] = np.polyval(found, (places_m - middle_m) / scale_m) - CENTRE_DBM
    return out


def _codes(rows: Floats) -> Int[np.ndarray, "rows features"]:
    """Each feature in `CLASSES` classes of equal size; a further one where there is none."""
    codes = np.full(rows.shape, CLASSES, dtype=np.int64)
    for feature, column in enumerate(rows.T):
        known = ~np.isnan(column)
        if known.any():
            edges = np.quantile(column[known], np.arange(1, CLASSES) / CLASSES)
            codes[known, feature] = np.searchsorted(edges, column[known], side="right")
    return codes


def _salient(codes: Int[np.ndarray, "rows features"], label: np.ndarray) -> np.ndarray:
    """Mask of the smallest set of features of (nearly) full information gain."""
    here = codes[label] if label.any() else codes
    heard = (here < CLASSES).mean(axis=0).reshape(KINDS, -1)[1]
    often = np.sort(np.argsort(-heard, kind="stable")[:MOST_CELLS])
    among = (np.arange(KINDS)[:, None] * len(heard) + often).ravel()
    telling = among[np.ptp(codes[:, among], axis=0) > 0]
    mask = np.zeros(codes.shape[1], dtype=bool)
    if not len(telling) or label.all() or not label.any():
        mask[among] = True
        return mask
    table = GainTable(codes[:, telling], label.astype(np.int64))
    target = table.gain_bits(tuple(range(table.count))) - TOLERANCE_BITS
    exact = None
    if table.count <= EXACT_FEATURES:
        exact = branch_and_bound(table, target, BRANCH_NODES)
    chosen = greedy(table, target) if exact is None else exact
    mask[telling[list(chosen)]] = True
    return mask
