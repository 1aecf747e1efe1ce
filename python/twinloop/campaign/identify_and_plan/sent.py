"""Sent: the commands on record, beside those that the controller gives for the recorded states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.excited import apart, as_excited, excited, given, span_of
from twinloop.campaign.history import Experiment

OTHER = 0.5
"""Share of what commands do that may differ from what their controller gives, squared."""
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


def _unlike(experiments: Sequence[Experiment]) -> dict[int, bool]:
    """Tests in which what was sent is not what the controller gives, by number: whether it was sent in pulses."""
    found: dict[int, bool] = {}
    for run in experiments:
        if run.test is None or run.test.number in found:
            continue
        # An excitation that was left out, or not held back, is another fault, and is said by itself.
        test = as_excited(run.test, excited(run.test, run.trajectory))
        sent, asked, span = run.trajectory.commands, given(test, run.trajectory.states), span_of(test)
        size = np.square((asked - asked.mean(axis=0)) / span).mean()
        off = apart(sent, asked, test)
        if off > OTHER * size and off > LITTLE * LITTLE:
            found[test.number] = _pulses(sent, asked, span)
    return found


def _pulses(sent: Floats, asked: Floats, span: Floats) -> bool:
    """Whether few levels were sent, and until any time as much as the controller gives, up to a pulse or two."""
    if any(len(np.unique(command)) > LEVELS for command in sent.T):
        return False
    return bool((np.abs(np.cumsum(sent - asked, axis=0)) <= PULSES * span).all())
