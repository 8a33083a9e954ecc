"""
`paper`: the equations of "Road-Aware Localization With Salient Feature Matching in Heterogeneous
Networks" (Cong, Li, Meng, Zhu), literally.

Offline, on the sequence of reference points of each road: gradients (Eq. 1), the five kinds of
feature (Eqs. 2, 3), singular points by bottom-up segmentation with the cost of Eq. 5 (the variance
of the gradient within each sub-segment, summed over cells), salient features by information gain
(Eqs. 6, 7) for each road and sub-segment, fitted curves in each sub-segment. Online: the window's
features, ``Pr(f | r) = exp(-||W_r (e_u - e_r)||)``, the same for sub-segments (Eqs. 8-11), then the
coordinate on the fitted curves.

What the paper leaves open, and what is done here:

- When bottom-up stops. ``cuts_per_100_m`` (1, 2, 4) is chosen on held-out survey windows.
- Gradients of readings 1 m apart are noise: readings may be averaged over ``smooth_m`` (0, 9) first.
- The entropies' probabilities. The road (or sub-segment) is the label; the features of the stretch
  of ``window_m`` about every fourth metre are cut into four classes of equal size. As gain never
  falls when a feature is added, the smallest set within 0.02 bit of the full gain is taken: of
  up to ten features by a search that returns what the exhaustive one would, beyond greedily (2^30
  subsets at six cells). Of a city's hundreds of cells the twelve heard most on a stretch compete.
- Text and Eq. 10 differ: road first, then its sub-segments, or the largest product over all.
  ``road_first`` (both) is chosen on the survey. ``Pr(s | r)`` is the share of the road's length.
- Travel against the survey turns the sign of gradients: both ways are compared and the nearer one
  is the direction.
- The mapping from RSRP to a coordinate: a cubic of each cell's RSRP along the sub-segment; the
  place whose RSRP is nearest in the sum of squares to the mean of the last ``average_m`` (0, 6).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int
from ruptures.base import BaseCost
from ruptures.detection import BottomUp

from app.domain import Direction, Window
from app.evaluation.methods.base import Estimate, Previous, Survey
from app.evaluation.methods.references import (
    CENTRE_DBM,
    References,
    lay_references,
    recent_mean_dbm,
)
from app.evaluation.methods.tuning import choose
from app.numerics.geodesy import Floats
from app.numerics.lines import point_at
from app.numerics.selection import TOLERANCE_BITS, GainTable, branch_and_bound, greedy

name = "paper"

KINDS = 5
CLASSES = 4
ROW_STEP_M = 4.0
EXACT_FEATURES = 10  # beyond, the search is greedy: 2^30 subsets at six cells
BRANCH_NODES = 1000
MOST_CELLS = 12  # of a city's hundreds, those heard most on the stretch
CURVE_DEGREE = 3
PLACE_STEP_M = 0.5
SHORTEST = 3  # reference points in a sub-segment


@dataclass(frozen=True, slots=True)
class Parameters:
    """What is chosen on the survey."""

    cuts_per_100_m: float
    smooth_m: float
    road_first: bool
    average_m: float


CHOICES = tuple(
    Parameters(*each) for each in product((1.0, 2.0, 4.0), (0.0, 9.0), (True, False), (0.0, 6.0))
)


def fit(survey: Survey, seed: int) -> PaperModel:
    """Segment, select and fit; the parameters are chosen on held-out survey windows."""
    drawn: dict[tuple[int, float, float], Atlas] = {}

    def trial(train: Survey, each: Parameters) -> PaperModel:
        key = (id(train), each.cuts_per_100_m, each.smooth_m)
        if key not in drawn:
            drawn[key] = draw_atlas(train, each)
        return PaperModel(drawn[key], each)

    best = choose(CHOICES, trial, survey, seed)
    return PaperModel(draw_atlas(survey, best), best)


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

    def distance(self, seen: Float[np.ndarray, " features"], rows: slice) -> Floats:
        """``||W (e_u - e)||`` of the rows; a feature that one side lacks is left out."""
        difference = np.where(self.mask[rows], seen - self.features[rows], 0.0)
        return np.sqrt(np.nansum(difference**2, axis=1))


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


class PaperModel:
    """The paper's map, ready to be asked."""

    def __init__(self, atlas: Atlas, parameters: Parameters) -> None:
        self.parameters = parameters
        self._atlas = atlas
        cells = len(atlas.points.cells)
        self._turn = np.concatenate([-np.ones(cells), np.ones((KINDS - 1) * cells)])

    def locate(self, window: Window, previous: Previous | None) -> Estimate:
        """Road, sub-segment, coordinate."""
        del previous
        atlas = self._atlas
        columns = atlas.points.columns(window)
        smooth = recent_mean_dbm(columns, window.distance_m, self.parameters.smooth_m)
        seen = features(smooth, window.distance_m, atlas.reference)
        segment, sign, posterior = self._match(seen)
        last = recent_mean_dbm(columns, window.distance_m, self.parameters.average_m)[-1]
        away = np.nansum((atlas.curves_db[segment] - (last - CENTRE_DBM)) ** 2, axis=1)
        chainage_m = float(atlas.places_m[segment][int(away.argmin())])
        road_id = atlas.points.road_ids[int(atlas.road[segment])]
        place = point_at(atlas.survey.line(road_id), chainage_m)
        return Estimate(
            road_id,
            chainage_m,
            float(place.lon),
            float(place.lat),
            Direction.FORWARD if sign > 0 else Direction.BACKWARD,
            posterior,
            (float(atlas.start_m[segment]), float(atlas.end_m[segment])),
        )

    def _match(self, seen: Floats) -> tuple[int, int, float]:
        """Eqs. 8 to 11: the sub-segment, the direction and its posterior."""
        atlas, all_rows = self._atlas, slice(None)
        road_log = np.stack(
            [-atlas.roads.distance(way, all_rows) for way in (seen, seen * self._turn)]
        )
        segment_log = np.stack(
            [-atlas.segments.distance(way, all_rows) for way in (seen, seen * self._turn)]
        )
        joint = road_log[:, atlas.road] + segment_log + np.log(atlas.share)
        choice = joint
        if self.parameters.road_first:
            road = int(road_log.max(axis=0).argmax())
            choice = np.full_like(joint, -np.inf)
            inside = slice(int(atlas.first[road]), int(atlas.first[road + 1]))
            choice[:, inside] = segment_log[:, inside]
        way, segment = np.unravel_index(int(choice.argmax()), choice.shape)
        mass = np.exp(joint - joint.max())
        return int(segment), 1 if way == 0 else -1, float(mass[:, segment].sum() / mass.sum())


def draw_atlas(survey: Survey, parameters: Parameters) -> Atlas:
    """The offline part."""
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
        smooth = recent_mean_dbm(levels, at_m, parameters.smooth_m)
        edges = _singular_points(smooth, points.grid_m, parameters.cuts_per_100_m)
        road_features.append(features(smooth, at_m, reference))
        for start, end in zip(edges[:-1], edges[1:], strict=True):
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
        roads=Scale(np.array(road_features), road_mask),
        segments=Scale(np.array(segment_features), segment_mask),
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
