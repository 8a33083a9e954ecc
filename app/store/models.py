"""
Road models: written once, read in two ways.

`load_models` reads blobs only, for a serving process; `select_segments` reads the rows, fits
included, for people.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from app.domain import FEATURE_KINDS, Curve, Line, RoadModel, Salience, Segment
from app.store.bounds import bounds_of
from app.store.columns import B1, F2, F4, F8, pack, unpack, utc_now
from app.store.days import HeardOn, day_rows, select_days
from app.store.tables import builds, fits, map_roads, model_cells, model_days, road_models, segments

KINDS = len(FEATURE_KINDS)
HELD_OUT = ("evidence", "unseen")  # what a serving process leaves in the store
MOST_BOUND = 500  # values in one IN list: well below every database's limit


def insert_model(connection: Connection, build_id: str, model: RoadModel) -> int:
    """Store a model with its segments, fits and cells; its number."""
    model_id: int = connection.execute(
        road_models.insert().returning(road_models.c.model_id),
        {"build_id": build_id, "created_at": utc_now(), **_model_values(model)},
    ).scalar_one()
    _insert_all(connection, segments, [_segment_row(model_id, part) for part in model.segments])
    rows = [
        {"model_id": model_id, "segment_index": part.index, "position": position, **_fit(curve)}
        for part in model.segments
        for position, curve in enumerate(part.curves)
    ]
    _insert_all(connection, fits, rows)
    _insert_all(connection, model_cells, _cell_rows(model_id, model))
    _insert_all(connection, model_days, day_rows(model_id, model))
    return model_id


def load_models(connection: Connection, version: int) -> list[RoadModel]:
    """
    The models of a map version as matching needs them, by road id.

    Only blobs are read: the segments carry no curves (their samples are ``mean_dbm``), and
    ``evidence`` and ``unseen`` are empty.
    """
    columns = [column for column in road_models.c if column.name not in HELD_OUT]
    days = select_days(
        connection, sa.select(map_roads.c.model_id).where(map_roads.c.version == version)
    )
    rows = connection.execute(
        sa.select(*columns)
        .join(map_roads, map_roads.c.model_id == road_models.c.model_id)
        .where(map_roads.c.version == version)
        .order_by(map_roads.c.road_id)
    )
    return [_model(row, _served_segments(row), days.get(row.model_id, {})) for row in rows]


def load_by_id(connection: Connection, model_ids: Sequence[int]) -> list[RoadModel]:
    """Models with their evidence and without curves, by road id: what a calibration needs."""
    loaded = []
    for first in range(0, len(model_ids), MOST_BOUND):
        some = road_models.c.model_id.in_(model_ids[first : first + MOST_BOUND])
        days = select_days(connection, sa.select(road_models.c.model_id).where(some))
        rows = connection.execute(sa.select(road_models).where(some))
        loaded += [_model(row, _served_segments(row), days.get(row.model_id, {})) for row in rows]
    return sorted(loaded, key=lambda model: model.road_id)


def of_build(connection: Connection, build_id: str) -> dict[str, int]:
    """Model number of each road that a build has built."""
    rows = connection.execute(
        sa.select(road_models.c.road_id, road_models.c.model_id).where(
            road_models.c.build_id == build_id
        )
    )
    return {row.road_id: row.model_id for row in rows}


def roads_begun_after(connection: Connection, build_id: str, version: int | None) -> set[str]:
    """Roads of a map version whose models come from builds that began after this one."""
    this = sa.select(builds.c.start_number).where(builds.c.build_id == build_id).scalar_subquery()
    return set(
        connection.scalars(
            sa.select(map_roads.c.road_id)
            .join(road_models, road_models.c.model_id == map_roads.c.model_id)
            .join(builds, builds.c.build_id == road_models.c.build_id)
            .where(map_roads.c.version == version, builds.c.start_number > this)
        )
    )


def delete_of_build(connection: Connection, build_id: str) -> None:
    """Drop a build's models; its segments, fits and cells go with them."""
    connection.execute(road_models.delete().where(road_models.c.build_id == build_id))


