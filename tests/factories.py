"""Valid domain values for tests: small roads, drives along them, and models made without a fit."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from app.domain import Curve, Line, RoadModel, Salience, Segment, Trace
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import length_m, point_at

CELLS = ("850:293", "850:60", "5110:17")
FRAME = LocalFrame(-118.49, 34.01)


def line_at(y_m: float = 0.0, *, length_m: float = 200.0, x_m: float = 0.0) -> Line:
    """A straight road to the east of the frame's origin."""
    ends = FRAME.to_lonlat([x_m, x_m + length_m], [y_m, y_m])
    return Line(np.asarray(ends.lon), np.asarray(ends.lat))


def trace_along(
    line: Line,
    *,
    seed: int,
    road_id: str | None = None,
    cells: tuple[str, ...] = CELLS,
    step_m: float = 2.0,
    noise_m: float = 0.0,
    device: str | None = "pixel4a",
) -> Trace:
    """A pass along a line at 8 m/s, every ``step_m``, with levels that rise and fall along it."""
    rng = np.random.default_rng(seed)
    chainage_m = np.arange(0.0, length_m_of(line), step_m)
    along = point_at(line, chainage_m)
    x, y = FRAME.to_xy(along.lon, along.lat).x_m, FRAME.to_xy(along.lon, along.lat).y_m
    if noise_m:
        x, y = x + rng.normal(0, noise_m, x.shape), y + rng.normal(0, noise_m, y.shape)
    moved = FRAME.to_lonlat(x, y)
    phase = np.arange(len(cells))
    level_dbm = -90.0 + 12.0 * np.sin(chainage_m[:, None] / 60.0 + phase) - 3.0 * phase
    rsrp_dbm = np.round(level_dbm + rng.normal(0, 2.0, level_dbm.shape)).astype(np.float32)
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.05] = np.nan
    return Trace(
        cells=cells,
        time_s=chainage_m / 8.0,
        lon=np.asarray(moved.lon),
        lat=np.asarray(moved.lat),
        rsrp_dbm=rsrp_dbm,
        road_id=road_id,
        device=device,
        recorded_at=datetime(2021, 5, 8, 10, 12, tzinfo=UTC),
    )


def length_m_of(line: Line) -> float:
    return length_m(line)


def salience(rng: np.random.Generator, cell_count: int) -> Salience:
    mask = rng.random((5, cell_count)) < 0.5
    return Salience(mask, float(rng.random()), float(rng.random() + 1.0), "exhaustive")


def model_of(
    road_id: str,
    *,
    seed: int,
    line: Line | None = None,
    cells: tuple[str, ...] = CELLS,
    segment_count: int = 3,
    step_m: float = 2.0,
    days: tuple[str, ...] | None = None,
) -> RoadModel:
    """A road model of the right shapes with seeded numbers, as if it had been fitted."""
    rng = np.random.default_rng(seed)
    line = line or line_at()
    total_m = length_m(line)
    grid = int(total_m // step_m) + 1
    mean_dbm = rng.uniform(-120, -60, (grid, len(cells))).astype(np.float32)
    mean_dbm[: grid // 4, :1] = np.nan
    edges_m = np.linspace(0.0, total_m, segment_count + 1)
    return RoadModel(
        road_id=road_id,
        line=line,
        length_m=total_m,
        cells=cells,
        step_m=step_m,
        mean_dbm=mean_dbm,
        spread_db=rng.uniform(1, 6, mean_dbm.shape).astype(np.float32),
        heard=rng.uniform(0, 1, mean_dbm.shape).astype(np.float32),
        features=rng.normal(size=(5, len(cells))),
        salience=salience(rng, len(cells)),
        segments=tuple(
            _segment(rng, index, edges_m, line, cells) for index in range(segment_count)
        ),
        pass_count=2,
        sample_count=grid * 2,
        evidence=rng.normal(size=(7, 4)).astype(np.float32),
        unseen=rng.uniform(0.0, 1.0, (2, 3, grid // 3, len(cells))).astype(np.float16),
        heard_on={} if days is None else {day: rng.random(len(cells)) < 0.5 for day in days},
    )


def _segment(
    rng: np.random.Generator, index: int, edges_m: np.ndarray, line: Line, cells
) -> Segment:
    start_m, end_m = edges_m[index], edges_m[index + 1]
    middle = point_at(line, (start_m + end_m) / 2)
    curves = tuple(
        Curve(
            cell=cell,
            knots_m=np.linspace(start_m, end_m, 8),
            coefficients_dbm=rng.uniform(-120, -60, 4),
            degree=3,
            residual_db=float(rng.uniform(1, 4)),
            pass_count=2,
        )
        for cell in cells
    )
    return Segment(
        index=index,
        start_m=float(start_m),
        end_m=float(end_m),
        mid_lon=float(middle.lon),
        mid_lat=float(middle.lat),
        features=rng.normal(size=(5, len(cells))),
        salience=salience(rng, len(cells)),
        curves=curves,
    )
