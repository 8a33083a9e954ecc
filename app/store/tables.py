"""
The tables. `migrations/` equals them (tested).

What people query (roads, sub-segments, masks, fits) is rows and columns; bulk numbers are one
little-endian blob a matrix with its shape in columns beside it (`app.store.columns.pack`). Blob
columns come last in their table: SQLite then reads a row's small columns without walking its blobs.
"""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy import Boolean, Column, Float, ForeignKey, Integer, LargeBinary, String, Table, Text

from app.store.columns import UtcMoment

SCHEMA_REVISION = "0007"  # of the newest file in migrations/versions: a start without Alembic

metadata = sa.MetaData(
    naming_convention={
        "ix": "ix_%(column_0_N_label)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)


def _bounds() -> list[Column[float]]:
    """West, south, east, north in degrees; west > east when the antimeridian lies within."""
    return [Column(name, Float) for name in ("west", "south", "east", "north")]


roads = Table(
    "roads",
    metadata,
    Column("road_id", Text, primary_key=True),
    Column("name", Text),
    Column("created_at", UtcMoment, nullable=False),
    *_bounds(),
    # True: the drives made it, and its line follows them. False: somebody gave it.
    Column("found", Boolean, nullable=False, server_default=sa.false()),
    Column("line_lon", LargeBinary),
    Column("line_lat", LargeBinary),
)

cells = Table(
    "cells",
    metadata,
    Column("cell", Text, primary_key=True),
    Column("first_seen_at", UtcMoment, nullable=False),
)

surveys = Table(
    "surveys",
    metadata,
    Column("survey_id", String(36), primary_key=True),
    Column("content_hash", String(64), nullable=False, unique=True),
    Column("idempotency_key", Text, unique=True),
    Column("received_at", UtcMoment, nullable=False),
    Column("recorded_at", UtcMoment),
    Column("device", Text),
    Column("reference_cell", Text),
    Column("build_id", String(36)),  # no foreign key: old builds may be cleared away
    # given: its road was named; waiting: its roads are to be found; found; lost: finding them broke
    Column("placing", String(8), nullable=False, server_default="given", index=True),
    *_bounds(),
    Column("sample_count", Integer, nullable=False),
    Column("cell_count", Integer, nullable=False),
    Column("cells", sa.JSON, nullable=False),
    Column("dropped", sa.JSON, nullable=False),
    Column("global_ids", sa.JSON, nullable=False, server_default="{}"),  # of some cells
    Column("time_s", LargeBinary, nullable=False),
    Column("lon", LargeBinary, nullable=False),
    Column("lat", LargeBinary, nullable=False),
    Column("rsrp_dbm", LargeBinary, nullable=False),
)

passes = Table(  # which samples of a survey run along which road
    "passes",
    metadata,
    Column("survey_id", ForeignKey("surveys.survey_id", ondelete="CASCADE"), primary_key=True),
    Column("position", Integer, primary_key=True),
    Column("road_id", ForeignKey("roads.road_id"), nullable=False, index=True),
    Column("first_sample", Integer, nullable=False),
    Column("end_sample", Integer, nullable=False),
)

builds = Table(
    "builds",
    metadata,
    Column("build_id", String(36), primary_key=True),
    Column("status", String(12), nullable=False, index=True),
    Column("activate", Boolean, nullable=False),
    Column("created_at", UtcMoment, nullable=False),
    Column("due_at", UtcMoment, nullable=False),
    Column("started_at", UtcMoment),
    Column("finished_at", UtcMoment),
    Column("start_number", Integer, unique=True),  # the order in which builds began
    Column("map_version", Integer),
    Column("problem", sa.JSON(none_as_null=True)),
    sa.CheckConstraint(
        "status IN ('accepted', 'running', 'successful', 'failed', 'dismissed')", name="status"
    ),
)

build_roads = Table(
    "build_roads",
    metadata,
    Column("build_id", ForeignKey("builds.build_id", ondelete="CASCADE"), primary_key=True),
    Column("road_id", ForeignKey("roads.road_id"), primary_key=True),
    Column("position", Integer, nullable=False),
    Column("state", String(8), nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("code", Text),
    Column("detail", Text),
    sa.UniqueConstraint("build_id", "position"),
    sa.CheckConstraint("state IN ('waiting', 'built', 'gone', 'failed')", name="state"),
)

road_models = Table(
    "road_models",
    metadata,
    Column("model_id", Integer, primary_key=True),
    Column("road_id", ForeignKey("roads.road_id"), nullable=False, index=True),
    Column("build_id", ForeignKey("builds.build_id"), nullable=False),
    Column("created_at", UtcMoment, nullable=False),
    Column("length_m", Float, nullable=False),
    Column("step_m", Float, nullable=False),
    Column("grid_count", Integer, nullable=False),
    Column("cell_count", Integer, nullable=False),
    Column("segment_count", Integer, nullable=False),
    Column("pass_count", Integer, nullable=False),
    Column("sample_count", Integer, nullable=False),
    Column("gain_bits", Float, nullable=False),
    Column("full_gain_bits", Float, nullable=False),
    Column("search", String(32), nullable=False),
    *_bounds(),
    Column("cells", sa.JSON, nullable=False),
    Column("line_lon", LargeBinary, nullable=False),
    Column("line_lat", LargeBinary, nullable=False),
    Column("mask", LargeBinary, nullable=False),
    Column("features", LargeBinary, nullable=False),
    # The segments' numbers once more, each as one matrix: what a serving process reads.
    Column("segment_numbers", LargeBinary, nullable=False),
    Column("segment_searches", sa.JSON, nullable=False),
    Column("segment_masks", LargeBinary, nullable=False),
    Column("segment_features", LargeBinary, nullable=False),
    Column("mean_dbm", LargeBinary, nullable=False),
    Column("spread_db", LargeBinary, nullable=False),
    Column("heard", LargeBinary, nullable=False),
    Column("evidence_columns", Integer, nullable=False),
    Column("evidence", LargeBinary, nullable=False),
    Column("unseen_nodes", Integer, nullable=False, server_default="0"),
    Column("unseen", LargeBinary, nullable=True),
    sa.UniqueConstraint("build_id", "road_id"),  # a road is built once a build, whoever retries
    sqlite_autoincrement=True,  # a model's number is never given to another
)

segments = Table(
    "segments",
    metadata,
    Column("model_id", ForeignKey("road_models.model_id", ondelete="CASCADE"), primary_key=True),
    Column("segment_index", Integer, primary_key=True),
    Column("start_m", Float, nullable=False),
    Column("end_m", Float, nullable=False),
    Column("mid_lon", Float, nullable=False),
    Column("mid_lat", Float, nullable=False),
    Column("gain_bits", Float, nullable=False),
    Column("full_gain_bits", Float, nullable=False),
    Column("search", String(32), nullable=False),
    Column("mask", LargeBinary, nullable=False),
    Column("features", LargeBinary, nullable=False),
)

fits = Table(
    "fits",
    metadata,
    Column("model_id", Integer, primary_key=True),
    Column("segment_index", Integer, primary_key=True),
    Column("position", Integer, primary_key=True),
    Column("cell", Text, nullable=False),
    Column("degree", Integer, nullable=False),
    Column("residual_db", Float, nullable=False),
    Column("pass_count", Integer, nullable=False),
    Column("knots_m", LargeBinary, nullable=False),
    Column("coefficients_dbm", LargeBinary, nullable=False),
    sa.ForeignKeyConstraint(
        ["model_id", "segment_index"],
        ["segments.model_id", "segments.segment_index"],
        ondelete="CASCADE",
    ),
)

segment_coverage = Table(  # who drove a segment, and how much a window that ends there tells
    "segment_coverage",
    metadata,
    Column("model_id", Integer, primary_key=True),
    Column("segment_index", Integer, primary_key=True),
    Column("passes", Integer, nullable=False),
    Column("forward", Integer, nullable=False),
    Column("backward", Integer, nullable=False),
    Column("days", Integer, nullable=False),
    Column("devices", Integer, nullable=False),
    Column("cells", Integer, nullable=False),
    Column("cells_heard", Float, nullable=False),
    Column("spread_db", Float),
    Column("last_surveyed_at", UtcMoment),
    Column("place_information", Float, nullable=False),
    Column("mixed_information", Float, nullable=False),
    Column("offset_information", Float, nullable=False),
    sa.ForeignKeyConstraint(
        ["model_id", "segment_index"],
        ["segments.model_id", "segments.segment_index"],
        ondelete="CASCADE",
    ),
)

model_cells = Table(
    "model_cells",
    metadata,
    Column("model_id", ForeignKey("road_models.model_id", ondelete="CASCADE"), primary_key=True),
    Column("cell", ForeignKey("cells.cell"), primary_key=True, index=True),
    Column("segment_count", Integer, nullable=False),
    Column("grid_count", Integer, nullable=False),
    Column("min_dbm", Float),
    Column("max_dbm", Float),
    Column("mean_dbm", Float),
)

model_days = Table(  # which of its cells each survey day of a model heard; none: not known
    "model_days",
    metadata,
    Column("model_id", ForeignKey("road_models.model_id", ondelete="CASCADE"), primary_key=True),
    Column("day", String(10), primary_key=True),  # ISO date, empty of passes without one
    Column("heard", LargeBinary, nullable=False),
)

map_versions = Table(
    "map_versions",
    metadata,
    Column("version", Integer, primary_key=True, autoincrement=False),
    Column("build_id", ForeignKey("builds.build_id"), nullable=False, unique=True),
    Column("created_at", UtcMoment, nullable=False),
    Column("road_count", Integer, nullable=False),
    Column("calibration", sa.JSON, nullable=False),
)

map_roads = Table(  # a map version names one model a road
    "map_roads",
    metadata,
    Column("version", ForeignKey("map_versions.version", ondelete="CASCADE"), primary_key=True),
    Column("road_id", ForeignKey("roads.road_id"), primary_key=True),
    Column("model_id", ForeignKey("road_models.model_id"), nullable=False, index=True),
)

activations = Table(  # the newest row names the active version: activation is one insert
    "activations",
    metadata,
    Column("activation_id", Integer, primary_key=True),
    Column("version", ForeignKey("map_versions.version"), nullable=False),
    Column("activated_at", UtcMoment, nullable=False),
    sqlite_autoincrement=True,
)

workers = Table(
    "workers",
    metadata,
    Column("worker_id", String(36), primary_key=True),
    Column("host", Text, nullable=False),
    Column("pid", Integer, nullable=False),
    Column("started_at", UtcMoment, nullable=False),
    Column("beats", Integer, nullable=False),
)

keys = Table(  # secrets of the store's own making, the same for all its processes
    "keys",
    metadata,
    Column("name", Text, primary_key=True),
    Column("value", LargeBinary, nullable=False),
)
