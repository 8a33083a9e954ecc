"""Chainage along a road's centre line: where a point lies on it, and what lies at a chainage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from app.domain import Line
from app.numerics.geodesy import (
    Floats,
    LocalFrame,
    LonLat,
    distance_m,
    mean_longitude_deg,
    metres_per_degree,
    wrap_longitude_deg,
)


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """
    Points dropped on a line.

    Attributes:
        chainage_m: Distance from the line's start to the foot of the perpendicular.
        offset_m: Signed distance from the line, positive to the left of its direction.
    """

    chainage_m: Floats
    offset_m: Floats


def vertex_chainage_m(line: Line) -> Floats:
    """Chainage of every vertex; the first is 0, the last the line's length."""
    steps_m = distance_m(line.lon[:-1], line.lat[:-1], line.lon[1:], line.lat[1:])
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def length_m(line: Line) -> float:
    """Length of the line in metres."""
    return float(vertex_chainage_m(line)[-1])


def point_at(line: Line, chainage_m: ArrayLike) -> LonLat:
    """Degrees at chainages; beyond an end, that end."""
    at_m, wanted_m = vertex_chainage_m(line), np.asarray(chainage_m, dtype=float)
    lon = line.lon[0] + np.interp(wanted_m, at_m, _unwrapped_lon(line) - line.lon[0])
    lon = np.where((lon < -180.0) | (lon >= 180.0), wrap_longitude_deg(lon), lon)
    return LonLat(lon, np.interp(wanted_m, at_m, line.lat))


def heading_deg(line: Line, chainage_m: float) -> float:
    """Compass heading of growing chainage, degrees clockwise from north, in [0, 360)."""
    return float(headings_deg(line, np.array([chainage_m]))[0])


def headings_deg(line: Line, chainage_m: ArrayLike) -> Floats:
    """`heading_deg` at many chainages; a vertex has the heading of the piece after it."""
    scale = metres_per_degree((line.lat[:-1] + line.lat[1:]) / 2.0)
    east_m = wrap_longitude_deg(np.diff(line.lon)) * scale.x_m
    pieces = np.degrees(np.arctan2(east_m, np.diff(line.lat) * scale.y_m)) % 360.0
    wanted_m = np.asarray(chainage_m, dtype=float)
    piece = np.searchsorted(vertex_chainage_m(line), wanted_m, side="right") - 1
    return np.asarray(pieces[np.clip(piece, 0, len(pieces) - 1)])


def slice_line(line: Line, start_m: float, end_m: float) -> Line:
    """The part of the line between two chainages, with its inner vertices."""
    at_m = vertex_chainage_m(line)
    inner = at_m[(at_m > start_m) & (at_m < end_m)]
    part = point_at(line, np.concatenate([[start_m], inner, [end_m]]))
    return Line(part.lon, part.lat)


def project(line: Line, lon: ArrayLike, lat: ArrayLike) -> Projection:
    """
    Drop points on the line: the nearest place of all its pieces, the first one among equals.

    Args:
        lon, lat: Degrees, shape ``(points,)``.
    """
    frame = LocalFrame(float(line.lon[0]), float(np.mean(line.lat)))
    vertex, point = frame.to_xy(line.lon, line.lat), frame.to_xy(lon, lat)
    dx, dy = np.diff(vertex.x_m), np.diff(vertex.y_m)
    squared = np.maximum(dx**2 + dy**2, 1e-12)  # a repeated vertex is a point, not a division by 0
    from_x, from_y = point.x_m[:, None] - vertex.x_m[:-1], point.y_m[:, None] - vertex.y_m[:-1]
    share = np.clip((from_x * dx + from_y * dy) / squared, 0.0, 1.0)
    away = np.hypot(from_x - share * dx, from_y - share * dy)
    piece = np.argmin(away, axis=1)
    row = np.arange(len(piece))
    turn = dx[piece] * from_y[row, piece] - dy[piece] * from_x[row, piece]
    side = np.where(turn < 0, -1.0, 1.0)  # never 0: a point straight beyond an end is off the line
    at_m = vertex_chainage_m(line)
    chainage_m = at_m[piece] + share[row, piece] * np.diff(at_m)[piece]
    return Projection(chainage_m, side * away[row, piece])


def parts_in_range(line: Line) -> list[Line]:
    """
    The line cut where it crosses the antimeridian, as GeoJSON wants it (RFC 7946, 3.1.9).

    Parts meet there: one ends on the meridian of 180 or -180 degrees, the next begins on the other.
    """
    lon = _unwrapped_lon(line)
    turn = np.floor((lon + 180.0) / 360.0)
    cuts = np.flatnonzero(np.diff(turn))
    if not len(cuts):
        return [line]
    parts, begin = [], 0
    head = np.zeros((0, 2))
    for cut in [*cuts.tolist(), None]:
        end = len(lon) if cut is None else cut + 1
        inner = np.stack([lon[begin:end] - 360.0 * turn[begin], line.lat[begin:end]], axis=1)
        rows = [head, inner]
        if cut is not None:
            side = 180.0 if turn[end] > turn[begin] else -180.0
            seam = 360.0 * max(turn[begin], turn[end]) - 180.0
            share = (seam - lon[cut]) / (lon[end] - lon[cut])
            lat = line.lat[cut] + share * (line.lat[end] - line.lat[cut])
            rows.append(np.array([[side, lat]]))
            head = np.array([[-side, lat]])
        drawn = np.concatenate(rows)
        fresh = np.append(True, np.any(np.diff(drawn, axis=0) != 0.0, axis=1))
        if np.count_nonzero(fresh) > 1:  # a vertex on the antimeridian itself is no part
            parts.append(Line(*np.ascontiguousarray(drawn[fresh].T)))
        begin = end
    return parts


def _unwrapped_lon(line: Line) -> Floats:
    return np.degrees(np.unwrap(np.radians(line.lon)))


def z_order(line: Line) -> int:
    """Interleaved bits of the line's middle, so that near roads get near numbers."""
    x = int((mean_longitude_deg(line.lon) + 180.0) / 360.0 * (1 << 24))
    y = int((float(np.mean(line.lat)) + 90.0) / 180.0 * (1 << 24))
    return sum(((x >> bit & 1) << 2 * bit) | ((y >> bit & 1) << 2 * bit + 1) for bit in range(24))
