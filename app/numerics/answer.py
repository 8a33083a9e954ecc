"""The fix: a posterior over places, told as road, sub-segment, position, radius and candidates."""

from __future__ import annotations

from collections.abc import Sequence

from app.domain import Candidate, Direction, Fix
from app.numerics import native_summary
from app.numerics.index import MapIndex, RoadIndex
from app.numerics.offmap import (
    ELSEWHERE,
    FACTOR,
    Fit,
    best_fit,
    err_apart,
    off_map_probability,
)
from app.numerics.offsets import offset_db
from app.numerics.posterior import APART, RESIDUAL, SCORE, Known, Places
from app.numerics.query import Query
from app.numerics.summary import Rival, summarise
from app.numerics.this_road import weigh


def answer(
    index: MapIndex,
    query: Query,
    places: Places,
    confidence: float,
    known: Known | None = None,
) -> Fix:
    """
    Tell the posterior over places as a fix.

    The road is the most probable one; the position is the mean of the posterior about its highest
    peak on that road, in one direction; the sub-segment is the one that holds it.

    Args:
        known: Of the last places; None = all are alike.
    """
    temperature, best = query.temperature(index.calibration), int(places.score.argmax())
    fit = fit_of_place(index, query, places, best, known)
    off_map = off_map_probability(index.calibration, fit, query.information(index.calibration))
    if fit is not None and fit.noise > 1.0:
        places = _of_noise(places, fit.noise, temperature, known)
        temperature *= fit.noise
    in_c = query.told is not None
    told = summarise(index, places, temperature, confidence, in_c=in_c)
    road, sign = index.roads[told.road], int(places.sign[told.peak])
    segment = road.segment_at(told.chainage_m)
    residual, weight = places.values[RESIDUAL:APART, told.peak].tolist()
    on_map = (1.0 - off_map) / sum([rival[3] for rival in told.rivals])
    named = native_summary.candidates if in_c else as_candidates
    candidates = named(told.rivals, index.road_ids, on_map)
    return Fix(
        map_version=index.version,
        off_map=off_map > 0.5,
        road_id=road.road_id,
        road_posterior=told.road_mass * (1.0 - off_map),
        segment_index=segment,
        segment_posterior=sum(
            [one[3] for one in candidates if one[1] == segment and one[0] == road.road_id]
        ),
        segment_start_m=float(road.edges_m[segment]),
        segment_end_m=float(road.edges_m[segment + 1]),
        lon=told.lon,
        lat=told.lat,
        chainage_m=told.chainage_m,
        direction=_direction(sign),
        heading_deg=(told.heading_deg + (0.0 if sign > 0 else 180.0)) % 360.0,
        accuracy_m=told.radius_m,
        confidence=confidence,
        off_map_posterior=off_map,
        device_offset_db=offset_db(residual, weight, query.prior(index)),
        samples_used=query.samples,
        cells_used=len(query.cells),
        cells_unknown=query.unknown,
        candidates=candidates,
    )


def _of_noise(places: Places, times: float, temperature: float, known: Known | None) -> Places:
    """
    Places whose scores are to be divided by more, as noisier readings say less; what is known of
    the last places beforehand is no less known for it.
    """
    if known is None or not len(known.log_prior):
        return places
    values = places.values.copy()
    values[SCORE, -len(known.log_prior) :] += known.log_prior * (temperature * (times - 1.0))
    return Places(places.where, values)


def fit_of_place(
    index: MapIndex,
    query: Query,
    places: Places,
    place: int,
    known: Known | None = None,
    own: RoadIndex | None = None,
) -> Fit | None:
    """
    How well the window fits at a place; None when the map knows none of its cells.

    Args:
        known: Of the last places.
        own: A road to be taken for the one of its number in the map.
    """
    if not query.cells:
        return None
    score, *offsets = places.values[SCORE:, place].tolist()
    prior, calibration, elsewhere = query.prior(index), index.calibration, 0.0
    factor = 1.0
    if known is not None and (last := place - len(places) + len(known.log_prior)) >= 0:
        score -= query.temperature(calibration) * float(known.log_prior[last])
        factor = float(known.factor[last])
    judged = 0.0, 1.0
    alone = err_apart(calibration)
    if not alone or any(calibration.off_map[ELSEWHERE:FACTOR]):  # only older maps ask for both
        elsewhere = query.elsewhere(calibration)
    if alone:
        number, sign = places.where[:, place].tolist()
        road = own if own is not None and own.number == number else index.roads[number]
        judged = weigh(query, road, sign, float(places.chainage_m[place]), prior, factor).judged()
    return best_fit((score, *offsets), prior, query.readings, elsewhere, judged)


def as_candidates(
    rivals: Sequence[Rival], names: tuple[str, ...], share: float
) -> tuple[Candidate, ...]:
    """
    The rivals by their roads' names.

    Args:
        share: What the masses are multiplied by.
    """
    return tuple(
        [
            Candidate(names[road], segment, _direction(sign), mass * share, *place)
            for road, segment, sign, mass, *place in rivals
        ]
    )


def _direction(sign: int) -> Direction:
    return Direction.FORWARD if sign > 0 else Direction.BACKWARD
