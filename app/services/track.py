"""One window of a tracked vehicle: its state opened, its way since worked out, the next state."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.domain import Fix, Window
from app.errors import Fault, InvalidInput
from app.numerics import tracking
from app.numerics.belief import Belief, Mode
from app.numerics.index import MapIndex
from app.numerics.lines import headings_deg, point_at, project
from app.numerics.tracking import Tracked
from app.services.states import ClockKind, KeptMode, KeptTrack, Mark, seal, unseal

MOVED_ROAD_M = 50.0  # a road that a new map draws farther away than this is another road
PRINT_BYTES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """
    How a request told the way of its window.

    Attributes:
        kind: By an odometer or by a clock.
        values: Metres or seconds, as told, one a sample.
        speed_mps: At the first sample, when told by a clock; for the way before it.
        travelled_m: From the last sample of the window before to this one's; None = not told.
    """

    kind: ClockKind
    values: NDArray[np.float64]
    speed_mps: float = 0.0
    travelled_m: float | None = None


@dataclass(frozen=True, slots=True)
class TrackedFix:
    """A fix, and the state that the next window of the vehicle brings along."""

    fix: Fix
    state: str


def locate_tracked(
    index: MapIndex, window: Window, way: Way, state: str | None, key: bytes, confidence: float
) -> TrackedFix:
    """
    Locate a window in the light of those before it.

    Args:
        state: Of the answer to the window before; None or empty begins a track.

    Raises:
        InvalidInput: At ``/state``: it is none of ours, or speaks of roads that are gone.
    """
    mark = _mark(window, way)
    if not state:
        tracked = tracking.begin(index, window, confidence=confidence)
    else:
        kept = unseal(state, key)
        tracked = tracking.follow(
            index,
            window,
            _belief(index, kept),
            travelled_m(kept.mark, mark, window, way),
            heard=kept.heard,
            confidence=confidence,
        )
    return TrackedFix(tracked.fix, seal(_kept(index, tracked, mark), key))


def travelled_m(before: Mark, mark: Mark, window: Window, way: Way) -> float:
    """
    Metres from the last sample of one window to the last of the next.

    As told; else by the odometer (or clock), when it runs on from window to window; else the
    windows follow one another back to back, each counted from its own start.
    """
    if way.travelled_m is not None:
        return way.travelled_m
    length_m = float(window.distance_m[-1])
    if not _runs_on(before, mark):
        if mark.first_print and mark.first_print == before.last_print:
            return length_m  # it begins with the very sample that the one before ended with
        return length_m + length_m / max(len(window.distance_m) - 1, 1)
    if mark.kind == "m":
        return max(mark.last - before.last, 0.0)
    if before.last >= mark.last:
        return 0.0
    passed_m = float(np.interp(before.last, way.values, window.distance_m))
    return length_m - passed_m + max(mark.first - before.last, 0.0) * way.speed_mps


def _runs_on(before: Mark, mark: Mark) -> bool:
    """Whether both windows count from one origin."""
    if mark.kind != before.kind:
        return False
    same = mark.first_print != 0 and mark.first_print == before.first_print
    return mark.first > before.first or (mark.first == before.first and same)


def _mark(window: Window, way: Way) -> Mark:
    first, last = float(way.values[0]), float(way.values[-1])
    return Mark(way.kind, first, last, _print(window, 0), _print(window, -1))


def _print(window: Window, sample: int) -> int:
    """Of what a sample heard, in any order of the cells; 0 when it heard nothing."""
    row = window.rsrp_dbm[sample]
    heard = sorted((window.cells[i], float(row[i])) for i in np.flatnonzero(~np.isnan(row)))
    if not heard:
        return 0
    digest = hashlib.blake2b(repr(heard).encode(), digest_size=PRINT_BYTES).digest()
    return int.from_bytes(digest, "little")


def _kept(index: MapIndex, tracked: Tracked, mark: Mark) -> KeptTrack:
    belief = tracked.belief
    modes = tuple(_kept_mode(index, mode) for mode in belief.modes)
    return KeptTrack(index.version, belief.anywhere, belief.off_map, mark, modes, tracked.heard)


def _kept_mode(index: MapIndex, mode: Mode) -> KeptMode:
    line = index.lines[mode.road]
    place = point_at(line, mode.chainage_m)
    return KeptMode(
        index.road_ids[mode.road],
        mode.sign,
        mode.chainage_m,
        mode.sd_m,
        mode.weight,
        float(place.lon),
        float(place.lat),
        float(headings_deg(line, np.array([mode.chainage_m]))[0]),
    )


def _belief(index: MapIndex, kept: KeptTrack) -> Belief:
    """
    The belief on this map, whichever version the state was made on.

    Raises:
        InvalidInput: None of the roads that it speaks of is on the map.
    """
    number = {road_id: i for i, road_id in enumerate(index.road_ids)}
    found = [
        mode
        for one in kept.modes
        if one.road_id in number
        and (mode := _mode(index, kept.map_version, number[one.road_id], one)) is not None
    ]
    if kept.modes and not found:
        names = ", ".join(dict.fromkeys(repr(one.road_id) for one in kept.modes[:3]))
        raise InvalidInput(
            [
                Fault(
                    "/state",
                    f"map version {index.version} has none of the roads that the state speaks of "
                    f"({names}, of map version {kept.map_version}); begin a new track with null",
                )
            ]
        )
    lost = sum(one.weight for one in kept.modes) - sum(mode.weight for mode in found)
    return Belief(tuple(found), kept.anywhere + max(lost, 0.0), kept.off_map)


def _mode(index: MapIndex, version: int, road: int, one: KeptMode) -> Mode | None:
    """The mode on a road of this map; None when the road is drawn somewhere else now."""
    length_m, line = index.roads[road].length_m, index.lines[road]
    sign, chainage_m = one.sign, one.chainage_m
    if version != index.version:
        foot = project(line, np.array([one.lon]), np.array([one.lat]))
        if abs(float(foot.offset_m[0])) > MOVED_ROAD_M:
            return None
        chainage_m = float(foot.chainage_m[0])
        turned = abs(float(headings_deg(line, foot.chainage_m)[0]) - one.heading_deg) % 360.0
        sign = -sign if 90.0 < turned < 270.0 else sign
    return Mode(road, sign, min(max(chainage_m, 0.0), length_m), one.sd_m, one.weight)
