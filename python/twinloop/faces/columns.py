"""The file of a test: what is added to each command, targets that vary with time, and the predicted run."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from twinloop.errors import InvalidInput
from twinloop.faces.ends import varying
from twinloop.faces.from_file import file_beside
from twinloop.logs import TIME
from twinloop.store import StoredAs
from twinloop.test import Test
from twinloop.trajectory import Trajectory

OURS = ("excitation_", "target_", "predicted_", "low_", "high_")
"""How columns of a test begin, beside its times."""
HEAD = 100_000
"""Characters that are read of a file's names of columns."""
PLAIN = re.compile("[a-z0-9][a-z0-9_-]{0,59}")
"""Names that any folder takes as they are, and keeps apart."""


def columns(test: Test, predicted: Trajectory | None) -> dict[str, np.ndarray]:
    """What is added to each command, targets that vary, and the predicted run with its band, by name.

    Args:
        test: to be flown.
        predicted: its run on the twin; None where nothing is known yet.
    """
    signals = test.family.signals
    columns = {TIME: signals.dt * np.arange(test.steps + 1)}
    columns |= excitation_columns(test)
    columns |= {f"target_{name}": rows for name, rows in varying(test).items()}
    if predicted is not None:
        for i, name in enumerate(signals.state_names):
            columns[f"predicted_{name}"] = predicted.states[:, i]
            if predicted.band is not None:
                columns[f"low_{name}"], columns[f"high_{name}"] = predicted.band[:, :, i]
    return columns


def excitation_columns(test: Test) -> dict[str, np.ndarray]:
    """What is added to each command, a row a period; also where it is nothing, for programs that read these columns.

    Args:
        test: to be flown.
    """
    signals = test.family.signals
    added = np.zeros((test.steps, signals.n_u)) if test.excitation is None else test.excitation
    return {f"excitation_{name}": added[:, i] for i, name in enumerate(signals.command_names)}


def refuse_other(path: Path) -> None:
    """Refuses to write a test's columns over another file, such as a flight that was recorded under its name.

    Args:
        path: of the file that will be written.

    Raises:
        InvalidInput: a file with other columns.
    """
    if not path.is_file():
        return
    with path.open(encoding="utf-8", errors="replace") as file:
        head = file.readline(HEAD).strip().split(",")
    if not all(name == TIME or name.startswith(OURS) for name in head):
        raise InvalidInput(
            f"File {path}: expected none, or the columns of this test, found {', '.join(head[:3])} …; the test is"
            " planned: rename the file, then ask again."
        )


def columns_file(stored_as: StoredAs, test: Test) -> Path:
    """The file of a test, beside the store, or here where that is a server; each campaign has files of its own.

    Args:
        stored_as: under what the campaign is found.
        test: of the campaign.
    """
    beside = file_beside(stored_as.store)
    stem = Path(_database(stored_as.store)) if beside is None else beside.with_suffix("")
    of = "" if stored_as.name is None else f"-of-{_in_a_file_name(stored_as.name)}"
    return stem.with_name(f"{stem.name}-test-{test.number}{of}.csv")


def _database(address: str) -> str:
    """The name of a server's database as a part of that of a file; "campaign" where the address names none."""
    name = urlsplit(address).path.strip("/")
    return _in_a_file_name(name) if name else "campaign"


def _in_a_file_name(name: str) -> str:
    """A name as a part of that of a file: readable, and another one for any other name.

    Where it has letters that a folder may refuse or take for others, a few digits of its hash keep it apart.
    """
    if PLAIN.fullmatch(name):
        return name
    plain = re.sub(r"[^A-Za-z0-9]+", "-", name)[:40].strip("-")
    return "-".join(filter(None, [plain, hashlib.sha256(name.encode()).hexdigest()[:8]]))
