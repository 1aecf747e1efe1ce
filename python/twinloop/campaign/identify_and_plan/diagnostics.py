"""What speaks against the data or the twin as a whole: units, signs, records told twice, runs that were cut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals

MOVED = 20.0
"""Standard deviations of its noise that a state must have moved before it is held against its derivative."""
AS_FAST = (0.5, 2.0)
"""Times as fast as its derivative says, between which a state is taken to do what was declared."""
ALIKE = 0.5
"""Correlation with its integrated derivative below which a state is taken to do something else."""


def doubts(experiments: Sequence[Experiment], signals: Signals, follows: bool, steps: int) -> list[Remark]:
    """What speaks against the data or the twin.

    Args:
        experiments: that were learnt from.
        signals: of the system.
        follows: whether the twin follows them when it is flown by itself.
        steps: of a whole run.

    Returns:
        Remarks, none where nothing does.
    """
    said = list(_against_derivatives(experiments, signals))
    if not follows:
        said.append(
            serious(
                "does-not-follow",
                "Flown by itself the twin does not follow the runs that it was learnt from: check the signs, units and"
                " order of states and commands, and that the recorded controller is the one that the test names.",
            )
        )
    copies = len(experiments) - len(distinct(experiments))
    if copies:
        said.append(
            note(
                "copies",
                f"{copies} of {len(experiments)} records equal an earlier one to the last bit: they were learnt from"
                " once.",
            )
        )
    if not any(run.complete for run in experiments):
        longest = max(run.trajectory.steps for run in experiments)
        said.append(
            serious(
                "none-complete",
                f"No run was complete, the longest had {longest} of {steps} steps: what comes after them nobody has"
                " seen.",
            )
        )
    return said


def _against_derivatives(experiments: Sequence[Experiment], signals: Signals) -> Iterator[Remark]:
    """States that do not change as their declared derivatives say."""
    runs = [Run.of(run.trajectory.states, run.trajectory.commands) for run in experiments]
    noise = guessed_noise(runs, np.array([state.scale for state in signals.states]))
    for i, rate in enumerate(signals.states):
        if rate.derivative_of is None:
            continue
        j = signals.state_names.index(rate.derivative_of)
        pairs = [_moved(run.states[:, j], run.states[:, i], signals.dt) for run in runs]
        moved, said = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        size, told, both = (
            float(values.sum()) for values in (np.square(moved), np.square(said), moved * said)
        )
        if size <= len(moved) * MOVED * MOVED * noise[j] or told == 0.0:
            continue
        how = ""
        if both * both < ALIKE * ALIKE * size * told:
            how = "does not change as"
        elif not AS_FAST[0] * told < both < AS_FAST[1] * told:
            how = f"changes {both / told:.3g} times as fast as"
        if how:
            yield serious(
                "derivative",
                f"{rate.derivative_of} {how} {rate.name}, its declared derivative, says: check their units and signs,"
                " the order of the columns, and what is declared.",
            )


def _moved(state: Floats, rate: Floats, dt: float) -> tuple[Floats, Floats]:
    """A state over a run, and the same by its derivative, each less its mean."""
    said = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
    return state - state.mean(), said - said.mean()
