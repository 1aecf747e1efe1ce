"""The exam's memory: one SQLite file with a row for each (system, learner, seed, k, settings)."""

from __future__ import annotations

import io
import json
import math
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twinloop.errors import InvalidInput, NotAvailable
from twinloop.trajectory import Trajectory
from twinloop_exam import held_out
from twinloop_exam.measures import ranked
from twinloop_exam.systems import Subject

SCHEMA = 2
BEFORE = 1
"""The version before knew no commits; a file of it is gone on with."""
_KEY = "system TEXT, learner TEXT, seed INTEGER, k INTEGER, settings TEXT"
_PRIMARY = "PRIMARY KEY (system, learner, seed, k, settings)"
TABLES = {
    "measured": f"{_KEY}, measures TEXT NOT NULL, seconds REAL NOT NULL, failure TEXT, {_PRIMARY}",
    "flights": f"{_KEY}, flight BLOB NOT NULL, {_PRIMARY}",
    "held_out": "system TEXT PRIMARY KEY, signature TEXT NOT NULL, runs BLOB NOT NULL",
    "commits": "version TEXT PRIMARY KEY",
}
"""Columns of each table."""


class MissingFlights(NotAvailable):
    """The flights that a fit needs were not flown."""


@dataclass(frozen=True)
class Address:
    """Whose rows: one learner on one system with one seed.

    Args:
        system: name.
        learner: name.
        seed: of the system and the learner.
        settings: of the learner, as `learners.key`.
    """

    system: str
    learner: str
    seed: int
    settings: str


@dataclass(frozen=True)
class Row:
    """What was measured after k experiments.

    Args:
        address: whose.
        k: experiments after Υ0.
        measures: numbers by name; None where there is none.
        seconds: that it took, since the row before.
        failure: why there are no measures; None if there are.
    """

    address: Address
    k: int
    measures: Mapping[str, float | None]
    seconds: float
    failure: str | None = None


