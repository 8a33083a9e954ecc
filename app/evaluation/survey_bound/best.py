"""
The best possible answers: the posterior over every road, direction and place, and its middle.

Windows are equally probable along all roads, both ways, and under each factor that their odometers
may err by (`app.evaluation.survey_bound.odometers`); that vehicles in truth all drive alike is not
told. Of the places the one is answered whose expected distance from where the window ends is least
(the geometric median).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from app.domain import Direction, Window
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.survey_bound.odometers import Odometers
from app.evaluation.survey_bound.places import Law, Terms, law_at
from app.evaluation.survey_bound.roads import CurvesOn, reading_variance_db2, surveyed_curves
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import point_at

NEGLIGIBLE = 1e-9  # places with less of the posterior than this share of the best are left out
ROUNDS = 100  # of Weiszfeld's iteration, at most
SETTLED_M = 1e-4
WAYS = (Direction.FORWARD, Direction.BACKWARD)


@dataclass(frozen=True, slots=True)
class Best:
    """
    The best possible answer to one window.

    Attributes:
        road_id, direction: The most probable.
        chainage_m: The middle of the posterior on that road and direction.
        intervals_m: The central intervals there, of the confidences asked for.
        probability: Of that road and direction.
        lon, lat: The place of least expected distance, over all roads.
        expected_error_m: That distance: the mean error of such answers, if the law is right.
    """

    road_id: str
    direction: Direction
    chainage_m: float
    intervals_m: tuple[tuple[float, float], ...]
    probability: float
    lon: float
    lat: float
    expected_error_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """
    Where windows may end, one entry a road, direction, factor and place.

    Attributes:
        group: Number of the road and direction: twice the road's, plus 1 for backward.
        log_density: Of each window's readings there.
    """

    group: Int[np.ndarray, " ends"]
    chainage_m: Float[np.ndarray, " ends"]
    log_density: Float[np.ndarray, "ends windows"]


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """
    What windows say.

    Attributes:
        rsrp_dbm: Their readings; NaN where a cell was not heard.
        odometer: The length that each one's odometer says, over the nominal one.
        odometers: What these are known to be.
    """

    rsrp_dbm: Float[np.ndarray, "samples windows cells"]
    odometer: Float[np.ndarray, " windows"]
    odometers: Odometers


def best_answers(
    city: City,
    windows: Sequence[Window],
    *,
    step_m: float = 0.25,
    confidences: Sequence[float] = (0.68,),
    odometers: Odometers | None = None,
) -> list[Best]:
    """
    The best possible answer to each window, given the city's survey and the law it was drawn from.

    Costs about a megabyte a window, and the same time for many windows as for one.

    Args:
        windows: All of one length, a sample every ``spacing_m`` of the scenario.
        step_m: Spacing of the places; errors below it are not seen.
        confidences: Of the intervals.
        odometers: What is told of them; None = how far the city's err.

    Raises:
        ValueError: Windows of several lengths, or roads that hear different cells: then which
            cells were heard at all would decide, of which this law says nothing.
    """
    if not windows:
        return []
    told = told_by(city, windows, odometers)
    parts = [
        part
        for number, truth in enumerate(city.roads)
        for part in ends_on(city, truth, number, told, step_m)
    ]
    ends = Ends(
        np.concatenate([part.group for part in parts]),
        np.concatenate([part.chainage_m for part in parts]),
        np.concatenate([part.log_density for part in parts]),
    )
    plane = _Plane.of(city, ends)
    return [
        _answer(city, ends, plane, number, step_m, confidences) for number in range(len(windows))
    ]


def told_by(city: City, windows: Sequence[Window], odometers: Odometers | None = None) -> Told:
    """
    The windows in the order of the city's cells, and what their odometers say.

    Args:
        odometers: See `best_answers`.

    Raises:
        ValueError: See `best_answers`.
    """
    cells = city.roads[0].cells
    if any(truth.cells != cells for truth in city.roads):
        raise ValueError("the roads hear different cells")
    sizes = sorted({len(window.distance_m) for window in windows})
    if len(sizes) > 1:
        raise ValueError(f"windows of {sizes[0]} to {sizes[-1]} samples")
    said = np.array([np.ptp(window.distance_m) for window in windows])
    said /= (sizes[0] - 1) * city.scenario.spacing_m
    rsrp_dbm = np.stack([_columns(window, cells) for window in windows], axis=1)
    return Told(rsrp_dbm, said, odometers or Odometers.alike(city.scenario.odometer_error_sd))


def _columns(window: Window, cells: tuple[str, ...]) -> Float[np.ndarray, "samples cells"]:
    """A window's readings in the order of the city's cells; NaN where one was not heard."""
    out = np.full((len(window.distance_m), len(cells)), np.nan)
    for column, cell in enumerate(window.cells):
        if cell in cells:
            out[:, cells.index(cell)] = window.rsrp_dbm[:, column]
    return out


def ends_on(
    city: City,
    truth: RoadTruth,
    number: int,
    told: Told,
    step_m: float,
    curves_on: CurvesOn = surveyed_curves,
) -> Iterator[Ends]:
    """
    The ends on one road, factor by factor, both ways.

    Args:
        number: Of the road.
        step_m: Spacing of the places.
        curves_on: What is known of the road's levels.
    """
    scenario = city.scenario
    curves = curves_on(city, truth)
    travelled_m = np.arange(len(told.rsrp_dbm)) * scenario.spacing_m
    for factor, log_weight in told.odometers.factors(told.odometer):
        room_m = truth.length_m - factor * travelled_m[-1]
        if room_m < 0:
            continue
        first_m = np.arange(int(room_m / step_m + 1e-9) + 1) * step_m
        at_m = first_m[:, None] + factor * travelled_m
        laws = [law_at(curve, reading_variance_db2(scenario), at_m) for curve in curves]
        for way, direction in enumerate(WAYS[: 2 if scenario.both_directions else 1]):
            along = told.rsrp_dbm if direction is Direction.FORWARD else told.rsrp_dbm[::-1]
            density = _log_density(laws, along, scenario.device_offset_sd_db**2)
            end_m = at_m[:, -1] if direction is Direction.FORWARD else first_m
            group = np.full(len(end_m), 2 * number + way)
            yield Ends(group, end_m, (density + log_weight).astype(np.float32))


def _log_density(
    laws: Sequence[Law],
    readings_dbm: Float[np.ndarray, "samples windows cells"],
    offset_db2: float,
) -> Float[np.ndarray, "places windows"]:
    terms = Terms.none(len(laws[0].log_det), readings_dbm.shape[1])
    for cell, law in enumerate(laws):
        terms.add(law, np.ascontiguousarray(readings_dbm[:, :, cell].T))
    return terms.log_density(offset_db2)


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    """The ends as metres east and north."""

    frame: LocalFrame
    east_m: Float[np.ndarray, " ends"]
    north_m: Float[np.ndarray, " ends"]

    @classmethod
    def of(cls, city: City, ends: Ends) -> _Plane:
        frame = LocalFrame(city.scenario.origin_lon, city.scenario.origin_lat)
        east_m, north_m = np.empty(len(ends.group)), np.empty(len(ends.group))
        for number, truth in enumerate(city.roads):
            here = ends.group // 2 == number
            place = point_at(truth.line, ends.chainage_m[here])
            at = frame.to_xy(place.lon, place.lat)
            east_m[here], north_m[here] = at.x_m, at.y_m
        return cls(frame, east_m, north_m)


def _answer(
    city: City,
    ends: Ends,
    plane: _Plane,
    number: int,
    step_m: float,
    confidences: Sequence[float],
) -> Best:
    log = ends.log_density[:, number].astype(float)
    share = np.exp(log - log.max())
    kept = np.flatnonzero(share > NEGLIGIBLE)
    share = share[kept] / share[kept].sum()
    group, chainage_m = ends.group[kept], ends.chainage_m[kept]
    mass = np.bincount(group, share)
    best = int(mass.argmax())
    here = group == best
    half = 0.5 * np.array(confidences)
    wanted = np.concatenate(([0.5], 0.5 - half, 0.5 + half))
    middle_m, *ends_m = _quantiles(chainage_m[here], share[here], wanted)
    truth = city.roads[best // 2]
    start = point_at(truth.line, middle_m)
    at = plane.frame.to_xy(start.lon, start.lat)
    x_m, y_m, expected_m = _geometric_median(
        plane.east_m[kept], plane.north_m[kept], share, (float(at.x_m), float(at.y_m)), step_m
    )
    place = plane.frame.to_lonlat(x_m, y_m)
    return Best(
        truth.road_id,
        WAYS[best % 2],
        middle_m,
        tuple(zip(ends_m[: len(half)], ends_m[len(half) :], strict=True)),
        float(mass[best]),
        float(place.lon),
        float(place.lat),
        expected_m,
    )


def _quantiles(
    chainage_m: Float[np.ndarray, " ends"],
    share: Float[np.ndarray, " ends"],
    wanted: Float[np.ndarray, " wanted"],
) -> list[float]:
    """Quantiles of weighted places, each the middle of what it stands for."""
    order = np.argsort(chainage_m, kind="stable")
    weight = share[order]
    below = (np.cumsum(weight) - 0.5 * weight) / weight.sum()
    return [float(each) for each in np.interp(wanted, below, chainage_m[order])]


def _geometric_median(
    x_m: Float[np.ndarray, " ends"],
    y_m: Float[np.ndarray, " ends"],
    share: Float[np.ndarray, " ends"],
    start: tuple[float, float],
    step_m: float,
) -> tuple[float, float, float]:
    """
    Weiszfeld's iteration for the place of least expected distance, and that distance.

    Each place stands for a step of road: no distance to it is less than a quarter of that, the mean
    distance within it.
    """
    at_x_m, at_y_m = start
    for _ in range(ROUNDS):
        away_m = np.hypot(np.hypot(x_m - at_x_m, y_m - at_y_m), step_m / 4.0)
        pull = share / away_m
        next_x_m, next_y_m = pull @ x_m / pull.sum(), pull @ y_m / pull.sum()
        moved_m = np.hypot(next_x_m - at_x_m, next_y_m - at_y_m)
        at_x_m, at_y_m = float(next_x_m), float(next_y_m)
        if moved_m < SETTLED_M:
            break
    away_m = np.hypot(np.hypot(x_m - at_x_m, y_m - at_y_m), step_m / 4.0)
    return at_x_m, at_y_m, float(share @ away_m)
