"""Rescue: a flight that a store would not take is written to a file of its own."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from itertools import count
from pathlib import Path

from twinloop.logs import write_columns
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import names_of


def rescued(test: Test, trajectory: Trajectory) -> str:
    """Writes a flight as a log, here or, where nobody may write here, among temporary files.

    Args:
        test: that was flown.
        trajectory: what the system answered.

    Returns:
        A sentence that says where it is.
    """
    signals, number = test.signals, test.number
    columns = {"t": trajectory.t}
    columns |= dict(zip(names_of(trajectory.states, signals), trajectory.states.T, strict=True))
    columns |= dict(zip(signals.command_names, trajectory.commands.T, strict=True))
    ended = (
        ""
        if trajectory.ended == "completed"
        else f" It ended early ({trajectory.ended}): {trajectory.reason}"
    )
    for folder in (Path, tempfile.gettempdir):
        with suppress(OSError):
            path = _free(Path(folder()).resolve(), f"flight-of-test-{number}")
            write_columns(path, columns)
            return f"The flight of test {number} is in {path}: tell that first, or the test is flown once more.{ended}"
    return f"The flight of test {number} could not be written to a file either."


def _free(folder: Path, name: str) -> Path:
    """A file that is not there yet."""
    places = (folder / (f"{name}-{again}.csv" if again else f"{name}.csv") for again in count())
    return next(place for place in places if not place.exists())
