"""A road's centre line from the passes that drove it, for roads that nobody has drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString

from app.domain import Line, Trace
from app.errors import RoadTooShort
from app.numerics.geodesy import Floats, LocalFrame

THINNED_TO_M = 8.0  # closer fixes say more of GPS jitter than of the road
STATION_M = 10.0
SMOOTHED_OVER = 3.0  # times the fixes' jitter: less leaves zigzag, which makes a road too long
WIDTH_M = (4.0, 25.0)  # of the smoothing: half the stations' distance, and what no corner survives
REACH_M = 40.0  # a fix farther off than a wide street belongs to another road
SIMPLIFIED_TO_M = 0.5
MIN_LENGTH_M = 20.0
MEDIAN_OF_NORMAL = 0.6745  # of |N(0, 1)|: a few corners must not count as jitter


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Local metres of a pass, in driving order. Shape ``(fixes, 2)``."""

    xy_m: Floats

    @property
    def length_m(self) -> float:
        """Length of the track."""
        return float(np.hypot(*np.diff(self.xy_m, axis=0).T).sum())

    @property
    def jitter_m(self) -> float:
        """Standard deviation of a fix across the road, from how three neighbours bend."""
        if len(self.xy_m) < 3:
            return 0.0
        chord, bend = self.xy_m[2:] - self.xy_m[:-2], np.diff(self.xy_m, n=2, axis=0)
        across_m = chord[:, 0] * bend[:, 1] - chord[:, 1] * bend[:, 0]
        across_m /= np.maximum(np.hypot(*chord.T), 1e-9)
        return float(np.median(np.abs(across_m))) / (MEDIAN_OF_NORMAL * np.sqrt(6.0))


def derive_line(passes: Sequence[Trace]) -> Line:
    """
    Centre line of the union of the passes, in the direction of the longest one.

    The longest pass gives the first shape, the others carry its ends on where they reach farther,
    and every station then moves to where the fixes about it lie on average.

    Raises:
        RoadTooShort: The passes do not move.
    """
    frame = LocalFrame(float(passes[0].lon[0]), float(passes[0].lat[0]))
    tracks = sorted((_thinned(trace, frame) for trace in passes), key=lambda t: -t.length_m)
    if tracks[0].length_m < MIN_LENGTH_M:
        raise RoadTooShort(needed_m=MIN_LENGTH_M, got_m=tracks[0].length_m)
    shape = tracks[0].xy_m
    for track in tracks[1:]:
        shape = _carried_on(shape, track.xy_m)
    jitter_m = float(np.median([track.jitter_m for track in tracks]))
    width_m = float(np.clip(SMOOTHED_OVER * jitter_m, *WIDTH_M))
    centred = _centred(shape, np.concatenate([track.xy_m for track in tracks]), width_m)
    simple = np.array(LineString(centred).simplify(SIMPLIFIED_TO_M).coords)
    ends = frame.to_lonlat(simple[:, 0], simple[:, 1])
    return Line(ends.lon, ends.lat)


def _thinned(trace: Trace, frame: LocalFrame) -> Track:
    fixes = frame.to_xy(trace.lon, trace.lat)
    points = np.column_stack([fixes.x_m, fixes.y_m])
    kept = [0]
    for index in range(1, len(points)):
        if np.hypot(*(points[index] - points[kept[-1]])) >= THINNED_TO_M:
            kept.append(index)
    if kept[-1] != len(points) - 1 and len(kept) > 1:
        kept[-1] = len(points) - 1
    return Track(points[kept])


def _carried_on(shape: Floats, track: Floats) -> Floats:
    """Append what the track has beyond either end of the shape."""
    if len(track) < 2:
        return shape
    line = LineString(shape)
    fixes = shapely.points(track)
    along = np.asarray(shapely.line_locate_point(line, fixes))
    off = np.asarray(shapely.distance(line, fixes))
    if along[-1] < along[0]:
        track, along, off = track[::-1], along[::-1], off[::-1]
    before = _outside(along <= 0.0, off)
    after = _outside((along >= line.length)[::-1], off[::-1])
    return np.concatenate([track[:before], shape, track[len(track) - after :]])


def _outside(beyond: np.ndarray, off_m: Floats) -> int:
    """How many leading fixes lie beyond the end and clear of it; 0 if they never come to it."""
    if beyond.all() or not beyond[0]:
        return 0
    count = int(np.argmin(beyond))
    clear = off_m[:count] > THINNED_TO_M
    return int(clear.sum()) if off_m[count] <= REACH_M else 0


def _centred(shape: Floats, fixes: Floats, width_m: float) -> Floats:
    """
    Stations along the shape, each where a straight line fitted to the fixes about it passes.

    Local linear regression (Fan and Gijbels 1996) of the fixes' places on their way along the
    shape; it follows the road to its ends, which a plain average would pull in.
    """
    line = LineString(shape)
    count = max(2, round(line.length / STATION_M) + 1)
    at_m = np.linspace(0.0, line.length, count)
    points = np.asarray(shapely.points(fixes))
    close = np.asarray(shapely.distance(line, points)) < REACH_M
    away_m = np.asarray(shapely.line_locate_point(line, points[close])) - at_m[:, None]
    kernel = np.exp(-0.5 * (away_m / width_m) ** 2)
    total, lever = kernel.sum(axis=1), (kernel * away_m).sum(axis=1)
    spread = (kernel * away_m**2).sum(axis=1)
    determinant = total * spread - lever**2
    weight = kernel * (spread[:, None] - lever[:, None] * away_m)
    weight /= np.maximum(determinant, 1e-12)[:, None]
    enough = (total > 0.5) & (determinant > 1e-6 * (total * width_m) ** 2)
    stations = shapely.get_coordinates(shapely.line_interpolate_point(line, at_m))
    return np.where(enough[:, None], weight @ fixes[close], stations)
