"""
Following a route: where along it each sample of a drive was, whatever single positions say.

A long route meets or nears itself, and positions jump. Dropping each position on its nearest place
would let a drive jump with them; here the drive follows the route from end to end. It is a hidden
Markov model of the chainage as in map matching (Newson and Krumm 2009), on one known line: a
position speaks for the places near it, the odometer for how far the drive went on, and no drive
goes back. Between samples the odometer is exact to a metre, so that the median of what several
positions say, each moved along by the odometer, is better than any single one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from app.domain import Direction, Line, Trace
from app.numerics.geodesy import Floats, LocalFrame, distance_m
from app.numerics.lines import length_m, point_at, project

STATE_M = 5.0  # spacing of the chainages that compete
POSITION_SD_M = 10.0  # a latitude rounded to 11 m is wrong by up to 6, GPS adds its own
WORST_SD = 5.0  # a position farther off is a jump: it says nothing, however far
ODOMETER_SD_M, ODOMETER_SHARE = 2.0, 0.05  # of a step: a constant and a share of its length
FASTEST_MPS = 60.0  # where there is no odometer
SEEN_M = 40.0  # a position farther from the line is no witness of the place
WITNESSES = 15  # samples whose positions are taken together: some 150 m at 1 Hz in a town
FEWEST_WITNESSES = 5


class Followed(NamedTuple):
    """A drive on its line: direction of travel, and chainages; NaN where nothing bears witness."""

    direction: Direction
    chainage_m: Floats


def odometer_m(
    time_s: Float[np.ndarray, " samples"], speed_mps: Float[np.ndarray, " samples"]
) -> Float[np.ndarray, " samples"]:
    """Travelled distance: the integral of the speed, by trapezoids; a negative speed is none."""
    speed = np.maximum(speed_mps, 0.0)
    step_m = np.diff(time_s) * (speed[1:] + speed[:-1]) / 2.0
    return np.concatenate([[0.0], np.cumsum(step_m)])


def follow(line: Line, trace: Trace, travelled_m: Float[np.ndarray, " samples"] | None) -> Followed:
    """
    Lay a drive on a line.

    Args:
        travelled_m: The odometer; None where there is none, and only the time bounds a step.
    """
    dropped_m = project(line, trace.lon, trace.lat).chainage_m
    half = len(dropped_m) // 2
    if half and float(np.median(dropped_m[:half])) > float(np.median(dropped_m[half:])):
        turned = Line(line.lon[::-1], line.lat[::-1])
        ahead_m = _follow_ahead(turned, trace, travelled_m)
        return Followed(Direction.BACKWARD, length_m(line) - ahead_m)
    return Followed(Direction.FORWARD, _follow_ahead(line, trace, travelled_m))


def _follow_ahead(line: Line, trace: Trace, travelled_m: Floats | None) -> Floats:
    """Chainages of a drive that goes the way of the line: the best way through all samples."""
    states_m, moved_m, off_m = _states(line, trace)
    worst = WORST_SD**2
    cost = np.minimum((off_m[0] / POSITION_SD_M) ** 2, worst)
    came_from = np.zeros(off_m.shape, dtype=np.int32)
    steps_m = np.diff(travelled_m) if travelled_m is not None else None
    steps_s = np.diff(trace.time_s)
    for i in range(1, len(off_m)):
        if steps_m is None:
            push = np.zeros(int(FASTEST_MPS * steps_s[i - 1] / moved_m) + 1)
        else:
            push = _motion_cost(float(steps_m[i - 1]), moved_m)
        push = push[: len(states_m)]
        best = np.full(len(states_m), np.inf)
        for k, extra in enumerate(push):
            to = cost[: len(cost) - k] + extra
            better = to < best[k:]
            best[k:][better] = to[better]
            came_from[i, k:][better] = k
        cost = best + np.minimum((off_m[i] / POSITION_SD_M) ** 2, worst)
    state = int(cost.argmin())
    way = np.empty(len(off_m), dtype=np.intp)
    for i in range(len(off_m) - 1, -1, -1):
        way[i] = state
        state -= int(came_from[i, state])
    return _refined(line, trace, states_m[way], travelled_m)


def _motion_cost(step_m: float, moved_m: float) -> Floats:
    """Cost of going on by 0, 1, 2... states when the odometer says ``step_m``."""
    spread_m = ODOMETER_SD_M + moved_m / 2.0 + ODOMETER_SHARE * step_m
    reach = int((step_m + 4.0 * spread_m) / moved_m) + 1
    apart_m = np.arange(reach + 1) * moved_m - step_m
    return np.asarray((apart_m / spread_m) ** 2, dtype=float)


def _states(line: Line, trace: Trace) -> tuple[Floats, float, Floats]:
    """Competing chainages, their spacing, and how far each position lies from each of them."""
    whole_m = length_m(line)
    states_m = np.linspace(0.0, whole_m, max(2, round(whole_m / STATE_M) + 1))
    frame = LocalFrame(float(line.lon[0]), float(np.mean(line.lat)))
    place = point_at(line, states_m)
    on, seen = frame.to_xy(place.lon, place.lat), frame.to_xy(trace.lon, trace.lat)
    off_m = np.hypot(seen.x_m[:, None] - on.x_m, seen.y_m[:, None] - on.y_m)
    return states_m, float(states_m[1] - states_m[0]), off_m


def _refined(
    line: Line,
    trace: Trace,
    rough_m: Floats,
    travelled_m: Floats | None,
) -> Floats:
    """
    Chainages off the grid of states, never falling; NaN where too few positions bear witness.

    Each position is dropped on the line near its rough place. With an odometer the medians of
    chainage minus travelled distance over `WITNESSES` samples are added to it.
    """
    dropped_m = _dropped_near(line, trace, rough_m)
    if travelled_m is None:
        return _rising(dropped_m, ~np.isnan(dropped_m))
    ahead_m = dropped_m - travelled_m
    half = WITNESSES // 2
    padded = np.pad(ahead_m, half, constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, WITNESSES)
    enough = (~np.isnan(around)).sum(axis=1) >= FEWEST_WITNESSES
    median_m = np.full(len(ahead_m), np.nan)
    median_m[enough] = np.nanmedian(around[enough], axis=1)
    chainage_m = median_m + travelled_m
    return _rising(chainage_m, enough & (chainage_m >= 0.0) & (chainage_m <= length_m(line)))


def _rising(chainage_m: Floats, known: Bool[np.ndarray, " samples"]) -> Floats:
    out = np.full(len(chainage_m), np.nan)
    out[known] = np.maximum.accumulate(chainage_m[known])
    return out


def _dropped_near(line: Line, trace: Trace, rough_m: Floats) -> Floats:
    """Foot of each position on the line within `SEEN_M` of its rough place; NaN: none that near."""
    fine_m = np.arange(-SEEN_M, SEEN_M + 0.5, 1.0)
    chainage_m = np.clip(rough_m[:, None] + fine_m, 0.0, length_m(line))
    place = point_at(line, chainage_m.ravel())
    lon, lat = np.repeat(trace.lon, len(fine_m)), np.repeat(trace.lat, len(fine_m))
    off_m = distance_m(lon, lat, place.lon, place.lat).reshape(chainage_m.shape)
    best, row = off_m.argmin(axis=1), np.arange(len(rough_m))
    # At an end of the line the drive may stand beyond it: that is no place on it.
    inside = (chainage_m[row, best] > 0.0) & (chainage_m[row, best] < length_m(line))
    return np.where((off_m[row, best] <= SEEN_M) & inside, chainage_m[row, best], np.nan)
