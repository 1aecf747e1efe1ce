"""Progress: what the writer of a campaign is doing."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Makes the table."""
    op.create_table(
        "progress",
        sa.Column("campaign", sa.Integer, sa.ForeignKey("campaigns.id"), primary_key=True),
        sa.Column("said", sa.String(40), nullable=False),
        sa.Column("record", sa.Text, nullable=False),
    )
