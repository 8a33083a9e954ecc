"""Curves that have not seen a road's held-out windows; models of before have none."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "road_models",
        sa.Column("unseen_nodes", sa.Integer(), server_default="0", nullable=False),
    )
    op.add_column("road_models", sa.Column("unseen", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    op.drop_column("road_models", "unseen")
    op.drop_column("road_models", "unseen_nodes")
