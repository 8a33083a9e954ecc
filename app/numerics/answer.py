"""The fix: a posterior over places, told as road, sub-segment, position, radius and candidates."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from app.domain import Candidate, Direction, Fix
from app.numerics.index import MapIndex, Spot
from app.numerics.observation import offset_db
from app.numerics.offmap import fit_per_reading, off_map_probability
from app.numerics.posterior import RESIDUAL, SCORE, WEIGHT, Places, masses, radius_m
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
    off_map = off_map_probability(index.calibration, fit_at_best(index, query, places))
    number, road_mass = _best_road(index, places, mass)
    density = mass / places.width_m
    peak = int((density * (places.road == number)).argmax())
    chainage_m = _peak_chainage_m(places, mass, peak)
    road, sign = index.roads[number], int(places.sign[peak])
    here = _here(index, number, chainage_m)
    segment = int(road.edges_m[1:-1].searchsorted(chainage_m, side="right"))
    spots = index.atlas.spot(places.road, places.chainage_m)
    candidates = _candidates(index, places, mass, density, spots, 1.0 - off_map)
    away_m = np.hypot(spots.of(index.atlas.x_m) - here.x_m, spots.of(index.atlas.y_m) - here.y_m)
    return Fix(
        map_version=index.version,
        off_map=off_map > 0.5,
        road_id=road.road_id,
        road_posterior=road_mass * (1.0 - off_map),
        segment_index=segment,
        segment_posterior=sum(
            one.posterior
            for one in candidates
            if one.segment_index == segment and one.road_id == road.road_id
        ),
        segment_start_m=float(road.edges_m[segment]),
        segment_end_m=float(road.edges_m[segment + 1]),
        lon=here.lon,
        lat=here.lat,
        chainage_m=chainage_m,
        direction=_direction(sign),
        heading_deg=(here.heading_deg + (0.0 if sign > 0 else 180.0)) % 360.0,
        accuracy_m=radius_m(
            away_m, mass, places.width_m, confidence, index.calibration.position_sd_m
        ),
        confidence=confidence,
        off_map_posterior=off_map,
        device_offset_db=offset_db(
            float(places.values[RESIDUAL, peak]),
            float(places.values[WEIGHT, peak]),
            index.offset_prior,
        ),
        samples_used=query.samples,
        cells_used=len(query.cells),
        cells_unknown=query.unknown,
        candidates=candidates,
    )


def fit_at_best(index: MapIndex, query: Query, places: Places) -> float | None:
    """How well the window fits where it fits best; None when the map knows none of its cells."""
    if not query.cells:
        return None
    best = int(places.score.argmax())
    score, residual, weight = places.values[SCORE:, best].tolist()
    return fit_per_reading(score, residual, weight, index.offset_prior, query.fine)


@dataclass(frozen=True, slots=True)
class _Here:
    """The reported position, in the map's local metres and in degrees."""

    x_m: float
    y_m: float
    lon: float
    lat: float
    heading_deg: float


def _here(index: MapIndex, number: int, chainage_m: float) -> _Here:
    atlas, road = index.atlas, index.roads[number]
    at = chainage_m / road.step_m
    low = min(int(at), road.grid_size - 2)
    share, low = at - low, low + int(atlas.start[number])
    x_m, y_m, lon, lat = (
        float(values[low] + share * (values[low + 1] - values[low]))
        for values in (atlas.x_m, atlas.y_m, atlas.lon, atlas.lat)
    )
    return _Here(x_m, y_m, lon, lat, float(atlas.heading_deg[low]))


def _best_road(
    index: MapIndex, places: Places, mass: Float[np.ndarray, " places"]
) -> tuple[int, float]:
    """The most probable road and its posterior; the first of equals."""
    on_road = np.bincount(places.road, mass, len(index.roads))
    number = int(on_road.argmax())
    return number, float(on_road[number])


def _peak_chainage_m(places: Places, mass: Float[np.ndarray, " places"], peak: int) -> float:
    near = np.abs(places.chainage_m - places.chainage_m[peak]) <= PEAK_M
    near &= (places.where == places.where[:, peak : peak + 1]).all(axis=0)
    weight = mass * near
    return float(weight @ places.chainage_m / weight.sum())


def _candidates(
    index: MapIndex,
    places: Places,
    mass: Float[np.ndarray, " places"],
    density: Float[np.ndarray, " places"],
    spots: Spot,
    on_map: float,
) -> tuple[Candidate, ...]:
    """One candidate a sub-segment and direction, most probable first; ties by road and place."""
    segment = np.asarray(index.atlas.segment[spots.low])
    key = (places.road << 33) + (segment << 1) + (places.sign < 0)
    edges = [0, *((key[1:] != key[:-1]).nonzero()[0] + 1).tolist(), len(key)]
    total: dict[int, float] = {}
    best: dict[int, int] = {}
    for start, end in pairwise(edges):
        one = int(key[start])
        peak = start + int(density[start:end].argmax())
        total[one] = total.get(one, 0.0) + float(mass[start:end].sum())
        if one not in best or density[peak] > density[best[one]]:
            best[one] = peak
    listed = sorted((-total[one], one) for one in total if total[one] > NEGLIGIBLE)
    share = on_map / -sum(less for less, _ in listed)
    return tuple(
        _candidate(index, places, best[one], int(segment[best[one]]), -less * share)
        for less, one in listed
    )


def _candidate(
    index: MapIndex, places: Places, place: int, segment: int, posterior: float
) -> Candidate:
    number, sign = places.where[:, place].tolist()
    chainage_m = float(places.chainage_m[place])
    spot = _here(index, number, chainage_m)
    return Candidate(
        index.road_ids[number],
        segment,
        _direction(sign),
        posterior,
        chainage_m,
        spot.lon,
        spot.lat,
    )


def _direction(sign: int) -> Direction:
    return Direction.FORWARD if sign > 0 else Direction.BACKWARD
