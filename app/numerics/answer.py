"""The fix: places and their posterior, told as road, sub-segment, position, radius and candidates."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from app.domain import Candidate, Direction, Fix
from app.numerics.calibration import off_map_probability
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.lines import heading_deg
from app.numerics.observation import offset_db
from app.numerics.posterior import Places, masses, radius_m
from app.numerics.query import Query

PEAK_M = 15.0  # the position is the mean of the posterior this far about its peak
NEGLIGIBLE = 1e-9  # less probable candidates are not listed; the others share their mass


def answer(index: MapIndex, query: Query, places: Places, confidence: float) -> Fix:
    """
    Tell the posterior over places as a fix.

    The road is the most probable one; the position is the mean of the posterior about its highest
    peak on that road, in one direction; the sub-segment is the one that holds it.
    """
    mass = masses(places, index.calibration.temperature)
    off_map = off_map_probability(index.calibration, float(places.score.max()), query.fine)
    on_road = np.bincount(places.road, mass, len(index.roads))
    number = int(np.argmax(on_road))
    road = index.roads[number]
    peak = int(np.argmax(np.where(places.road == number, mass / places.width_m, -1.0)))
    chainage_m = _peak_chainage_m(places, mass, peak)
    segment = int(_segment_of(road, np.array([chainage_m]))[0])
    candidates = _candidates(index, places, mass, 1.0 - off_map)
    spot = road.xy_at(chainage_m)
    lonlat = index.frame.to_lonlat(spot[0], spot[1])
    sign = int(places.sign[peak])
    return Fix(
        map_version=index.version,
        off_map=off_map > 0.5,
        road_id=road.road_id,
        road_posterior=float(on_road[number]) * (1.0 - off_map),
        segment_index=segment,
        segment_posterior=sum(
            c.posterior
            for c in candidates
            if c.road_id == road.road_id and c.segment_index == segment
        ),
        segment_start_m=float(road.edges_m[segment]),
        segment_end_m=float(road.edges_m[segment + 1]),
        lon=float(lonlat.lon),
        lat=float(lonlat.lat),
        chainage_m=chainage_m,
        direction=_direction(sign),
        heading_deg=(heading_deg(road.line, chainage_m) + (0.0 if sign > 0 else 180.0)) % 360.0,
        accuracy_m=radius_m(_away_m(index, places, spot), mass, places.width_m, confidence),
        confidence=confidence,
        off_map_posterior=off_map,
        device_offset_db=offset_db(
            float(places.residual[peak]), float(places.weight[peak]), index.calibration.offset_sd_db
        ),
        samples_used=len(query.distance_m),
        cells_used=len(query.cells),
        cells_unknown=query.unknown,
        candidates=candidates,
    )


def _peak_chainage_m(places: Places, mass: Float[np.ndarray, " places"], peak: int) -> float:
    near = (places.road == places.road[peak]) & (places.sign == places.sign[peak])
    near &= np.abs(places.chainage_m - places.chainage_m[peak]) <= PEAK_M
    weight = mass[near]
    return float(weight @ places.chainage_m[near] / weight.sum())


def _segment_of(road: RoadIndex, chainage_m: Float[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Index of the sub-segment that holds each chainage; a boundary belongs to the later one."""
    return np.searchsorted(road.edges_m[1:-1], chainage_m, side="right")


def _candidates(
    index: MapIndex, places: Places, mass: Float[np.ndarray, " places"], on_map: float
) -> tuple[Candidate, ...]:
    """One candidate a sub-segment and direction, most probable first; ties by road and place."""
    segment = np.empty(len(places), dtype=np.intp)
    for number in np.unique(places.road):
        mine = places.road == number
        segment[mine] = _segment_of(index.roads[number], places.chainage_m[mine])
    key = (places.road * (1 << 32) + segment * 2) + (places.sign < 0)
    order = np.lexsort((mass / places.width_m, key))
    starts = np.flatnonzero(np.concatenate(([True], np.diff(key[order]) != 0)))
    total = np.add.reduceat(mass[order], starts)
    best = order[np.append(starts[1:], len(order)) - 1]
    ranked = np.argsort(-total, kind="stable")
    listed = ranked[total[ranked] > NEGLIGIBLE]
    share = total[listed] / total[listed].sum() * on_map
    return tuple(
        _candidate(index, places, int(best[group]), int(segment[best[group]]), float(posterior))
        for group, posterior in zip(listed, share, strict=True)
    )


def _candidate(
    index: MapIndex, places: Places, place: int, segment: int, posterior: float
) -> Candidate:
    road = index.roads[int(places.road[place])]
    chainage_m = float(places.chainage_m[place])
    spot = road.xy_at(chainage_m)
    where = index.frame.to_lonlat(spot[0], spot[1])
    return Candidate(
        road_id=road.road_id,
        segment_index=segment,
        direction=_direction(int(places.sign[place])),
        posterior=posterior,
        chainage_m=chainage_m,
        lon=float(where.lon),
        lat=float(where.lat),
    )


def _direction(sign: int) -> Direction:
    return Direction.FORWARD if sign > 0 else Direction.BACKWARD


def _away_m(
    index: MapIndex, places: Places, spot: Float[np.ndarray, " 2"]
) -> Float[np.ndarray, " places"]:
    """Distance of every place from the reported one, as the crow flies."""
    away_m = np.empty(len(places))
    for number in np.unique(places.road):
        mine = places.road == number
        x_m, y_m = index.roads[number].xy_at(places.chainage_m[mine])
        away_m[mine] = np.hypot(x_m - spot[0], y_m - spot[1])
    return away_m
