"""Fresh drives of a city, and windows of them, each with its truth."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count as numbers

import numpy as np

from app.domain import Direction, Window
from app.evaluation.passes import Drive, drive_of
from app.evaluation.protocols import Protocol, tour
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.drives import drive, report
from app.evaluation.streams import Purpose, stream
from app.evaluation.truth import Labelled, Truth
from app.numerics.lines import point_at


def city_drives(city: City) -> Iterator[Drive]:
    """
    Endless fresh drives over every road both ways, each vehicle with its odometer.

    The odometer's scale is drawn per drive; positions stay true.
    """
    scenario = city.scenario
    ways = list(Direction) if scenario.both_directions else [Direction.FORWARD]
    for number in numbers():
        for truth in city.roads:
            for way in ways:
                trace = drive(city, truth.road_id, way, number)
                one = drive_of(trace, truth.road_id, truth.line, way)
                key = (truth.index, 0 if way is Direction.FORWARD else 1, number)
                error = stream(city.seed, Purpose.ODOMETER, *key).normal()
                scale = 1.0 + scenario.odometer_error_sd * float(error)
                yield one.with_odometer(one.travelled_m * scale)


def windows(
    city: City,
    count: int,
    *,
    length_m: float | None = 30.0,
    duration_s: float | None = None,
    protocol: Protocol = "anywhere",
) -> list[Labelled]:
    """
    Windows under a protocol (`app.evaluation.protocols`). More of them begin with the same ones.

    Args:
        length_m: Travelled distance from first to last sample, at most; a multiple of the spacing.
        duration_s: Instead of it: the time from first to last sample.
        protocol: ``anywhere``: each by a vehicle of its own, on a road drawn in proportion to the
            room it has for such a window, its end uniform along the road. ``aligned``: whole fresh
            drives over every road, cut at their own singular points; the length has no say.

    Raises:
        ValueError: No road is long enough, or the window holds fewer than two samples.
    """
    if protocol == "aligned":
        found = tour(city_drives(city), count, protocol=protocol, length_m=0.0, seed=city.seed)
        return [Labelled(asked.window, asked.truth) for asked in found]
    scenario = city.scenario
    reach_m = length_m if duration_s is None else duration_s * scenario.speed_mps
    if reach_m is None:
        raise ValueError("a window needs length_m or duration_s")
    samples = int(reach_m / scenario.spacing_m + 1e-9) + 1
    if samples < 2:
        raise ValueError(
            f"{reach_m} m hold {samples} sample at a spacing of {scenario.spacing_m} m"
        )
    span_m = (samples - 1) * scenario.spacing_m
    room_m = np.array([max(0.0, truth.length_m - span_m) for truth in city.roads])
    if not room_m.any():
        raise ValueError(f"no road is longer than the window's {span_m} m")
    bounds = np.cumsum(room_m) / np.sum(room_m)
    return [_window(city, bounds, samples, number) for number in range(count)]


def _window(city: City, bounds: np.ndarray, samples: int, number: int) -> Labelled:
    scenario = city.scenario
    rng = stream(city.seed, Purpose.WINDOW, number)
    truth = city.roads[int(np.searchsorted(bounds, rng.uniform(), side="right"))]
    backward = rng.uniform() < 0.5 and scenario.both_directions
    direction = Direction.BACKWARD if backward else Direction.FORWARD
    travelled_m = np.arange(samples) * scenario.spacing_m
    start_m = rng.uniform(0.0, truth.length_m - travelled_m[-1])
    chainage_m = start_m + travelled_m
    if direction is Direction.BACKWARD:
        chainage_m = truth.length_m - chainage_m
    offset_db = scenario.device_offset_sd_db * rng.normal()
    scale = 1.0 + scenario.odometer_error_sd * rng.normal()
    mean_dbm = truth.mean_dbm(chainage_m, drifted=True) + offset_db
    rsrp_dbm = report(mean_dbm, scenario, rng)
    heard = np.isfinite(rsrp_dbm).any(axis=0)
    cells = tuple(cell for cell, there in zip(truth.cells, heard, strict=True) if there)
    window = Window(cells, travelled_m * scale, rsrp_dbm[:, heard])
    return Labelled(window, _truth(truth, float(chainage_m[-1]), direction))


def _truth(truth: RoadTruth, chainage_m: float, direction: Direction) -> Truth:
    place = point_at(truth.line, chainage_m)
    return Truth(truth.road_id, chainage_m, direction, float(place.lon), float(place.lat))
