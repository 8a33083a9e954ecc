"""The first tables: surveys, roads, cells, models, map versions, builds, workers."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "builds",
        sa.Column("build_id", sa.String(length=36), nullable=False),
        sa.Column("status", sa.String(length=12), nullable=False),
        sa.Column("activate", sa.Boolean(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("due_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("started_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("finished_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("start_number", sa.Integer(), nullable=True),
        sa.Column("map_version", sa.Integer(), nullable=True),
        sa.Column("problem", sa.JSON(none_as_null=True), nullable=True),
        sa.CheckConstraint(
            "status IN ('accepted', 'running', 'successful', 'failed', 'dismissed')",
            name=op.f("ck_builds_status"),
        ),
        sa.PrimaryKeyConstraint("build_id", name=op.f("pk_builds")),
        sa.UniqueConstraint("start_number", name=op.f("uq_builds_start_number")),
    )
    op.create_index(op.f("ix_builds_status"), "builds", ["status"])

    op.create_table(
        "cells",
        sa.Column("cell", sa.Text(), nullable=False),
        sa.Column("first_seen_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("cell", name=op.f("pk_cells")),
    )
    op.create_table(
        "roads",
        sa.Column("road_id", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("west", sa.Float(), nullable=True),
        sa.Column("south", sa.Float(), nullable=True),
        sa.Column("east", sa.Float(), nullable=True),
        sa.Column("north", sa.Float(), nullable=True),
        sa.Column("line_lon", sa.LargeBinary(), nullable=True),
        sa.Column("line_lat", sa.LargeBinary(), nullable=True),
        sa.PrimaryKeyConstraint("road_id", name=op.f("pk_roads")),
    )
    op.create_table(
        "surveys",
        sa.Column("survey_id", sa.String(length=36), nullable=False),
        sa.Column("content_hash", sa.String(length=64), nullable=False),
        sa.Column("idempotency_key", sa.Text(), nullable=True),
        sa.Column("received_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("recorded_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("device", sa.Text(), nullable=True),
        sa.Column("reference_cell", sa.Text(), nullable=True),
        sa.Column("build_id", sa.String(length=36), nullable=True),
        sa.Column("sample_count", sa.Integer(), nullable=False),
        sa.Column("cell_count", sa.Integer(), nullable=False),
        sa.Column("cells", sa.JSON(), nullable=False),
        sa.Column("dropped", sa.JSON(), nullable=False),
        sa.Column("time_s", sa.LargeBinary(), nullable=False),
        sa.Column("lon", sa.LargeBinary(), nullable=False),
        sa.Column("lat", sa.LargeBinary(), nullable=False),
        sa.Column("rsrp_dbm", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("survey_id", name=op.f("pk_surveys")),
        sa.UniqueConstraint("content_hash", name=op.f("uq_surveys_content_hash")),
        sa.UniqueConstraint("idempotency_key", name=op.f("uq_surveys_idempotency_key")),
    )
    op.create_table(
        "workers",
        sa.Column("worker_id", sa.String(length=36), nullable=False),
        sa.Column("host", sa.Text(), nullable=False),
        sa.Column("pid", sa.Integer(), nullable=False),
        sa.Column("started_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("beats", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("worker_id", name=op.f("pk_workers")),
    )
    op.create_table(
        "build_roads",
        sa.Column("build_id", sa.String(length=36), nullable=False),
        sa.Column("road_id", sa.Text(), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(length=8), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("code", sa.Text(), nullable=True),
        sa.Column("detail", sa.Text(), nullable=True),
        sa.CheckConstraint(
            "state IN ('waiting', 'built', 'gone', 'failed')", name=op.f("ck_build_roads_state")
        ),
        sa.ForeignKeyConstraint(
            ["build_id"],
            ["builds.build_id"],
            name=op.f("fk_build_roads_build_id"),
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["road_id"], ["roads.road_id"], name=op.f("fk_build_roads_road_id")
        ),
        sa.PrimaryKeyConstraint("build_id", "road_id", name=op.f("pk_build_roads")),
        sa.UniqueConstraint("build_id", "position", name=op.f("uq_build_roads_build_id_position")),
    )
    op.create_table(
        "map_versions",
        sa.Column("version", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("build_id", sa.String(length=36), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("road_count", sa.Integer(), nullable=False),
        sa.Column("calibration", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["build_id"], ["builds.build_id"], name=op.f("fk_map_versions_build_id")
        ),
        sa.PrimaryKeyConstraint("version", name=op.f("pk_map_versions")),
        sa.UniqueConstraint("build_id", name=op.f("uq_map_versions_build_id")),
    )
    op.create_table(
        "passes",
        sa.Column("survey_id", sa.String(length=36), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("road_id", sa.Text(), nullable=False),
        sa.Column("first_sample", sa.Integer(), nullable=False),
        sa.Column("end_sample", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["road_id"], ["roads.road_id"], name=op.f("fk_passes_road_id")),
        sa.ForeignKeyConstraint(
            ["survey_id"],
            ["surveys.survey_id"],
            name=op.f("fk_passes_survey_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("survey_id", "position", name=op.f("pk_passes")),
    )
    op.create_index(op.f("ix_passes_road_id"), "passes", ["road_id"])

    op.create_table(
        "road_models",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("road_id", sa.Text(), nullable=False),
        sa.Column("build_id", sa.String(length=36), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("length_m", sa.Float(), nullable=False),
        sa.Column("step_m", sa.Float(), nullable=False),
        sa.Column("grid_count", sa.Integer(), nullable=False),
        sa.Column("cell_count", sa.Integer(), nullable=False),
        sa.Column("segment_count", sa.Integer(), nullable=False),
        sa.Column("pass_count", sa.Integer(), nullable=False),
        sa.Column("sample_count", sa.Integer(), nullable=False),
        sa.Column("gain_bits", sa.Float(), nullable=False),
        sa.Column("full_gain_bits", sa.Float(), nullable=False),
        sa.Column("search", sa.String(length=32), nullable=False),
        sa.Column("west", sa.Float(), nullable=True),
        sa.Column("south", sa.Float(), nullable=True),
        sa.Column("east", sa.Float(), nullable=True),
        sa.Column("north", sa.Float(), nullable=True),
        sa.Column("cells", sa.JSON(), nullable=False),
        sa.Column("line_lon", sa.LargeBinary(), nullable=False),
        sa.Column("line_lat", sa.LargeBinary(), nullable=False),
        sa.Column("mask", sa.LargeBinary(), nullable=False),
        sa.Column("features", sa.LargeBinary(), nullable=False),
        sa.Column("segment_numbers", sa.LargeBinary(), nullable=False),
        sa.Column("segment_searches", sa.JSON(), nullable=False),
        sa.Column("segment_masks", sa.LargeBinary(), nullable=False),
        sa.Column("segment_features", sa.LargeBinary(), nullable=False),
        sa.Column("mean_dbm", sa.LargeBinary(), nullable=False),
        sa.Column("spread_db", sa.LargeBinary(), nullable=False),
        sa.Column("heard", sa.LargeBinary(), nullable=False),
        sa.Column("evidence_columns", sa.Integer(), nullable=False),
        sa.Column("evidence", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["build_id"], ["builds.build_id"], name=op.f("fk_road_models_build_id")
        ),
        sa.ForeignKeyConstraint(
            ["road_id"], ["roads.road_id"], name=op.f("fk_road_models_road_id")
        ),
        sa.PrimaryKeyConstraint("model_id", name=op.f("pk_road_models")),
        sa.UniqueConstraint("build_id", "road_id", name=op.f("uq_road_models_build_id_road_id")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_road_models_road_id"), "road_models", ["road_id"])

    op.create_table(
        "activations",
        sa.Column("activation_id", sa.Integer(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("activated_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["version"], ["map_versions.version"], name=op.f("fk_activations_version")
        ),
        sa.PrimaryKeyConstraint("activation_id", name=op.f("pk_activations")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "map_roads",
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("road_id", sa.Text(), nullable=False),
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["model_id"], ["road_models.model_id"], name=op.f("fk_map_roads_model_id")
        ),
        sa.ForeignKeyConstraint(["road_id"], ["roads.road_id"], name=op.f("fk_map_roads_road_id")),
        sa.ForeignKeyConstraint(
            ["version"],
            ["map_versions.version"],
            name=op.f("fk_map_roads_version"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("version", "road_id", name=op.f("pk_map_roads")),
    )
    op.create_index(op.f("ix_map_roads_model_id"), "map_roads", ["model_id"])

    op.create_table(
        "model_cells",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("cell", sa.Text(), nullable=False),
        sa.Column("segment_count", sa.Integer(), nullable=False),
        sa.Column("grid_count", sa.Integer(), nullable=False),
        sa.Column("min_dbm", sa.Float(), nullable=True),
        sa.Column("max_dbm", sa.Float(), nullable=True),
        sa.Column("mean_dbm", sa.Float(), nullable=True),
        sa.ForeignKeyConstraint(["cell"], ["cells.cell"], name=op.f("fk_model_cells_cell")),
        sa.ForeignKeyConstraint(
            ["model_id"],
            ["road_models.model_id"],
            name=op.f("fk_model_cells_model_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("model_id", "cell", name=op.f("pk_model_cells")),
    )
    op.create_index(op.f("ix_model_cells_cell"), "model_cells", ["cell"])

    op.create_table(
        "segments",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("segment_index", sa.Integer(), nullable=False),
        sa.Column("start_m", sa.Float(), nullable=False),
        sa.Column("end_m", sa.Float(), nullable=False),
        sa.Column("mid_lon", sa.Float(), nullable=False),
        sa.Column("mid_lat", sa.Float(), nullable=False),
        sa.Column("gain_bits", sa.Float(), nullable=False),
        sa.Column("full_gain_bits", sa.Float(), nullable=False),
        sa.Column("search", sa.String(length=32), nullable=False),
        sa.Column("mask", sa.LargeBinary(), nullable=False),
        sa.Column("features", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["model_id"],
            ["road_models.model_id"],
            name=op.f("fk_segments_model_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("model_id", "segment_index", name=op.f("pk_segments")),
    )
    op.create_table(
        "fits",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("segment_index", sa.Integer(), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("cell", sa.Text(), nullable=False),
        sa.Column("degree", sa.Integer(), nullable=False),
        sa.Column("residual_db", sa.Float(), nullable=False),
        sa.Column("pass_count", sa.Integer(), nullable=False),
        sa.Column("knots_m", sa.LargeBinary(), nullable=False),
        sa.Column("coefficients_dbm", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["model_id", "segment_index"],
            ["segments.model_id", "segments.segment_index"],
            name=op.f("fk_fits_model_id_segment_index"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("model_id", "segment_index", "position", name=op.f("pk_fits")),
    )


def downgrade() -> None:
    op.drop_table("fits")
    op.drop_table("segments")
    op.drop_table("model_cells")
    op.drop_table("map_roads")
    op.drop_table("activations")
    op.drop_table("road_models")
    op.drop_table("passes")
    op.drop_table("map_versions")
    op.drop_table("build_roads")
    op.drop_table("workers")
    op.drop_table("surveys")
    op.drop_table("roads")
    op.drop_table("cells")
    op.drop_table("builds")