class Store:
    """An open file; several processes may have it open.

    Args:
        path: of the file; it is made if there is none.

    Raises:
        InvalidInput: the file is something else, or of another version.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with ExitStack() as unless_open:
            try:
                self._base = sqlite3.connect(path, timeout=60.0, isolation_level=None)
                unless_open.callback(self._base.close)
                self._check_whose()
                # Readers and the writers of other jobs must not wait for each other.
                self._base.execute("PRAGMA journal_mode = WAL")
                for table, columns in TABLES.items():
                    self._base.execute(f"CREATE TABLE IF NOT EXISTS {table} ({columns})")
                self._base.execute(f"PRAGMA user_version = {SCHEMA}")
            except sqlite3.Error as reason:
                raise InvalidInput(
                    f"Store {str(path)!r}: expected an SQLite file of the exam, found: {reason}; choose another"
                    " file."
                ) from reason
            unless_open.pop_all()

    def _check_whose(self) -> None:
        """Refuses a file of another version, and one that somebody else keeps something in."""
        version = self._base.execute("PRAGMA user_version").fetchone()[0]
        if version not in (0, BEFORE, SCHEMA):
            raise InvalidInput(
                f"Store {str(self.path)!r}: expected version {SCHEMA}, found {version}; choose another file."
            )
        tables = {
            name for (name,) in self._base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        }
        strangers = sorted(tables - TABLES.keys())
        if strangers:
            raise InvalidInput(
                f"Store {str(self.path)!r}: expected an SQLite file of the exam, found one with a table"
                f" {strangers[0]!r}; choose another file."
            )

    def close(self) -> None:
        """Closes the file."""
        self._base.close()

    def measured_by(self, version: str) -> None:
        """Notes which version of the code measures from now on.

        Args:
            version: of the package, with its commit.
        """
        with self._transaction():
            self._base.execute("INSERT OR IGNORE INTO commits VALUES (?)", (version,))

    @property
    def versions(self) -> list[str]:
        """Of the code that has measured what is kept, in order; none is known of files of the version before."""
        return [version for (version,) in self._base.execute("SELECT version FROM commits ORDER BY rowid")]

    def write(self, row: Row, flight: Trajectory | None = None) -> None:
        """Keeps a row and the flight that led to it, both or neither; what was there is replaced.

        Args:
            row: to keep.
            flight: the k-th experiment, where the learner made one.
        """
        measures = {name: _finite(value) for name, value in row.measures.items()}
        key = (*_columns(row.address), row.k, row.address.settings)
        with self._transaction():
            self._base.execute(
                "INSERT OR REPLACE INTO measured VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (*key, json.dumps(measures, sort_keys=True), row.seconds, row.failure),
            )
            if flight is not None:
                self._base.execute(
                    "INSERT OR REPLACE INTO flights VALUES (?, ?, ?, ?, ?, ?)", (*key, _packed(flight))
                )

    def rows(self, system: str, learner: str, settings: str) -> list[Row]:
        """All rows of a learner on a system, by seed and k.

        Args:
            system: name.
            learner: name.
            settings: of the learner.
        """
        found = self._base.execute(
            "SELECT seed, k, measures, seconds, failure FROM measured"
            " WHERE system = ? AND learner = ? AND settings = ? ORDER BY seed, k",
            (system, learner, settings),
        )
        return [
            Row(
                Address(system, learner, seed, settings),
                k,
                ranked(json.loads(measures), held_out.COUNT),
                seconds,
                failure,
            )
            for seed, k, measures, seconds, failure in found
        ]

    def done(self, address: Address, failures: bool = True) -> set[int]:
        """Numbers of experiments that are measured.

        Args:
            address: whose.
            failures: whether a failure counts as measured.
        """
        rows = self._base.execute(
            "SELECT k, failure FROM measured WHERE system = ? AND learner = ? AND seed = ? AND settings = ?",
            (*_columns(address), address.settings),
        )
        return {k for k, failure in rows if failures or failure is None}

    def flights(self, address: Address, k: int) -> list[Trajectory]:
        """Experiments 0 to k.

        Args:
            address: whose.
            k: the last.

        Raises:
            MissingFlights: not all of them were flown.
        """
        found = self._base.execute(
            "SELECT k, flight FROM flights WHERE system = ? AND learner = ? AND seed = ? AND settings = ?"
            " AND k <= ? ORDER BY k",
            (*_columns(address), address.settings, k),
        ).fetchall()
        if [number for number, _ in found] != list(range(k + 1)):
            raise MissingFlights(
                f"Flights of {address.learner} on {address.system}, seed {address.seed}: expected experiments"
                f" 0 to {k}, found {len(found)}; run that learner first."
            )
        return [_unpacked(blob) for _, blob in found]

    def held_out(self, subject: Subject) -> held_out.HeldOut:
        """The held-out controllers with their true runs, flown once and kept.

        Args:
            subject: the system.
        """
        # A plant whose first true run has changed is another plant.
        first = subject.test(held_out.controllers(subject)[0])
        run = subject.true_rig.run(first).states
        signature = f"{held_out.SEED} {held_out.COUNT} {run.shape} {run[-1].tobytes().hex()}"
        kept = self._base.execute(
            "SELECT runs FROM held_out WHERE system = ? AND signature = ?", (subject.name, signature)
        ).fetchone()
        if kept is not None:
            return held_out.unpacked(subject, kept[0])
        flown = held_out.fly(subject)
        with self._transaction():
            self._base.execute(
                "INSERT OR REPLACE INTO held_out VALUES (?, ?, ?)", (subject.name, signature, flown.packed())
            )
        return flown

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._base.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._base.execute("ROLLBACK")
            raise
        self._base.execute("COMMIT")


def _columns(address: Address) -> tuple[str, str, int]:
    return address.system, address.learner, address.seed


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _packed(flight: Trajectory) -> bytes:
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {"t": flight.t, "states": flight.states, "commands": flight.commands}
    if flight.true_states is not None:
        arrays["true_states"] = flight.true_states
    np.savez_compressed(buffer, ended=np.array([flight.ended, flight.reason]), **arrays)
    return buffer.getvalue()


def _unpacked(blob: bytes) -> Trajectory:
    with np.load(io.BytesIO(blob), allow_pickle=False) as kept:
        ended, reason = (str(word) for word in kept["ended"])
        true_states = kept["true_states"] if "true_states" in kept.files else None
        return Trajectory(kept["t"], kept["states"], kept["commands"], ended, reason, true_states)
