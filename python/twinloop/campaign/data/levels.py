"""Levels: in which values commands were sent, where these are the nearest ones to what controllers gave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.campaign.data.excited import apart
from twinloop.campaign.data.righted import LITTLE
from twinloop.campaign.data.sent import sent_and_asked
from twinloop.campaign.history import Experiment
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
    flown = [(run.test, run.trajectory) for run in experiments if run.test is not None]
    if not flown:
        return ()
    sent = np.concatenate([run.commands for _, run in flown])
    seen = [np.unique(values) for values in sent.T]
    few = [i for i, values in enumerate(seen) if 2 <= len(values) <= MOST]
    # Controllers are run only where there may be levels, for that takes its time.
    pairs = [sent_and_asked(*one) for one in flown] if few else []
    # A controller that is at its bounds all the time sends few values, too, as it should.
    off = [apart(*pair, test) > LITTLE * LITTLE for (test, _), pair in zip(flown, pairs, strict=False)]
    found: list[tuple[float, ...]] = [()] * signals.n_u
    for i in few:
        if np.any(off, axis=0)[i]:
            of_flights = [(was_sent[:, i], gave[:, i]) for was_sent, gave in pairs]
            found[i] = _levels(seen[i], of_flights, signals.commands[i].bounds)
    return tuple(found) if any(found) else ()


def _levels(seen: Floats, flights: Sequence[tuple[Floats, Floats]], bounds: Bounds) -> tuple[float, ...]:
    """The levels of one command, none if it has none.

    Args:
        seen: values that were sent, rising.
        flights: of each what was sent in each period, and what the controller gave (n,).
        bounds: of the command, levels themselves as long as nothing speaks against it: flights may not have shown them.
    """
    sent, asked = (np.concatenate(parts) for parts in zip(*flights, strict=True))
    candidates = [np.union1d(seen, bounds), seen]
    alike = [float(np.mean(nearest(values, asked) == sent)) for values in candidates]
    best = int(np.argmax(alike))
    if alike[best] < ALIKE:
        return ()
    # A controller that asks for hardly anything between levels makes such pulses look like the nearest ones.
    kept = np.concatenate([_that_keep_the_mean(candidates[best], gave) for _, gave in flights])
    return () if float(np.mean(kept == sent)) > alike[best] else tuple(candidates[best].tolist())


def _that_keep_the_mean(values: Floats, asked: Floats) -> Floats:
    """Pulses in which a command of so many values is sent if what each leaves is carried on to the next (n,)."""
    span, left, pulses = float(values[-1] - values[0]), 0.0, np.empty_like(asked)
    for k, command in enumerate(asked):
        pulses[k] = nearest(values, command + left)
        left = float(np.clip(command + left - pulses[k], -span, span))
    return pulses


def levels_said(model: _core.Model, signals: Signals) -> list[Remark]:
    """What is said of commands that are sent in levels.

    Args:
        model: that was learnt.
        signals: of the system.
    """
    lines = in_words(tuple(map(tuple, model.levels)), signals)
    text = f"By the recorded commands, {'; '.join(lines)}: the twin's flights send them so, too."
    return [note("levels", text)] if lines else []
