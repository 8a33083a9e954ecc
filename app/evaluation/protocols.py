"""
The two protocols: which windows of a drive are asked, in the order they were driven.

- `anywhere`: windows of a given length that end anywhere along the drive, as vehicles ask.
- `aligned`: the drive cut at its own singular points, as the paper does.

`SPANS` has both; `tour` asks the windows of many drives, simulated or real, under either. A method
that remembers needs to see a drive's windows one after the other; one that does not is asked the
very same. (`scenario.windows` is the short way to simulated windows of either kind.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from app.domain import Window
from app.evaluation.passes import Drive, window_of
from app.evaluation.streams import Purpose, stream
from app.evaluation.truth import Truth
from app.numerics.geodesy import Floats
from app.numerics.segmentation import SegmentationParams, cut_road

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
        rng = stream(seed, Purpose.TOUR, number)
        last_end_m: float | None = None
        for start_m, end_m in SPANS[protocol](one, length_m, each, rng):
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
    as_it_is = SegmentationParams(trend_m=1.0)  # smoothed already
    return cut_road(smooth, 1.0, float(even_m[-1] - even_m[0]), as_it_is) + travelled_m[0]


class Span(NamedTuple):
    """From where to where a window reaches, in travelled distance."""

    start_m: float
    end_m: float


def anywhere(one: Drive, length_m: float, each: int, rng: np.random.Generator) -> list[Span]:
    """``each`` windows of a length, their ends drawn evenly over the way; none if it is shorter."""
    way_m = float(one.travelled_m[-1])
    if way_m < length_m:
        return []
    ends_m = np.sort(rng.uniform(length_m, way_m, size=each))
    return [Span(end_m - length_m, end_m) for end_m in ends_m.tolist()]


def aligned(one: Drive, length_m: float, each: int, rng: np.random.Generator) -> list[Span]:
    """One window from each singular point to the next; length, count and chance have no say."""
    del length_m, each, rng
    return [Span(*ends) for ends in pairwise(singular_points_m(one).tolist())]


SPANS: dict[Protocol, Callable[[Drive, float, int, np.random.Generator], list[Span]]] = {
    "anywhere": anywhere,
    "aligned": aligned,
}
"""Protocol -> the windows of a drive."""


def _ask(
    one: Drive, start_m: float, end_m: float, number: int, last_end_m: float | None
) -> tuple[Asked, int] | None:
    """The window of a span and its last sample's number; None with too few samples or no truth."""
    last = int(np.searchsorted(one.travelled_m, end_m + 1e-6, side="right")) - 1
    length_m = end_m - start_m
    first = int(np.searchsorted(one.travelled_m, one.travelled_m[last] - length_m - 1e-6))
    part = one.trace.rsrp_dbm[first : last + 1]
    too_few = last + 1 - first < FEWEST_SAMPLES or np.isnan(part).all()
    if too_few or np.isnan(one.chainage_m[last]):
        return None
    labelled = window_of(one, first, last)
    since_m = None if last_end_m is None else float(one.travelled_m[last]) - last_end_m
    chainage_m = one.chainage_m[first : last + 1]
    return Asked(labelled.window, labelled.truth, number, since_m, chainage_m), last
