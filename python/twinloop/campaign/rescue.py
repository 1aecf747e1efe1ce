"""Rescue: a flight that a store would not take is written to a file of its own."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from itertools import count
from pathlib import Path

from twinloop.logs import write_columns
from twinloop.test import Test
from twinloop.trajectory import Trajectory


def rescued(test: Test, trajectory: Trajectory) -> str:
    """Writes a flight as a log, here or, where nobody may write here, among temporary files.

    Args:
        test: that was flown.
        trajectory: what the system answered.

    Returns:
        A sentence that says where it is.
    """
    signals = test.signals
    columns = {"t": trajectory.t}
    columns |= dict(zip(signals.state_names, trajectory.states.T, strict=True))
    columns |= dict(zip(signals.command_names, trajectory.commands.T, strict=True))
    for folder in (Path.cwd(), Path(tempfile.gettempdir())):
        name = f"flight-of-test-{test.number}"
        places = (folder / (f"{name}-{again}.csv" if again else f"{name}.csv") for again in count())
        path = next(place for place in places if not place.exists())
        with suppress(OSError):
            write_columns(path, columns)
            return f"The flight of test {test.number} is in {path}: tell it instead of flying again."
    return f"The flight of test {test.number} could not be written to a file either."
