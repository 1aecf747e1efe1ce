"""Outputs alone: states that go on moving as they moved, whose rates nobody has declared.

In its changes x[k + 1] − x[k] a mass shows its momentum: the change before foretells the next one far better than
states and commands do. Of what has none, a tank or a heater, these say it all. Where noise hides the change over a
period, longer ones show it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.actuation import Actuation
from twinloop.remarks import Remark, note
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

FORETELLS = 10.0
"""Times that changes are off more, mean squares, where the change before is not known."""
LONG = 5.0
"""Periods beyond which a lag may stand for the rate of a mass."""
MOVES = 0.05
"""Share of changes, mean squares, that states and commands leave unexplained at least where something has momentum."""
FEWEST = 20
"""Changes of all runs at least."""
STRIDES = (1, 4, 16)
"""Periods over which changes are taken."""


def outputs_alone(
    actuation: Actuation, runs: Sequence[Trajectory], signals: Signals, explained: bool
) -> Iterator[Remark]:
    """Which states go on moving without a declared rate, where something may stand for it, or no law explains them.

    Args:
        actuation: of the law.
        runs: that it was learnt from.
        signals: of the system.
        explained: whether the law explains the flights.
    """
    # What commands fill may stand for a rate, too, and so may a long lag of theirs.
    by_commands = any(not hidden.states for hidden in actuation.hidden) or any(
        actuator.lag > LONG * signals.dt for actuator in actuation.actuators
    )
    stands_in = {state for hidden in actuation.stored for state in hidden.states}
    going = [
        signals.state_names[i]
        for i in signals.without_rates
        if (not explained or by_commands or i in stands_in) and momentum(runs, i, signals) > FORETELLS
    ]
    if going:
        yield note(
            "outputs-alone",
            f"The motion of {', '.join(going)} goes on as in the period before, and no rate of it is declared:"
            " something hidden or a lag may stand for that. Log the rate, or declare lags=1 in the signals, which makes"
            " it of past readings.",
        )


def momentum(runs: Sequence[Trajectory], state: int, signals: Signals) -> float:
    """Times that changes of a state are off more where the one before is not known, mean squares; 1: it says nothing.

    Args:
        runs: as recorded.
        state: its place.
        signals: of the system.
    """
    return max(_momentum(runs, state, signals, stride) for stride in STRIDES)


def _momentum(runs: Sequence[Trajectory], state: int, signals: Signals, stride: int) -> float:
    """The same of changes over so many periods."""
    wanted, known, before = [], [], []
    for run in runs:
        count = run.steps // stride
        if count < 2:
            continue
        states = signals.continued(run.states, run.states[0])[: count * stride + 1 : stride]
        sent = run.commands[: count * stride].reshape(count, stride, -1).mean(axis=1)
        changes = np.diff(states[:, state])
        wanted.append(changes[1:])
        before.append(changes[:-1])
        known.append(np.column_stack([states[1:-1], sent[1:], sent[:-1]]))
    if sum(map(len, wanted)) < FEWEST:
        return 1.0
    columns, whole = [*np.concatenate(known).T], np.concatenate(wanted)
    change, last = _left([whole, np.concatenate(before)], columns)
    (rest,) = _left([change], [last])
    unexplained, least = float(np.square(change).sum()), float(np.square(rest).sum())
    if least <= 0.0 or unexplained < MOVES * float(np.square(whole - whole.mean()).sum()):
        return 1.0
    return unexplained / least


def _left(wanted: Sequence[Floats], columns: Sequence[Floats]) -> list[Floats]:
    """What no sum of a constant and columns explains (Gram and Schmidt)."""
    left, basis = (
        [values - values.mean() for values in wanted],
        [column - column.mean() for column in columns],
    )
    for place, column in enumerate(basis):
        size = float(np.square(column).sum())
        if size <= 1e-12 * float(np.square(columns[place]).sum()):
            continue
        left = [values - column * (float((column * values).sum()) / size) for values in left]
        basis[place + 1 :] = [
            other - column * (float((column * other).sum()) / size) for other in basis[place + 1 :]
        ]
    return left
