"""Tables of a store. Values stand in them as text, in their plain form: a database's own numbers would round."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Column, ForeignKey, Integer, MetaData, String, Table, Text

REVISION = "0004"
"""Of these tables; the newest migration makes them."""

metadata = MetaData()

campaigns = Table(
    "campaigns",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", String(200), nullable=False, unique=True),
    Column("identity", String(64), nullable=False),
    Column("created", String(40), nullable=False),
    Column("setup", Text, nullable=False),
    Column("system", Text),
    Column("experiments", Integer),
)
"""One row a campaign: its setup, the system that it flies where that has a plain form, and how often it will."""

sessions = Table(
    "sessions",
    metadata,
    Column("campaign", Integer, ForeignKey("campaigns.id"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("started", String(40), nullable=False),
    Column("provenance", Text, nullable=False),
)
"""One row each time a campaign was opened to be written: versions, processor, threads, command."""


def _entries(name: str, *columns: Column[Any]) -> Table:
    """A list of a logbook, a row each."""
    campaign = Column("campaign", Integer, ForeignKey("campaigns.id"), primary_key=True)
    number = Column("number", Integer, primary_key=True)
    return Table(name, metadata, campaign, number, Column("record", Text, nullable=False), *columns)


tests = _entries("tests")
asked = _entries("asked")
"""What was expected of the tests that were asked for, behind the number of the iteration."""
experiments = _entries(
    "experiments",
    Column("told", String(40), nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("runs", Integer),
)
"""The runs, each with the number of its test, its hash, and the number of runs that the system had made."""
failures = _entries("failures")
"""Tests that failed, behind their number."""
abandoned = _entries("abandoned")
"""Numbers of tests that will not be flown."""
withdrawals = _entries("withdrawals", Column("withdrawn", String(40), nullable=False))
"""Flights that count no more, each with its reason and the time; their own rows stay as they were."""
ENTRIES = {table.name: table for table in (tests, asked, experiments, failures, abandoned, withdrawals)}
"""Lists of a logbook that only grow, by their names there."""

approvals = Table(
    "approvals",
    metadata,
    Column("campaign", Integer, ForeignKey("campaigns.id"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("approved", String(40), nullable=False),
)
"""Numbers of tests that a person has said may be flown, and when; no campaign depends on it."""

checkpoints = Table(
    "checkpoints",
    metadata,
    Column("campaign", Integer, ForeignKey("campaigns.id"), primary_key=True),
    Column("saved", String(40), nullable=False),
    Column("record", Text, nullable=False),
)
"""What was learnt, and a search that is under way: the last one of each campaign."""

progress = Table(
    "progress",
    metadata,
    Column("campaign", Integer, ForeignKey("campaigns.id"), primary_key=True),
    Column("said", String(40), nullable=False),
    Column("record", Text, nullable=False),
)
"""What the writer of a campaign is doing, said once a second at most; there is no row where nobody works."""
