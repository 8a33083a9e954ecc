"""
Windows of whole drives, in the order they were driven.

A method that remembers needs to see a drive's windows one after the other; one that does not is
asked the very same. Two protocols: `anywhere` ends windows of a given length anywhere along a
drive, as vehicles ask; `aligned` cuts the drive at its own singular points, as the paper does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import count, pairwise
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from app.domain import Direction, Window
from app.evaluation.passes import Drive, drive_of, window_of
from app.evaluation.scenario import City, drive
from app.evaluation.scenario.streams import Purpose, stream
from app.evaluation.truth import Truth
from app.numerics.geodesy import Floats
from app.numerics.segmentation import cut_road

Protocol = Literal["anywhere", "aligned"]
PROTOCOLS: tuple[Protocol, ...] = ("anywhere", "aligned")

WINDOWS_A_DRIVE = 10
SMOOTHED_M = 9.0  # readings are averaged over this before the drive's singular points are sought
FEWEST_SAMPLES = 2


class Asked(NamedTuple):
    """One window of a drive, ``since_m`` of travel after the one before; None for the first."""

    window: Window
    truth: Truth
    drive: int
    since_m: float | None
    chainage_m: Float[np.ndarray, " samples"]


def city_drives(city: City) -> Iterator[Drive]:
    """
    Endless fresh drives over every road both ways, each vehicle with its odometer.

    The odometer's scale is drawn per drive; positions stay true.
    """
    scenario = city.scenario
    ways = list(Direction) if scenario.both_directions else [Direction.FORWARD]
    for number in count():
        for truth in city.roads:
            for way in ways:
                trace = drive(city, truth.road_id, way, number)
                one = drive_of(trace, truth.road_id, truth.line, way)
                key = (truth.index, 0 if way is Direction.FORWARD else 1, number)
                error = stream(city.seed, Purpose.ODOMETER, *key).normal()
                scale = 1.0 + scenario.odometer_error_sd * float(error)
                yield one.with_odometer(one.travelled_m * scale)


def tour(
    drives: Iterable[Drive],
    windows: int,
    *,
    protocol: Protocol,
    length_m: float,
    seed: int,
    each: int = WINDOWS_A_DRIVE,
) -> Iterator[Asked]:
    """
    The first ``windows`` windows of the drives, in order.

    Args:
        length_m: Of a window under `anywhere`; drives that are shorter have none. Under `aligned`
            the singular points decide.
        each: Windows a drive under `anywhere`.
    """
    left = windows
    for number, one in enumerate(drives):
        if left <= 0:
            return
        if protocol == "aligned":
            spans = list(pairwise(singular_points_m(one).tolist()))
        else:
            spans = _spans_anywhere(one, length_m, each, stream(seed, Purpose.TOUR, number))
        last_end_m: float | None = None
        for start_m, end_m in spans:
            asked = _ask(one, start_m, end_m, number, last_end_m)
            if asked is None or left <= 0:
                continue
            last_end_m = float(one.travelled_m[asked[1]])
            left -= 1
            yield asked[0]


def singular_points_m(one: Drive) -> Floats:
    """Travelled distances at which the trend of some cell changes, both ends included."""
    travelled_m, first = np.unique(one.travelled_m, return_index=True)
    rsrp_dbm = one.trace.rsrp_dbm[first].astype(float)
    even_m = np.arange(travelled_m[0], travelled_m[-1] + 1e-9, 1.0)
    columns = []
    for column in rsrp_dbm.T:
        known = ~np.isnan(column)
        if known.sum() > 1:
            columns.append(np.interp(even_m, travelled_m[known], column[known]))
    if not columns or len(even_m) < 2:
        return travelled_m[[0, -1]]
    reach = int(SMOOTHED_M) // 2
    padded = np.pad(np.stack(columns, axis=1), ((reach + 1, reach), (0, 0)), mode="edge")
    total = np.cumsum(padded, axis=0)
    smooth = (total[2 * reach + 1 :] - total[: -2 * reach - 1]) / (2 * reach + 1)
    return cut_road(smooth, 1.0, float(even_m[-1] - even_m[0])) + travelled_m[0]


def _spans_anywhere(
    one: Drive, length_m: float, each: int, rng: np.random.Generator
) -> list[tuple[float, float]]:
    way_m = float(one.travelled_m[-1])
    if way_m < length_m:
        return []
    ends_m = np.sort(rng.uniform(length_m, way_m, size=each))
    return [(end_m - length_m, end_m) for end_m in ends_m.tolist()]


def _ask(
    one: Drive, start_m: float, end_m: float, number: int, last_end_m: float | None
) -> tuple[Asked, int] | None:
    """The window of a span and its last sample's number; None when it holds too few samples."""
    last = int(np.searchsorted(one.travelled_m, end_m + 1e-6, side="right")) - 1
    length_m = end_m - start_m
    first = int(np.searchsorted(one.travelled_m, one.travelled_m[last] - length_m - 1e-6))
    part = one.trace.rsrp_dbm[first : last + 1]
    if last + 1 - first < FEWEST_SAMPLES or np.isnan(part).all():
        return None
    labelled = window_of(one, first, last)
    since_m = None if last_end_m is None else float(one.travelled_m[last]) - last_end_m
    chainage_m = one.chainage_m[first : last + 1]
    return Asked(labelled.window, labelled.truth, number, since_m, chainage_m), last
