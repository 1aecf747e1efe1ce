"""The first tables: campaigns, sessions, tests, what was asked, experiments, checkpoints."""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Makes the tables."""
    op.create_table(
        "campaigns",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("name", sa.String(200), nullable=False, unique=True),
        sa.Column("identity", sa.String(64), nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("setup", sa.Text, nullable=False),
        sa.Column("system", sa.Text),
        sa.Column("experiments", sa.Integer),
    )
    _entries("sessions", _text("started", 40), _text("provenance"))
    _entries("tests", _text("record"))
    _entries("asked", _text("record"))
    runs = sa.Column("runs", sa.Integer)
    _entries("experiments", _text("record"), _text("told", 40), _text("sha256", 64), runs)
    _entries("failures", _text("record"))
    _entries("abandoned", _text("record"))
    op.create_table("checkpoints", _campaign(), _text("saved", 40), _text("record"))


def _entries(name: str, *columns: sa.Column[Any]) -> None:
    number = sa.Column("number", sa.Integer, primary_key=True)
    op.create_table(name, _campaign(), number, *columns)


def _campaign() -> sa.Column[Any]:
    return sa.Column("campaign", sa.Integer, sa.ForeignKey("campaigns.id"), primary_key=True)


def _text(name: str, size: int | None = None) -> sa.Column[Any]:
    return sa.Column(name, sa.Text if size is None else sa.String(size), nullable=False)