def load_model(connection: Connection, model_id: int) -> RoadModel:
    """One model, whole: with fits and evidence."""
    this = _is(road_models, model_id)
    row = connection.execute(sa.select(road_models).where(this)).one()
    days = select_days(connection, sa.select(road_models.c.model_id).where(this))
    return _model(row, tuple(select_segments(connection, model_id)), days.get(model_id, {}))


def select_segments(
    connection: Connection, model_id: int, *, index: int | None = None
) -> list[Segment]:
    """The segments of a model with their fits, in order; only one of them when ``index`` is set."""
    query = sa.select(segments).where(_is(segments, model_id))
    fit_query = sa.select(fits).where(_is(fits, model_id))
    if index is not None:
        query = query.where(segments.c.segment_index == index)
        fit_query = fit_query.where(fits.c.segment_index == index)
    curves: dict[int, list[Curve]] = {}
    for row in connection.execute(fit_query.order_by(fits.c.segment_index, fits.c.position)):
        curves.setdefault(row.segment_index, []).append(_curve(row))
    return [
        Segment(
            index=row.segment_index,
            start_m=row.start_m,
            end_m=row.end_m,
            mid_lon=row.mid_lon,
            mid_lat=row.mid_lat,
            features=unpack(row.features, F8, KINDS, -1),
            salience=_salience(row),
            curves=tuple(curves.get(row.segment_index, ())),
        )
        for row in connection.execute(query.order_by(segments.c.segment_index))
    ]


def _is(table: sa.Table, model_id: int) -> sa.ColumnElement[bool]:
    return table.c.model_id == model_id


def _insert_all(connection: Connection, table: sa.Table, rows: list[dict[str, Any]]) -> None:
    if rows:  # an empty list would insert one row of defaults
        connection.execute(table.insert(), rows)


def _model_values(model: RoadModel) -> dict[str, Any]:
    parts = model.segments
    box = bounds_of(model.line.lon, model.line.lat)
    numbers = [
        (p.start_m, p.end_m, p.mid_lon, p.mid_lat, p.salience.gain_bits, p.salience.full_gain_bits)
        for p in parts
    ]
    empty = np.zeros((0, KINDS, len(model.cells)))
    return {
        "road_id": model.road_id,
        "length_m": model.length_m,
        "step_m": model.step_m,
        "grid_count": model.mean_dbm.shape[0],
        "cell_count": len(model.cells),
        "segment_count": len(parts),
        "pass_count": model.pass_count,
        "sample_count": model.sample_count,
        **_salience_values(model.salience),
        "west": box.west,
        "south": box.south,
        "east": box.east,
        "north": box.north,
        "cells": list(model.cells),
        "line_lon": pack(model.line.lon, F8),
        "line_lat": pack(model.line.lat, F8),
        "features": pack(model.features, F8),
        "segment_numbers": pack(numbers, F8),
        "segment_searches": [p.salience.search for p in parts],
        "segment_masks": pack(np.stack([p.salience.mask for p in parts]) if parts else empty, B1),
        "segment_features": pack(np.stack([p.features for p in parts]) if parts else empty, F8),
        "mean_dbm": pack(model.mean_dbm, F4),
        "spread_db": pack(model.spread_db, F4),
        "heard": pack(model.heard, F4),
        "evidence_columns": model.evidence.shape[1],
        "evidence": pack(model.evidence, F4),
        "unseen_nodes": model.unseen.shape[2],
        "unseen": pack(model.unseen, F2),
    }


def _salience_values(salience: Salience) -> dict[str, Any]:
    return {
        "mask": pack(salience.mask, B1),
        "gain_bits": salience.gain_bits,
        "full_gain_bits": salience.full_gain_bits,
        "search": salience.search,
    }


