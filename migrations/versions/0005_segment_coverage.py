"""Who drove each sub-segment, and how much a window that ends there tells of its place."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "segment_coverage",
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("segment_index", sa.Integer(), nullable=False),
        *(
            sa.Column(name, sa.Integer(), nullable=False)
            for name in ("passes", "forward", "backward", "days", "devices", "cells")
        ),
        sa.Column("cells_heard", sa.Float(), nullable=False),
        sa.Column("spread_db", sa.Float()),
        sa.Column("last_surveyed_at", sa.DateTime(timezone=True)),
        *(
            sa.Column(f"{name}_information", sa.Float(), nullable=False)
            for name in ("place", "mixed", "offset")
        ),
        sa.ForeignKeyConstraint(
            ["model_id", "segment_index"],
            ["segments.model_id", "segments.segment_index"],
            name=op.f("fk_segment_coverage_model_id_segment_index"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("model_id", "segment_index", name=op.f("pk_segment_coverage")),
    )


def downgrade() -> None:
    op.drop_table("segment_coverage")
