"""Parts of a run: what each of them would have taught shows how far the law of the whole may carry over.

A single run is explained as well by laws that part ways on the next one. Two runs test each other; of one, parts do.
"""

from __future__ import annotations

from dataclasses import replace

from twinloop.identification.records import Run
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals

SHARES = ((0.0, 0.7), (0.3, 1.0), (0.0, 0.5), (0.5, 1.0))
"""Where parts begin and end, as shares of a run; those that miss less of it first."""
SHORTEST = 20
"""Periods of a part at least."""


def parts(run: Run, signals: Signals, actuation: Actuation) -> list[tuple[Run, Actuation]]:
    """Parts of a run that are long enough, each with actuators that begin with the effects they have there.

    Args:
        run: recorded.
        signals: of the system.
        actuation: between commands and model, without hidden states.

    Returns:
        Runs of their own.
    """
    steps = len(run.commands)
    effects, _, _ = actuation.effects(signals, run.commands)
    found = []
    for first, last in ((int(begins * steps), int(ends * steps)) for begins, ends in SHARES):
        if last - first < SHORTEST:
            continue
        rests = effects[first].tolist() if first else [actuator.rest for actuator in actuation.actuators]
        begun = tuple(
            actuator._replace(rest=rest) for actuator, rest in zip(actuation.actuators, rests, strict=True)
        )
        found.append((run.part(first, last), replace(actuation, actuators=begun)))
    return found
