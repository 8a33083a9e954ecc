"""
From drives to roads and passes: what a build does first with drives that name no road.

Roads that were given (drawn, or imported) stay as they are and drives are laid on them first; what
is left of the drives makes roads appear. Only the neighbourhood of new drives is looked at: beyond
it the roads that were found before stay, and grow on where new ones join them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from app.domain import Line
from app.numerics.geodesy import Floats, LocalFrame
from app.numerics.lines import length_m, point_at
from app.numerics.network.appearance import roads_of
from app.numerics.network.cleaning import clean
from app.numerics.network.following import Network
from app.numerics.network.identity import name_lines
from app.numerics.network.nouns import Driven, Findings, KnownRoad, RoadStretch
from app.numerics.network.region import Region, cut_piece
from app.numerics.network.runs import stretches
from app.numerics.network.steps import STEP_M, Piece
from app.numerics.network.stretches import passes_of, stretches_along


def find_roads(
    drives: Sequence[Driven], known: Sequence[KnownRoad], new_ids: Iterator[str]
) -> Findings:
    """
    Find the roads of new drives, and the passes of all drives given.

    Args:
        drives: The new drives and all others that name no road and come near one of them.
        known: Every road near one of the drives.
        new_ids: Names for roads that appear.
    """
    frame = _frame_of([one for one in drives if one.new] or drives)
    pieces = [
        piece
        for number, one in enumerate(drives)
        for piece in clean(number, _xy(frame, one.lon, one.lat), one.time_s)
    ]
    given = _lines_of(frame, [road for road in known if road.given])
    found = _lines_of(frame, [road for road in known if not road.given])
    region = Region.about(piece for piece in pieces if drives[piece.drive].new)
    loose = _left_over(Network(list(given.values())), region.widened().parts_inside(pieces))
    sure = {road.road_id for road in known if road.sure}
    seeds = [
        part
        for road_id, line in found.items()
        if road_id in sure
        for part in region.parts_outside(line)
    ]
    before = [line for road_id, line in found.items() if road_id in sure]
    named = name_lines(roads_of(loose, seeds, list(given.values()), before), found)
    raw = {road.road_id for road in known if road.raw}
    lines: dict[str, Floats] = {}
    changed: dict[str, Line] = {}
    for one in named:
        road_id = one.name if one.name is not None else next(new_ids)
        lines[road_id] = one.line
        if not one.same or one.name in raw:
            changed[road_id] = _line(frame, one.line)
    passes = _passes(drives, pieces, given | lines)
    driven = {each.road_id for along in passes.values() for each in along}
    kept = {road_id: line for road_id, line in changed.items() if road_id in driven}
    gone = {road_id for road_id in found if road_id not in lines}
    gone |= {road_id for road_id in changed if road_id in found and road_id not in driven}
    return Findings(kept, frozenset(gone), passes)


def _passes(
    drives: Sequence[Driven], pieces: Sequence[Piece], lines: Mapping[str, Floats]
) -> dict[str, tuple[RoadStretch, ...]]:
    network, ids = Network(list(lines.values())), list(lines)
    along: dict[str, list[RoadStretch]] = {one.drive_id: [] for one in drives}
    for piece in pieces:
        for each in passes_of(piece, network.follow(piece.xy_m)):
            stretch = RoadStretch(ids[each.road], each.first, each.end)
            along[drives[piece.drive].drive_id].append(stretch)
    return {drive_id: tuple(each) for drive_id, each in along.items()}


def _left_over(network: Network, pieces: Sequence[Piece]) -> list[Piece]:
    """What of the pieces lies on no road of the network."""
    if not network.lines:
        return list(pieces)
    left = []
    for piece in pieces:
        off = np.ones(len(piece.xy_m), dtype=bool)
        for _, first, end in stretches_along(network.follow(piece.xy_m)):
            off[first:end] = False
        left += [cut_piece(piece, part) for part in stretches(off)]
    return [piece for piece in left if len(piece.xy_m) > 1]


def _frame_of(drives: Sequence[Driven]) -> LocalFrame:
    """A frame in the middle of the drives; longitudes are averaged around the first one."""
    lon0 = float(drives[0].lon[0])
    around = LocalFrame(lon0, 0.0)
    x_m = np.concatenate([around.to_xy(one.lon, one.lat).x_m for one in drives])
    middle = around.to_lonlat(float(np.median(x_m)), 0.0)
    lat = np.concatenate([one.lat for one in drives])
    return LocalFrame(float(middle.lon), float(np.median(lat)))


def _xy(frame: LocalFrame, lon: Floats, lat: Floats) -> Floats:
    at = frame.to_xy(lon, lat)
    return np.stack([at.x_m, at.y_m], axis=1)


def _lines_of(frame: LocalFrame, known: Sequence[KnownRoad]) -> dict[str, Floats]:
    """Lines in even steps; of a road that is but a drive's positions, the cleaned drive."""
    lines = {}
    for road in known:
        if not road.raw:
            lines[road.road_id] = _even(frame, road.line)
            continue
        once_a_second = np.arange(len(road.line.lon), dtype=float)
        pieces = clean(0, _xy(frame, road.line.lon, road.line.lat), once_a_second)
        if pieces:
            lines[road.road_id] = max(pieces, key=lambda piece: len(piece.xy_m)).xy_m
    return lines


def _even(frame: LocalFrame, line: Line) -> Floats:
    """A line in the steps of a piece."""
    steps = max(1, round(length_m(line) / STEP_M))
    at = point_at(line, np.linspace(0.0, length_m(line), steps + 1))
    return _xy(frame, at.lon, at.lat)


def _line(frame: LocalFrame, xy_m: Floats) -> Line:
    at = frame.to_lonlat(xy_m[:, 0], xy_m[:, 1])
    return Line(np.asarray(at.lon), np.asarray(at.lat))
