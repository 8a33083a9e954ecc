"""The fix: a posterior over places, told as road, sub-segment, position, radius and candidates."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from app.domain import Candidate, Direction, Fix
from app.numerics.index import MapIndex
from app.numerics.observation import offset_db
from app.numerics.offmap import off_map_probability
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
    atlas, mass = index.atlas, masses(places, index.calibration.temperature)
    off_map = off_map_probability(index.calibration, float(places.score.max()), query.fine)
    on_road = np.bincount(places.road, mass, len(index.roads))
    number = int(on_road.argmax())
    road = index.roads[number]
    density = mass / places.width_m
    density[places.road != number] = -1.0
    peak = int(density.argmax())
    chainage_m = _peak_chainage_m(places, mass, peak)
    spots = atlas.spot(places.road, places.chainage_m)
    here = atlas.spot(np.array(number), np.array(chainage_m))
    segment = _segment(index, number, chainage_m)
    candidates = _candidates(index, places, mass, np.asarray(spots.low), 1.0 - off_map)
    away_m = np.hypot(
        spots.of(atlas.x_m) - here.of(atlas.x_m), spots.of(atlas.y_m) - here.of(atlas.y_m)
    )
    sign = int(places.sign[peak])
    return Fix(
        map_version=index.version,
        off_map=off_map > 0.5,
        road_id=road.road_id,
        road_posterior=float(on_road[number]) * (1.0 - off_map),
        segment_index=segment,
        segment_posterior=sum(
            one.posterior
            for one in candidates
            if one.segment_index == segment and one.road_id == road.road_id
        ),
        segment_start_m=float(road.edges_m[segment]),
        segment_end_m=float(road.edges_m[segment + 1]),
        lon=float(here.of(atlas.lon)),
        lat=float(here.of(atlas.lat)),
        chainage_m=chainage_m,
        direction=_direction(sign),
        heading_deg=(float(atlas.heading_deg[here.low]) + (0.0 if sign > 0 else 180.0)) % 360.0,
        accuracy_m=radius_m(
            away_m, mass, places.width_m, confidence, index.calibration.position_sd_m
        ),
        confidence=confidence,
        off_map_posterior=off_map,
        device_offset_db=offset_db(
            float(places.residual[peak]), float(places.weight[peak]), index.calibration.offset_sd_db
        ),
        samples_used=query.samples,
        cells_used=len(query.cells),
        cells_unknown=query.unknown,
        candidates=candidates,
    )


def _peak_chainage_m(places: Places, mass: Float[np.ndarray, " places"], peak: int) -> float:
    near = (places.road == places.road[peak]) & (places.sign == places.sign[peak])
    near &= np.abs(places.chainage_m - places.chainage_m[peak]) <= PEAK_M
    weight = mass * near
    return float(weight @ places.chainage_m / weight.sum())


def _segment(index: MapIndex, road: int, chainage_m: float) -> int:
    inner_m = index.roads[road].edges_m[1:-1]
    return int(inner_m.searchsorted(chainage_m, side="right"))


def _candidates(
    index: MapIndex,
    places: Places,
    mass: Float[np.ndarray, " places"],
    low: Int[np.ndarray, " places"],
    on_map: float,
) -> tuple[Candidate, ...]:
    """One candidate a sub-segment and direction, most probable first; ties by road and place."""
    segment = index.atlas.segment[low]
    key = ((places.road << 32) + (segment << 1)) + (places.sign < 0)
    order = np.lexsort((mass / places.width_m, key))
    change = key[order]
    starts = np.concatenate(([0], np.flatnonzero(change[1:] != change[:-1]) + 1))
    total = np.add.reduceat(mass[order], starts)
    best = order[np.append(starts[1:], len(order)) - 1]
    ranked = np.argsort(-total, kind="stable")
    listed = ranked[total[ranked] > NEGLIGIBLE]
    share = total[listed] * (on_map / total[listed].sum())
    chosen = best[listed]
    spots = index.atlas.spot(places.road[chosen], places.chainage_m[chosen])
    return tuple(
        Candidate(index.road_ids[road], part, _direction(sign), posterior, chainage_m, lon, lat)
        for road, part, sign, posterior, chainage_m, lon, lat in zip(
            places.road[chosen].tolist(),
            segment[chosen].tolist(),
            places.sign[chosen].tolist(),
            share.tolist(),
            places.chainage_m[chosen].tolist(),
            spots.of(index.atlas.lon).tolist(),
            spots.of(index.atlas.lat).tolist(),
            strict=True,
        )
    )


def _direction(sign: int) -> Direction:
    return Direction.FORWARD if sign > 0 else Direction.BACKWARD
