"""Which place was answered, and which one it has to be told from."""

from __future__ import annotations

import numpy as np

from app.domain import Fix
from app.numerics.chosen import choose
from app.numerics.coarse import shortlist
from app.numerics.contributions import Place, contributions
from app.numerics.corners import way_of
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, place
from app.numerics.posterior import Places
from app.numerics.query import Query
from app.numerics.refinement import refine
from app.numerics.stretches import whole_roads
from app.numerics.summary import PEAK_M
from app.numerics.ways import places_along


def answered_place(index: MapIndex, query: Query, fix: Fix) -> Place:
    """The peak of the score beside the position, which is the posterior's mean about it."""
    road, sign = index.road_ids.index(fix.road_id), fix.direction.sign
    near = [
        Place(road, sign, one.chainage_m)
        for one in fix.candidates
        if one.road_id == fix.road_id
        and one.direction is fix.direction
        and abs(one.chainage_m - fix.chainage_m) <= PEAK_M
    ]
    near = near or [Place(road, sign, fix.chainage_m)]
    near += _round_corners(index, query, near[0], fix.chainage_m)
    temperature = query.temperature(index.calibration)

    def density(one: Place) -> float:
        return contributions(index, query, one).score + temperature * one.log_prior

    return max(near, key=density)


def _round_corners(index: MapIndex, query: Query, near: Place, chainage_m: float) -> list[Place]:
    """Of each turn that the window may have taken, the best place beside the answer's."""
    found = []
    for corner in choose(index, query, strays=True)[1]:
        way = way_of(index, corner.turn)
        places = places_along(index, query, way, (corner.first_m, corner.last_m))
        beside = np.abs(places.chainage_m - chainage_m) <= PEAK_M
        beside &= (places.road == near.road) & (places.sign == near.sign)
        if beside.any():
            best = int(np.where(beside, places.score, -np.inf).argmax())
            at_m = float(places.chainage_m[best])
            found.append(Place(near.road, near.sign, at_m, way))
    return found


def factor_beside(index: MapIndex, query: Query, answer: Place) -> float:
    """What the window's distances are multiplied by where it fits best beside the answer."""
    placed = place(index, query, strays=answer.way is not None)
    places, known = placed.places, placed.known
    if known is None:
        return 1.0
    beside = np.abs(places.chainage_m - answer.chainage_m) <= PEAK_M
    beside &= (places.road == answer.road) & (places.sign == answer.sign)
    best = int(np.where(beside, places.score, -np.inf).argmax())
    last = best - len(places) + len(known.factor)
    return float(known.factor[last]) if last >= 0 else 1.0


def runner_up(index: MapIndex, query: Query, answer: Place) -> Place:
    """The best place on another road; in a map of one, elsewhere on it or the other way."""
    if len(index.roads) > 1:
        places = fine_places(index, query, shortlist(index, query, without=answer.road))
        return _best(refine(index, query, places))
    places = whole_roads(index, query)
    edges_m = index.roads[answer.road].edges_m[1:-1]
    own = edges_m.searchsorted(answer.chainage_m, side="right")
    same = edges_m.searchsorted(places.chainage_m, side="right") == own
    same |= np.abs(places.chainage_m - answer.chainage_m) <= PEAK_M
    return _best(places.take(~(same & (places.sign == answer.sign))))


def _best(places: Places) -> Place:
    best = int(places.score.argmax())
    road, sign = places.where[:, best].tolist()
    return Place(road, sign, float(places.chainage_m[best]))
