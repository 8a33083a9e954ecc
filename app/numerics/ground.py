"""
Which ground drives ran over, how often, on how many days and both ways: before there are roads.

The ground is squares of `SQUARE_M`. A drive visits the squares of its path and those beside them,
because two drives of one street lie some metres apart; it visits one again when it left it for
`LEFT_M` of way. Memory grows with the ground, not with the drives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray

from app.numerics.geodesy import Floats, metres_per_degree, wrap_longitude_deg

SQUARE_M = 15.0
STEP_M = 7.5  # between points of a path: no square is jumped over
LEFT_M = 150.0
YOUNG_SQUARES = 100_000  # merged into the old ones when there are so many
OPPOSITE = -0.3  # cosine: a way turned by more than 107 degrees is the other direction
ROW_DEG = 0.1  # of latitude: within it all meridians are as far apart as in its middle

Keys = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Squares:
    """
    Squares by their number, sorted; all arrays have shape ``(squares,)``.

    Attributes:
        visits: How often they were driven.
        first_day, last_day: Numbers of days; different where there were several.
        heading: Of the first visit, as a complex unit number.
        both_ways: Whether another visit went against it.
        centre: Whether a path ran through it, not only beside it.
    """

    key: Keys
    visits: NDArray[np.int64]
    first_day: NDArray[np.int64]
    last_day: NDArray[np.int64]
    heading: NDArray[np.complex64]
    both_ways: NDArray[np.bool_]
    centre: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.key)


@dataclass(frozen=True, slots=True)
class GroundSummary:
    """
    Shares of the ground, 0..1.

    ``length_m``: of different ground. ``by_visits``: driven once, twice or three times, more often.
    """

    length_m: float
    once: float
    few: float
    often: float
    several_days: float
    both_ways: float


class Ground:
    """Takes one drive's path after the other."""

    def __init__(self) -> None:
        self._old = self._young = _none()
        self._length_m = 0.0

    def add(
        self, lon: Float[np.ndarray, " points"], lat: Float[np.ndarray, " points"], day: int
    ) -> None:
        """
        A path without gaps.

        Args:
            lon, lat: Points some `STEP_M` apart (`app.numerics.drive_quality` makes them so).
            day: The same number for all drives of a day.
        """
        if len(lon) < 2:
            return
        centre = _keys(lon, lat)
        visited, first_at = _visits(centre, _headings(lon, lat), day)
        at = np.arange(len(centre))
        fresh = first_at[np.searchsorted(visited.key, centre)] >= at - LEFT_M / STEP_M
        fresh &= ~_known(self._old, centre) & ~_known(self._young, centre)
        self._length_m += STEP_M * float(np.count_nonzero(fresh))
        self._young = _merged(self._young, visited)
        if len(self._young) > YOUNG_SQUARES:
            self._old, self._young = _merged(self._old, self._young), _none()

    def summary(self) -> GroundSummary:
        """Of everything so far; all zeros before the first path."""
        every = _merged(self._old, self._young)
        visits = every.visits[every.centre]
        count = max(len(visits), 1)

        def share(which: Bool[np.ndarray, " squares"]) -> float:
            return float(np.count_nonzero(which)) / count

        return GroundSummary(
            length_m=self._length_m,
            once=share(visits == 1),
            few=share((visits == 2) | (visits == 3)),
            often=share(visits > 3),
            several_days=share((every.first_day != every.last_day)[every.centre]),
            both_ways=share(every.both_ways[every.centre]),
        )


def _none() -> Squares:
    whole = np.zeros(0, np.int64)
    flags = np.zeros(0, bool)
    return Squares(whole, whole, whole, whole, np.zeros(0, np.complex64), flags, flags)


def _keys(lon: Floats, lat: Floats) -> Keys:
    """Number of the square that each point lies in."""
    scale = metres_per_degree((np.floor(lat / ROW_DEG) + 0.5) * ROW_DEG)
    east_deg = wrap_longitude_deg(lon) + 180.0
    column = np.floor(east_deg * scale.x_m / SQUARE_M).astype(np.int64)
    return _row(lat) * (1 << 32) + column


def _row(lat: Floats) -> Keys:
    return np.floor((lat + 90.0) * float(metres_per_degree(45.0).y_m) / SQUARE_M).astype(np.int64)


def _headings(lon: Floats, lat: Floats) -> NDArray[np.complex64]:
    east = np.gradient(np.unwrap(lon, period=360.0)) * metres_per_degree(lat).x_m
    way = east + 1j * np.gradient(lat) * metres_per_degree(lat).y_m
    return np.asarray(way / np.maximum(np.abs(way), 1e-9), np.complex64)


def _visits(
    centre: Keys, heading: NDArray[np.complex64], day: int
) -> tuple[Squares, Int[np.ndarray, " squares"]]:
    """The squares of one path and those beside it, and at which point each was met first."""
    around = np.array([(dy << 32) + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)])
    key = (centre[:, None] + around).ravel()
    at = np.repeat(np.arange(len(centre)), len(around))
    on_path = np.tile(around == 0, len(centre))
    order = np.argsort(key, kind="stable")
    key, at, on_path = key[order], at[order], on_path[order]
    new_square = np.diff(key, prepend=key[0] - 1) != 0
    again = np.diff(at, prepend=at[0]) > LEFT_M / STEP_M
    starts = np.flatnonzero(new_square | again)
    one_each = Squares(
        key[starts],
        np.ones(len(starts), np.int64),
        np.full(len(starts), day),
        np.full(len(starts), day),
        heading[at[starts]],
        np.zeros(len(starts), bool),
        np.logical_or.reduceat(on_path, starts),
    )
    return _joined(one_each), at[new_square]


def _known(squares: Squares, key: Keys) -> NDArray[np.bool_]:
    if not len(squares):
        return np.zeros(len(key), bool)
    place = np.minimum(np.searchsorted(squares.key, key), len(squares) - 1)
    return np.asarray(squares.key[place] == key)


def _merged(first: Squares, second: Squares) -> Squares:
    """Both together; of a square in both, the first one's heading stands."""
    if not len(first) or not len(second):
        return first if len(first) else second
    names = Squares.__slots__
    every = Squares(*(np.concatenate([getattr(first, n), getattr(second, n)]) for n in names))
    order = np.argsort(every.key, kind="stable")
    return _joined(Squares(*(getattr(every, name)[order] for name in names)))


def _joined(rows: Squares) -> Squares:
    """Rows of one square, which follow each other, into one."""
    new = np.diff(rows.key, prepend=rows.key[0] - 1) != 0
    starts = np.flatnonzero(new)
    first = rows.heading[starts][np.cumsum(new) - 1]
    against = (rows.heading * first.conj()).real < OPPOSITE
    return Squares(
        rows.key[starts],
        np.add.reduceat(rows.visits, starts),
        np.minimum.reduceat(rows.first_day, starts),
        np.maximum.reduceat(rows.last_day, starts),
        rows.heading[starts],
        np.logical_or.reduceat(rows.both_ways | against, starts),
        np.logical_or.reduceat(rows.centre, starts),
    )
