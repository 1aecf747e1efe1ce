"""Sent: the commands on record, beside those that the controller gives for the recorded states."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.excited import as_excited, excited, given, span_of
from twinloop.campaign.history import Experiment
from twinloop.test import Test

OTHER = 0.5
"""Share of what a command does, or all do on average, that may differ from what their controller gives, squared."""
LITTLE = 0.02
"""Share of their bounds by which commands may differ whatever they do."""
LEVELS = 5
"""Values that commands have at most that are sent in pulses."""
EXCHANGED = 20.0
"""Times nearer to the controller's that two commands are once exchanged, in squares, where that was the fault."""
PULSES = 2.0
"""Times the span of a command that pulses may be behind or ahead of it."""


def other_commands(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose recorded commands have little to do with those of their controllers.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
    """
    return [number for number, pulsed in _unlike(experiments).items() if not pulsed]


def in_pulses(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose commands were sent in pulses, as a relay sends them: right in their sum alone.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
    """
    return [number for number, pulsed in _unlike(experiments).items() if pulsed]


def exchanged(run: Experiment) -> tuple[int, int] | None:
    """Two commands that are those of the test's controller once their columns are exchanged; None where no two are.

    Args:
        run: of a test.
    """
    if run.test is None:
        return None
    test = _as_flown(run)
    sent, asked = run.trajectory.commands, given(test, run.trajectory.states)
    before = _off(sent, asked, test)
    for pair in combinations(range(sent.shape[1]), 2):
        first, second = pair
        crossed = _off(sent[:, [second, first]], asked[:, pair], test, pair)
        if before[[first, second]].min() > max(LITTLE * LITTLE, EXCHANGED * crossed.max()):
            return pair
    return None


def _unlike(experiments: Sequence[Experiment]) -> dict[int, bool]:
    """Tests in which what was sent is not what the controller gives, by number: whether it was sent in pulses."""
    found: dict[int, bool] = {}
    for run in experiments:
        if run.test is None or run.test.number in found:
            continue
        test = _as_flown(run)
        sent, asked, span = run.trajectory.commands, given(test, run.trajectory.states), span_of(test)
        size = np.square((asked - asked.mean(axis=0)) / span).mean(axis=0)
        off = _off(sent, asked, test)
        far = (off > OTHER * np.maximum(size, size.mean())) & (off > LITTLE * LITTLE)
        if far.any():
            found[run.test.number] = _pulses(sent[:, far], asked[:, far], span[far])
        elif exchanged(run) is not None:
            found[run.test.number] = False
    return found


def _as_flown(run: Experiment) -> Test:
    """The test of a run, excited as it was: an excitation that was left out, or not held back, is a fault by itself."""
    assert run.test is not None
    return as_excited(run.test, excited(run.test, run.trajectory))


def _off(sent: Floats, asked: Floats, test: Test, columns: Sequence[int] | None = None) -> Floats:
    """Mean squares of what commands are off from those that the controller gives, in units of their spans."""
    span = span_of(test) if columns is None else span_of(test)[list(columns)]
    off: Floats = np.square((sent - asked) / span).mean(axis=0)
    return off


def _pulses(sent: Floats, asked: Floats, span: Floats) -> bool:
    """Whether few levels were sent, and until any time as much as the controller gives, up to a pulse or two."""
    if any(len(np.unique(command)) > LEVELS for command in sent.T):
        return False
    return bool((np.abs(np.cumsum(sent - asked, axis=0)) <= PULSES * span).all())
