"""One drive's positions: how it moved, and what they are worth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.numerics.geodesy import Floats, LocalFrame
from app.numerics.ground import STEP_M

FASTEST_MPS = 60.0  # as `app.numerics.network.cleaning` has it: faster and farther is a jump
SLACK_M = 20.0
BIN_S = 3.0  # fixes of so long are averaged before anything is said of speed
STANDS_MPS = 0.8  # slower between two bins' neighbours: the car stands, and its fixes jitter
MOST_STEP_M = 150.0  # between two bins: farther, nobody knows the way
DEGREE_M = 111_320.0  # along a meridian, and on the equator
DECIMALS = range(2, 8)
EXACT = 1e-3  # of a unit of the last decimal: what float64 may add
NEARLY_ALL = 0.99
CALM = 0.6745  # median of |N(0, 1)|


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """
    How a drive moved.

    Attributes:
        driven_s: Its time, gaps left out; ``standing_s`` of it stood.
        travelled_m: Its way while it moved.
        speed_mps: Of each stretch of `BIN_S` in which it moved.
        jumps: Steps that no car drives.
        jitter_m: Standard deviation of a fix across the way; NaN where nothing can be said.
        decimals: Of its longitudes and latitudes, 8 when they have more than seven.
        paths: Longitudes and latitudes of its way in steps of `STEP_M`, cut at gaps.
    """

    driven_s: float
    standing_s: float
    travelled_m: float
    speed_mps: Floats
    jumps: int
    jitter_m: float
    decimals: tuple[int, int]
    paths: list[tuple[Floats, Floats]]


def motion_of(
    time_s: Float[np.ndarray, " samples"],
    lon: Float[np.ndarray, " samples"],
    lat: Float[np.ndarray, " samples"],
    longest_gap_s: float = 60.0,
) -> Motion:
    """
    What the positions of a drive say.

    Args:
        longest_gap_s: A longer silence is no driving.
    """
    frame = LocalFrame(float(lon[0]), float(lat[0]))
    xy = frame.to_xy(lon, lat)
    at = np.asarray(xy.x_m + 1j * xy.y_m)
    step_s, step_m = np.diff(time_s), np.abs(np.diff(at))
    jump = step_m > FASTEST_MPS * step_s + SLACK_M
    kept = np.concatenate([[True], ~jump])
    binned_s, binned = _bins(time_s[kept], at[kept])
    moves = _moves(binned_s, binned)
    lasts_s, way_m = np.diff(binned_s), np.abs(np.diff(binned))
    whole = (lasts_s <= longest_gap_s) & (way_m <= MOST_STEP_M)
    moving = whole & moves[1:] & moves[:-1] & (way_m > 0.0)
    return Motion(
        driven_s=float(step_s[step_s <= longest_gap_s].sum()),
        standing_s=float(lasts_s[whole & ~moving].sum()),
        travelled_m=float(way_m[moving].sum()),
        speed_mps=way_m[moving] / lasts_s[moving],
        jumps=int(jump.sum()),
        jitter_m=_jitter_m(at[kept]),
        decimals=(_decimals(lon), _decimals(lat)),
        paths=list(_paths(binned, whole, moving, frame)),
    )


def _bins(time_s: Floats, at: np.ndarray) -> tuple[Floats, np.ndarray]:
    """Mean time and place of each `BIN_S`."""
    number = np.floor((time_s - time_s[0]) / BIN_S)
    starts = np.flatnonzero(np.diff(number, prepend=-1.0) != 0)
    count = np.diff(np.append(starts, len(at)))
    return np.add.reduceat(time_s, starts) / count, np.add.reduceat(at, starts) / count


def _moves(time_s: Floats, at: np.ndarray) -> Bool[np.ndarray, " bins"]:
    before = np.maximum(np.arange(len(at)) - 1, 0)
    behind = np.minimum(np.arange(len(at)) + 1, len(at) - 1)
    lasts_s = np.maximum(time_s[behind] - time_s[before], 1e-6)
    return np.asarray(np.abs(at[behind] - at[before]) / lasts_s >= STANDS_MPS)


def _jitter_m(at: np.ndarray) -> float:
    """From how three fixes bend, across their way; corners are few and do not move a median."""
    chord, bend = at[2:] - at[:-2], np.diff(at, n=2)
    long = np.abs(chord) > 5.0
    if np.count_nonzero(long) < 8:
        return float("nan")
    across_m = np.abs((chord.conj() * bend).imag[long]) / np.abs(chord[long])
    return float(np.median(across_m)) / (CALM * float(np.sqrt(6.0)))


def _decimals(degrees: Floats) -> int:
    """The fewest decimals that nearly all of the values need."""
    for decimals in DECIMALS:
        scaled = degrees * 10.0**decimals
        if np.mean(np.abs(scaled - np.rint(scaled)) < EXACT) >= NEARLY_ALL:
            return decimals
    return DECIMALS.stop


def _paths(
    at: np.ndarray,
    whole: Bool[np.ndarray, " steps"],
    moving: Bool[np.ndarray, " steps"],
    frame: LocalFrame,
) -> Iterator[tuple[Floats, Floats]]:
    """
    The way between gaps in even steps; a stop is no gap.

    Args:
        whole: Steps without a gap. ``moving``: those of them on which the car went on.
    """
    cuts = np.flatnonzero(~whole) + 1
    for part in np.split(np.arange(len(at)), cuts):
        goes = moving[part[:-1]] if len(part) > 1 else np.zeros(0, bool)
        places = at[part[np.concatenate([[False], goes])]]
        if len(places) < 2:
            continue
        way_m = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(places)))])
        even_m = np.arange(0.0, way_m[-1] + 1e-9, STEP_M)
        place = frame.to_lonlat(
            np.interp(even_m, way_m, places.real), np.interp(even_m, way_m, places.imag)
        )
        yield np.asarray(place.lon), np.asarray(place.lat)
