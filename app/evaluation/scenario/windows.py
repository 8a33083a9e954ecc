"""Windows of fresh drives, each with its truth."""

from __future__ import annotations

from typing import Literal

import numpy as np

from app.domain import Direction, Window
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.drives import report
from app.evaluation.scenario.streams import Purpose, stream
from app.evaluation.truth import Labelled, Truth
from app.numerics.lines import point_at


def windows(
    city: City,
    count: int,
    *,
    length_m: float | None = 30.0,
    duration_s: float | None = None,
    protocol: Literal["anywhere"] = "anywhere",
) -> list[Labelled]:
    """
    Windows that end anywhere on the roads, each by a vehicle of its own.

    A road is drawn in proportion to the room it has for such a window. Window ``i`` is the same
    however many are asked for.

    Args:
        length_m: Travelled distance from first to last sample, at most; a multiple of the spacing.
        duration_s: Instead of it: the time from first to last sample.
        protocol: ``anywhere``: ends are uniform along the road.

    Raises:
        ValueError: No road is long enough, or the window holds fewer than two samples.
    """
    del protocol  # one so far: said by the caller so that results name it
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
