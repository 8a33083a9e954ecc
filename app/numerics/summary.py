"""What a posterior over places says in numbers: the road, the position, the radius, the rivals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from app.numerics import native_summary
from app.numerics.geodesy import wrap_longitude_deg
from app.numerics.index import MapIndex, Spot
from app.numerics.posterior import NEGLIGIBLE as NEGLIGIBLE_PLACE
from app.numerics.posterior import SPARED, Places, masses, radius_m
from app.numerics.spread import REACH_SDS, over_segments

PEAK_M = 15.0  # the position is the mean of the posterior this far about its peak
FOOT = 1e-3  # of the peak's density: what lies lower moves no position, looked at or not
NEGLIGIBLE = 1e-9  # less probable rivals are not listed; the others share their mass

# Road number, sub-segment, +1 or -1, mass, and chainage, longitude and latitude of the best place.
Rival = tuple[int, int, int, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Summary:
    """
    The posterior's answer.

    Attributes:
        road: Number of the most probable road; the first of equals.
        peak: Index of its most probable place.
        chainage_m: Mean of the posterior about that place, in one direction.
        heading_deg: Of growing chainage.
        rivals: One a sub-segment and direction, most probable first; ties by road, sub-segment and
            direction, forward first. One that has mass of places beside it only lies at its edge.
    """

    road: int
    road_mass: float
    peak: int
    chainage_m: float
    lon: float
    lat: float
    heading_deg: float
    radius_m: float
    rivals: list[Rival]


def summarise(
    index: MapIndex, places: Places, temperature: float, confidence: float, *, in_c: bool
) -> Summary:
    """
    Road, position, radius at ``confidence`` and rivals.

    Args:
        temperature: Of the window, see `app.domain.Calibration`.
        in_c: Use the kernel in C; without, the numpy code that defines it.
    """
    if in_c:
        told = _summarise_in_c(index, places, temperature, confidence)
    else:
        told = _summarise(index, places, temperature, confidence)
    return _on_the_earth(told) if index.atlas.wraps else told


def _on_the_earth(told: Summary) -> Summary:
    """The same with longitudes in [-180, 180): those of an atlas may run on beyond."""
    lon, *others = wrap_longitude_deg([told.lon, *(rival[5] for rival in told.rivals)]).tolist()
    rivals = [(*rival[:5], each, rival[6]) for rival, each in zip(told.rivals, others, strict=True)]
    return replace(told, lon=lon, rivals=rivals)


def _summarise(index: MapIndex, places: Places, temperature: float, confidence: float) -> Summary:
    mass = masses(places, temperature)
    road, road_mass = _best_road(index, places, mass)
    # The highest score is the highest density: a place's mass also grows with its length of road.
    peak = int(np.where(places.road == road, places.score, -np.inf).argmax())
    chainage_m = _peak_chainage_m(places, mass, peak)
    atlas = index.atlas
    here = atlas.spot(np.array([road]), np.array([chainage_m]))
    x_m, y_m, lon, lat, _ = here.of(atlas.plane)[:, 0].tolist()
    spots = atlas.spot(places.road, places.chainage_m)
    there_m = spots.of(atlas.plane[:2])
    away_m = np.hypot(there_m[0] - x_m, there_m[1] - y_m)
    return Summary(
        road,
        road_mass,
        peak,
        chainage_m,
        lon,
        lat,
        float(atlas.plane[4, here.low[0]]),
        radius_m(away_m, mass, places.width_m, confidence, index.calibration.position_sd_m),
        _rivals(index, places, mass, spots),
    )


def _summarise_in_c(
    index: MapIndex, places: Places, temperature: float, confidence: float
) -> Summary:
    atlas = index.atlas
    return Summary(
        *native_summary.summary(
            places,
            (
                *(atlas.start, atlas.size, atlas.segment, atlas.step_m),
                *(atlas.plane, atlas.edge_m, atlas.first_edge),
            ),
            temperature,
            (PEAK_M, FOOT),
            (confidence, index.calibration.position_sd_m),
            (index.calibration.segment_sd_m, REACH_SDS),
            (NEGLIGIBLE_PLACE, SPARED, NEGLIGIBLE),
        )
    )


def _best_road(
    index: MapIndex, places: Places, mass: Float[np.ndarray, " places"]
) -> tuple[int, float]:
    on_road = np.bincount(places.road, mass, len(index.roads))
    number = int(on_road.argmax())
    return number, float(on_road[number])


def _peak_chainage_m(places: Places, mass: Float[np.ndarray, " places"], peak: int) -> float:
    near = np.abs(places.chainage_m - places.chainage_m[peak]) <= PEAK_M
    near &= (places.where == places.where[:, peak : peak + 1]).all(axis=0)
    foot = FOOT * mass[peak] / places.width_m[peak]
    weight = near * np.maximum(mass - foot * places.width_m, 0.0)
    return float(weight @ places.chainage_m / weight.sum())


def _rivals(
    index: MapIndex,
    places: Places,
    mass: Float[np.ndarray, " places"],
    spots: Spot,
) -> list[Rival]:
    shares = over_segments(index.atlas, places, mass, spots, index.calibration.segment_sd_m)
    place = shares.place
    key = (places.road[place] << 33) + (shares.segment << 1) + (places.sign[place] < 0)
    found, number = np.unique(key, return_inverse=True)
    total = np.bincount(number, shares.mass)
    # Of each the best place of its own; of another sub-segment where it has none.
    order = np.lexsort((place, -places.score[place], shares.spilled, number))
    best = order[number[order].searchsorted(np.arange(len(found)))]
    listed = np.lexsort((found, -total))
    listed = listed[total[listed] > NEGLIGIBLE]
    place, chainage_m = place[best[listed]], shares.chainage_m[best[listed]]
    there = index.atlas.spot(places.road[place], chainage_m).of(index.atlas.plane[2:4])
    names = places.road[place], shares.segment[best[listed]], places.sign[place]
    columns = (*names, total[listed], chainage_m, *there)
    return list(zip(*(column.tolist() for column in columns), strict=True))
