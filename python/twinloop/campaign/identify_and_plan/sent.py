"""Sent: the commands on record, beside those that the controller gives for the recorded states."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

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
    """Two commands that the test's controller gives once their columns are exchanged; None where no two are the fault.

    Args:
        run: of a test, with commands that are not those of its controller.
    """
    if run.test is None:
        return None
    sent, test = run.trajectory.commands, _as_flown(run)
    asked = given(test, run.trajectory.states)
    for pair in combinations(range(sent.shape[1]), 2):
        other = sent.copy()
        other[:, pair] = sent[:, pair[::-1]]
        if not _off(other, asked, test).any():
            return pair
    return None


def _unlike(experiments: Sequence[Experiment]) -> dict[int, bool]:
    """Tests in which what was sent is not what the controller gives, by number: whether it was sent in pulses."""
    found: dict[int, bool] = {}
    for run in experiments:
        if run.test is None or run.test.number in found:
            continue
        test = _as_flown(run)
        sent, asked = run.trajectory.commands, given(test, run.trajectory.states)
        off = _off(sent, asked, test)
        if off.any():
            found[run.test.number] = _pulses(sent[:, off], asked[:, off], span_of(test)[off])
    return found


def _as_flown(run: Experiment) -> Test:
    """The test of a run, excited as it was: an excitation that was left out, or not held back, is a fault by itself."""
    assert run.test is not None
    return as_excited(run.test, excited(run.test, run.trajectory))


def _off(sent: Floats, asked: Floats, test: Test) -> NDArray[np.bool_]:
    """Commands that have little to do with what the controller gives (n_u,); two columns exchanged are two of many."""
    span = span_of(test)
    size = np.square((asked - asked.mean(axis=0)) / span).mean(axis=0)
    off = np.square((sent - asked) / span).mean(axis=0)
    return np.asarray((off > OTHER * np.maximum(size, size.mean())) & (off > LITTLE * LITTLE))


def _pulses(sent: Floats, asked: Floats, span: Floats) -> bool:
    """Whether few levels were sent, and until any time as much as the controller gives, up to a pulse or two."""
    if any(len(np.unique(command)) > LEVELS for command in sent.T):
        return False
    return bool((np.abs(np.cumsum(sent - asked, axis=0)) <= PULSES * span).all())
