"""A store as the first version of its tables had it, with the rows of a store of today."""

import json
import sqlite3
from pathlib import Path

from alembic import command
from alembic.config import Config
from sqlalchemy import MetaData, create_engine

import twinloop.store

NEWER = ("under_way", "scores", "choosing")
"""What memories of then did not hold."""


def old_store(address, source):
    """Makes the tables of revision 0001 by their migration, and fills them.

    Args:
        address: SQLAlchemy's, of an empty database.
        source: a store in a file, whose rows it gets.
    """
    engine = create_engine(address)
    config = Config()
    config.set_main_option("script_location", str(Path(twinloop.store.__file__).with_name("migrations")))
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
    tables = MetaData()
    tables.reflect(engine)
    with engine.begin() as connection, sqlite3.connect(source) as today:
        for table in tables.sorted_tables:
            names = [column.name for column in table.columns]
            if table.name == "alembic_version":
                continue
            rows = today.execute(f"select {', '.join(names)} from {table.name}").fetchall()
            if rows:
                connection.execute(
                    table.insert(), [_of_then(dict(zip(names, row, strict=True)), table.name) for row in rows]
                )
    engine.dispose()


def _of_then(row, table):
    if table == "checkpoints":
        memory = {key: value for key, value in json.loads(row["record"]).items() if key not in NEWER}
        row["record"] = json.dumps({**memory, "version": 1})
    return row
