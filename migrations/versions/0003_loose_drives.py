"""Drives that name no road: where each lies, whether its roads are found, and which roads were."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

EDGES = ("west", "south", "east", "north")


def upgrade() -> None:
    op.add_column(
        "surveys",
        sa.Column("placing", sa.String(length=8), nullable=False, server_default="given"),
    )
    for edge in EDGES:
        op.add_column("surveys", sa.Column(edge, sa.Float(), nullable=True))
    op.create_index(op.f("ix_surveys_placing"), "surveys", ["placing"])
    op.add_column(
        "roads", sa.Column("found", sa.Boolean(), nullable=False, server_default=sa.false())
    )


def downgrade() -> None:
    op.drop_column("roads", "found")
    op.drop_index(op.f("ix_surveys_placing"), table_name="surveys")
    for edge in reversed(EDGES):
        op.drop_column("surveys", edge)
    op.drop_column("surveys", "placing")