def _segment_row(model_id: int, part: Segment) -> dict[str, Any]:
    return {
        "model_id": model_id,
        "segment_index": part.index,
        "start_m": part.start_m,
        "end_m": part.end_m,
        "mid_lon": part.mid_lon,
        "mid_lat": part.mid_lat,
        "features": pack(part.features, F8),
        **_salience_values(part.salience),
    }


def _fit(curve: Curve) -> dict[str, Any]:
    return {
        "cell": curve.cell,
        "degree": curve.degree,
        "residual_db": curve.residual_db,
        "pass_count": curve.pass_count,
        "knots_m": pack(curve.knots_m, F8),
        "coefficients_dbm": pack(curve.coefficients_dbm, F8),
    }


def _cell_rows(model_id: int, model: RoadModel) -> list[dict[str, Any]]:
    fitted = [curve.cell for part in model.segments for curve in part.curves]
    rows = []
    for cell, level_dbm in zip(model.cells, np.asarray(model.mean_dbm).T, strict=True):
        mapped = level_dbm[~np.isnan(level_dbm)]
        rows.append(
            {
                "model_id": model_id,
                "cell": cell,
                "segment_count": fitted.count(cell),
                "grid_count": len(mapped),
                "min_dbm": float(mapped.min()) if len(mapped) else None,
                "max_dbm": float(mapped.max()) if len(mapped) else None,
                "mean_dbm": float(mapped.mean(dtype=np.float64)) if len(mapped) else None,
            }
        )
    return rows


def _model(row: Row[Any], parts: tuple[Segment, ...], heard_on: HeardOn) -> RoadModel:
    grid = (row.grid_count, row.cell_count)
    evidence, unseen = (getattr(row, name, b"") or b"" for name in HELD_OUT)
    return RoadModel(
        road_id=row.road_id,
        line=Line(unpack(row.line_lon, F8), unpack(row.line_lat, F8)),
        length_m=row.length_m,
        cells=tuple(row.cells),
        step_m=row.step_m,
        mean_dbm=unpack(row.mean_dbm, F4, *grid),
        spread_db=unpack(row.spread_db, F4, *grid),
        heard=unpack(row.heard, F4, *grid),
        features=unpack(row.features, F8, KINDS, row.cell_count),
        salience=_salience(row),
        segments=parts,
        pass_count=row.pass_count,
        sample_count=row.sample_count,
        evidence=unpack(evidence, F4).reshape(-1, row.evidence_columns)
        if row.evidence_columns
        else np.zeros((0, 0), dtype=np.float32),
        unseen=unpack(unseen, F2, -1, 3, row.unseen_nodes, row.cell_count)
        if row.unseen_nodes and row.cell_count
        else np.zeros((0, 3, row.unseen_nodes, row.cell_count), dtype=np.float16),
        heard_on=heard_on,
    )


def _served_segments(row: Row[Any]) -> tuple[Segment, ...]:
    numbers = unpack(row.segment_numbers, F8, row.segment_count, 6).tolist()
    shape = (row.segment_count, KINDS, row.cell_count)
    masks = unpack(row.segment_masks, B1, *shape)
    features = unpack(row.segment_features, F8, *shape)
    return tuple(
        Segment(
            index, start_m, end_m, mid_lon, mid_lat, features[index],
            Salience(masks[index], gain, full_gain, row.segment_searches[index]), (),
        )
        for index, (start_m, end_m, mid_lon, mid_lat, gain, full_gain) in enumerate(numbers)
    )  # fmt: skip


def _salience(row: Row[Any]) -> Salience:
    mask = unpack(row.mask, B1, KINDS, -1)
    return Salience(mask, row.gain_bits, row.full_gain_bits, row.search)


def _curve(row: Row[Any]) -> Curve:
    return Curve(
        cell=row.cell,
        knots_m=unpack(row.knots_m, F8),
        coefficients_dbm=unpack(row.coefficients_dbm, F8),
        degree=row.degree,
        residual_db=row.residual_db,
        pass_count=row.pass_count,
    )
