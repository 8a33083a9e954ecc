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
- Gradients of readings 1 m apart are noise: readings may be averaged over ``smooth_m`` (0, 9).
- The entropies' probabilities. The road (or sub-segment) is the label; the features of the stretch
  of ``window_m`` about every fourth metre are cut into four classes of equal size. As gain never
  falls when a feature is added, the smallest set within 0.02 bit of the full gain is taken: of
  up to ten features by a search that returns what the exhaustive one would, beyond greedily (2^30
  subsets at six cells). Of a city's hundreds of cells the twelve heard most on a stretch compete.
  Read to the letter the largest gain is that of all features: ``select`` (both) is chosen on the
  survey, because distances over sets of different size favour the small ones.
- Text and Eq. 10 differ: road first, then its sub-segments, or the largest product over all.
  ``road_first`` (both) is chosen on the survey. ``Pr(s | r)`` is the share of the road's length.
- Travel against the survey turns the sign of gradients: both ways are compared and the nearer one
  is the direction.
- Cells that a stretch or a window does not hear (the paper's are heard everywhere) count as heard
  at the survey's faintest percent, unchanging.
- The mapping from RSRP to a coordinate: a cubic of each cell's RSRP along the sub-segment; the
  place whose RSRP is nearest in the sum of squares to the mean of the last ``average_m`` (0, 6).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from app.domain import Direction, Window
from app.evaluation.methods.base import Estimate, Previous, Survey
from app.evaluation.methods.paper_map import KINDS, Atlas, completed, draw_atlas, features
from app.evaluation.methods.references import CENTRE_DBM, recent_mean_dbm
from app.evaluation.methods.tuning import choose
from app.numerics.geodesy import Floats
from app.numerics.lines import point_at

name = "paper"


@dataclass(frozen=True, slots=True)
class Parameters:
    """What is chosen on the survey."""

    cuts_per_100_m: float
    smooth_m: float
    road_first: bool
    average_m: float
    select: bool = True


CHOICES = tuple(
    Parameters(*each)
    for each in product((1.0, 2.0, 4.0), (0.0, 9.0), (True, False), (0.0, 6.0), (True, False))
)


def fit(survey: Survey, seed: int) -> PaperModel:
    """Segment, select and fit; the parameters are chosen on held-out survey windows."""
    drawn: dict[tuple[int, float, float], Atlas] = {}

    def trial(train: Survey, each: Parameters) -> PaperModel:
        key = (id(train), each.cuts_per_100_m, each.smooth_m)
        if key not in drawn:
            drawn[key] = draw_atlas(train, each.cuts_per_100_m, each.smooth_m)
        return PaperModel(drawn[key], each)

    best = choose(CHOICES, trial, survey, seed)
    return PaperModel(draw_atlas(survey, best.cuts_per_100_m, best.smooth_m), best)


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
        found = features(smooth, window.distance_m, atlas.reference)
        seen = completed(found, atlas.points.floor_dbm, atlas.reference)
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
        atlas = self._atlas
        ways = (seen, seen * self._turn)
        select = self.parameters.select
        road_log = np.stack([-atlas.roads.distance(way, select=select) for way in ways])
        segment_log = np.stack([-atlas.segments.distance(way, select=select) for way in ways])
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
