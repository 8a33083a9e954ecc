"""Where to drive next: what is known of the surveys along every sub-segment of a map version."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from sqlalchemy.engine import Connection, Engine

from app.domain import Calibration, Line
from app.errors import Fault, InvalidInput, NotFound
from app.numerics.advice import Advice, CoverageSummary, Ground, advise, summarise
from app.numerics.expectation import expected_error_m, expected_sd_m, road_right
from app.numerics.lines import length_m, slice_line
from app.services.paging import after, bounded, sealed
from app.store import coverage, versions
from app.store.bounds import bounds_of, touches
from app.store.coverage import CoveredSegment, SegmentCounts, UnmappedRoad
from app.store.engine import read
from app.store.records import Bounds, Page

__all__ = ["Advice", "Coverage", "CoverageSummary", "Stretch", "survey_coverage"]

VERSIONS_KEPT = 2  # the active one, and the one somebody compares it with


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """
    A sub-segment of a mapped road, or the whole of a road that the version does not map.

    ``segment_index`` is None of the latter. ``passes`` is None where coverage was not kept when the
    road was built; ``counts`` is None there and where nobody drove.
    """

    road_id: str
    name: str | None
    segment_index: int | None
    start_m: float
    end_m: float
    line: Line | None
    passes: int | None
    counts: SegmentCounts | None = None
    road_right: float | None = None
    expected_error_m: float | None = None
    model_id: int | None = None

    @property
    def key(self) -> str:
        """Its place in the order of all stretches, and so what a cursor holds."""
        index = -1 if self.segment_index is None else self.segment_index
        return f"{self.road_id} {index}"


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """A page of stretches; what all of them come to; and which are most worth a drive."""

    version: int | None
    page: Page[Stretch]
    summary: CoverageSummary
    most_worth: tuple[tuple[Advice, Line | None], ...]


def survey_coverage(
    engine: Engine,
    *,
    version: int | None = None,
    bbox: Bounds | None = None,
    limit: int = 1000,
    cursor: str | None = None,
) -> Coverage:
    """
    Every stretch of the roads in a box, as a map version has them (the active one when None).

    Summary and advice are of the whole box, not of the page.

    Raises:
        NotFound: There is no such version.
        InvalidInput: ``limit`` or ``cursor`` is wrong.
    """
    first = _place(after(cursor))
    most = bounded(limit)
    with read(engine) as connection:
        if version is None:
            version = versions.active_version(connection)
        elif versions.select_calibration(connection, version) is None:
            raise NotFound("map version", version)
        mapped = list(_mapped(engine, version)) if version is not None else []
        unmapped = coverage.unmapped_roads(connection, version, bbox)
        if bbox is not None:
            mapped = _within(connection, version, mapped, bbox)
        stretches = sorted([*mapped, *map(_whole, unmapped)], key=_order)
        begin = sum(_order(one) <= first for one in stretches) if first else 0
        items = _drawn(connection, stretches[begin : begin + most])
        ground = _ground(stretches)
        advice = advise(ground)
        lines = [_line_of(_drawn(connection, stretches[one.first : one.end])) for one in advice]
    more = begin + most < len(stretches)
    page = sealed(Page(tuple(items), items[-1].key if more else None))
    return Coverage(version, page, summarise(ground), tuple(zip(advice, lines, strict=True)))


@lru_cache(maxsize=VERSIONS_KEPT)
def _mapped(engine: Engine, version: int) -> tuple[Stretch, ...]:
    """The segments of a version, without their lines; a version never changes."""
    with read(engine) as connection:
        segments = coverage.select_covered(connection, version)
        calibration = versions.select_calibration(connection, version)
    return _expected(segments, calibration or Calibration())


def _expected(segments: Sequence[CoveredSegment], calibration: Calibration) -> tuple[Stretch, ...]:
    known = [one.counts for one in segments]
    passes = np.array([0 if each is None else each.passes for each in known], dtype=int)
    information = np.array(
        [
            (np.nan,) * 3 if each is None
            else (each.place_information, each.mixed_information, each.offset_information)
            for each in known
        ]
    ).reshape(-1, 3)  # fmt: skip
    right = road_right(passes)
    error_m = expected_error_m(expected_sd_m(information, passes, calibration), right)
    return tuple(
        Stretch(
            road_id=one.road_id,
            name=one.name,
            segment_index=one.segment_index,
            start_m=one.start_m,
            end_m=one.end_m,
            line=None,
            passes=None if one.counts is None else one.counts.passes,
            counts=one.counts,
            road_right=None if one.counts is None else share,
            expected_error_m=None if np.isnan(metres) else metres,
            model_id=one.model_id,
        )
        for one, share, metres in zip(segments, right.tolist(), error_m.tolist(), strict=True)
    )


def _whole(road: UnmappedRoad) -> Stretch:
    end_m = 0.0 if road.line is None else length_m(road.line)
    return Stretch(road.road_id, road.name, None, 0.0, end_m, road.line, passes=0, road_right=0.0)


def _within(
    connection: Connection, version: int | None, stretches: Sequence[Stretch], box: Bounds
) -> list[Stretch]:
    near = coverage.roads_in(connection, version, box)
    drawn = _drawn(connection, [one for one in stretches if one.road_id in near])
    return [
        one
        for one in drawn
        if one.line is not None and touches(bounds_of(one.line.lon, one.line.lat), box)
    ]


def _drawn(connection: Connection, stretches: Sequence[Stretch]) -> list[Stretch]:
    """The same with their lines."""
    wanted = {one.model_id for one in stretches if one.line is None and one.model_id is not None}
    lines = coverage.model_lines(connection, sorted(wanted))
    return [
        replace(one, line=slice_line(lines[one.model_id], one.start_m, one.end_m))
        if one.line is None and one.model_id is not None
        else one
        for one in stretches
    ]


def _line_of(stretches: Sequence[Stretch]) -> Line | None:
    """Neighbours' lines as one."""
    lines = [one.line for one in stretches if one.line is not None]
    if not lines:
        return None
    lon = [lines[0].lon, *(line.lon[1:] for line in lines[1:])]
    return Line(
        np.concatenate(lon), np.concatenate([lines[0].lat, *(line.lat[1:] for line in lines[1:])])
    )


def _ground(stretches: Sequence[Stretch]) -> Ground:
    driven = [one.counts for one in stretches]
    return Ground(
        road_id=[one.road_id for one in stretches],
        start_m=np.array([one.start_m for one in stretches], dtype=float),
        end_m=np.array([one.end_m for one in stretches], dtype=float),
        passes=np.array([-1 if s.passes is None else s.passes for s in stretches], dtype=int),
        forward=np.array([0 if each is None else each.forward for each in driven], dtype=int),
        days=np.array([0 if each is None else each.days for each in driven], dtype=int),
        expected_error_m=np.array(
            [np.nan if s.expected_error_m is None else s.expected_error_m for s in stretches],
            dtype=float,
        ),
    )


def _order(one: Stretch) -> tuple[str, int]:
    return one.road_id, -1 if one.segment_index is None else one.segment_index


def _place(key: str | None) -> tuple[str, int] | None:
    """
    The place in the order that a cursor holds.

    Raises:
        InvalidInput: It is a cursor of another list.
    """
    if key is None:
        return None
    road_id, _, index = key.rpartition(" ")
    if not road_id or not index.removeprefix("-").isdecimal() or len(index) > 10:
        raise InvalidInput([Fault("/cursor", "the cursor is of another list")])
    return road_id, int(index)
