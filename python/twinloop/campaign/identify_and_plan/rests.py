"""Resting commands: those whose effect may be in the actuators when a run begins.

An actuator with a lag begins a run somewhere. Its first command may be no sign of it: a controller that begins with a
step of its target sends a jump at once. A family says what it sends when there is nothing to do. A log without a test
was flown by a controller that nobody knows: what its commands lie around is where it rests, such as hover.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.campaign.setup import Setup

SAME = 0.01
"""Share of the range of each command within which two resting commands are one: the search takes time for each."""


def resting_commands(setup: Setup, flights: Sequence[Experiment]) -> list[Floats]:
    """Commands (n_u,) at which actuators may rest before a run, beside the first one of the run itself.

    Args:
        setup: of the campaign.
        flights: that are learnt from.

    Returns:
        What the family sends at the target; and the median of what was sent in flights without a test, if that is
        another.
    """
    found = [_of_family(setup)]
    logs = [run.trajectory.commands for run in flights if run.test is None]
    if logs:
        around = np.median(np.concatenate(logs), axis=0)
        widths = np.array([command.bounds[1] - command.bounds[0] for command in setup.signals.commands])
        if (np.abs(around - found[0]) > SAME * widths).any():
            found.append(around)
    return found


def _of_family(setup: Setup) -> Floats:
    """What the family sends when there is nothing to do."""
    target = np.atleast_2d(setup.target_state)[0]
    middle = np.array([0.5 * (gain.low + gain.high) for gain in setup.family.gains])
    sent: Floats = setup.family.controller(middle).command(target, target)
    return sent
