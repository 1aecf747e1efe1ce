"""Levels: in which values commands were sent, where these are the nearest ones to what controllers gave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.campaign.excited import apart
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.sent import LITTLE, sent_and_asked
from twinloop.law.levels import Levels, in_words, nearest
from twinloop.remarks import Remark, note
from twinloop.signals import Bounds, Signals

MOST = 16
"""Levels of a command that are looked for at most."""
ALIKE = 0.9
"""Share of what was sent that must be the level nearest to the controller's command."""


def levels_of(experiments: Sequence[Experiment], signals: Signals) -> Levels:
    """The levels in which each command was sent (n_u); none of a command that was sent as its controller gave it.

    Pulses that keep the mean of what a controller gives are no such levels: when each of them comes hangs on every
    reading's noise, and a twin that sends the controller's own commands predicts more.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
        signals: of the system.
    """
    flown = [(run.test, *sent_and_asked(run.test, run.trajectory)) for run in experiments if run.test]
    # A controller that is at its bounds all the time sends few values, too, as it should.
    off = [apart(sent, asked, test) > LITTLE * LITTLE for test, sent, asked in flown]
    found = [
        _levels([(sent[:, i], asked[:, i]) for _, sent, asked in flown], command.bounds)
        if np.any(off, axis=0)[i]
        else ()
        for i, command in enumerate(signals.commands if off else ())
    ]
    return tuple(found) if any(found) else ()


def _levels(pairs: Sequence[tuple[Floats, Floats]], bounds: Bounds) -> tuple[float, ...]:
    """The levels of one command, none if it has none.

    Args:
        pairs: what was sent (n,) and what was asked for (n,) in each flight.
        bounds: of the command, levels themselves as long as nothing speaks against it: flights may not have shown them.
    """
    sent, asked = (np.concatenate(each) for each in zip(*pairs, strict=True))
    seen = np.unique(sent)
    if not 2 <= len(seen) <= MOST:
        return ()
    candidates = [np.union1d(seen, bounds), seen]
    alike = [float(np.mean(nearest(values, asked) == sent)) for values in candidates]
    best = int(np.argmax(alike))
    return tuple(candidates[best].tolist()) if alike[best] >= ALIKE else ()


def levels_said(model: _core.Model, signals: Signals) -> list[Remark]:
    """What is said of commands that are sent in levels.

    Args:
        model: that was learnt.
        signals: of the system.
    """
    lines = in_words(tuple(map(tuple, model.levels)), signals)
    text = f"By the recorded commands, {'; '.join(lines)}: the twin's flights send them so, too."
    return [note("levels", text)] if lines else []
