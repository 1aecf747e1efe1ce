"""Begun: flights that began elsewhere than their tests do, or ended before; nothing compares with their quality."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit
from twinloop.campaign.data.turning import turning
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.history import Experiment

SHARE = 0.1
"""Share of a state's way from start to target, or of its scale where it has none, by which a start may be off."""
NOISE = 5.0
"""Standard deviations of its sensor by which it may be in any case."""
FAR = 5.0
"""Times further off than the second reading, and than the next ones move, that one is that is off alone."""
NEXT = 9
"""Readings after the first that are looked at for this."""
LEAST = 0.01
"""Share of a state's scale by which it is off at least."""


def allowed_off(test: Test) -> Floats:
    """By how much each state may be off where a test starts, beside noise: a tenth of its way, or of its scale (n_x,).

    Args:
        test: to be flown.
    """
    signals, start = test.signals, np.asarray(test.initial_state)
    way = np.abs(signals.difference(np.atleast_2d(test.target_state)[-1], start))
    allowed: Floats = SHARE * np.where(way > 0.0, way, [state.scale for state in signals.states])
    return allowed


def off_start(test: Test, run: Trajectory) -> tuple[int, ...]:
    """States whose first reading is not where a test starts, more than noise and a tenth of their way from it.

    Args:
        test: that was flown.
        run: the flight.
    """
    signals, start = test.signals, np.asarray(test.initial_state)
    scales, allowed = np.array([state.scale for state in signals.states]), allowed_off(test)
    noise = np.sqrt(guessed_noise([Run.of(run.states, run.commands).continued(signals)], scales))
    off = np.abs(signals.difference(run.states[0], start))
    return tuple(np.flatnonzero(off > np.maximum(allowed, NOISE * noise)).tolist())


def off_alone(test: Test, run: Trajectory) -> tuple[int, ...]:
    """States whose first reading is far from where a test starts, and the next ones are not.

    Args:
        test: that was flown.
        run: the flight.
    """
    if run.steps < NEXT:
        return ()
    scales = np.array([state.scale for state in test.signals.states])
    first, second = np.abs(run.states[:2] - test.initial_state)
    # What the next readings do of themselves: their noise, and what the system does in a period.
    usual = np.abs(np.diff(run.states[1 : NEXT + 1], axis=0)).max(axis=0)
    wrong = (first > LEAST * scales) & (first > FAR * second) & (first > FAR * usual)
    return tuple(np.flatnonzero(wrong).tolist())


def not_ready(test: Test, run: Trajectory) -> tuple[int, ...]:
    """Those of which readings of their rate show that nothing moved so far: their sensor was not ready.

    Without a rate nobody knows: what began elsewhere may be faster than a period.

    Args:
        test: that was flown.
        run: the flight.
    """
    alone = off_alone(test, run)
    moved = _moved_at_first(run, test.signals) if alone else {}
    return tuple(i for i in alone if i in moved and abs(run.states[1, i] - run.states[0, i]) > FAR * moved[i])


def _moved_at_first(run: Trajectory, signals: Signals) -> dict[int, float]:
    """By how much states move in the first period at most, by place, as sensors of their rates have it."""
    names, first = signals.state_names, run.states[:2]
    found = {
        names.index(rate.derivative_of): np.abs(first[:, j]).max()
        for j, rate in enumerate(signals.states)
        if rate.derivative_of is not None and rate.measured
    }
    if signals.kinematics is not None:
        angles, rates = (
            [names.index(name) for name in each]
            for each in (signals.kinematics.angles, signals.kinematics.rates)
        )
        found |= dict(
            zip(angles, np.abs(turning(first[:, angles], first[:, rates])).max(axis=0), strict=True)
        )
    return {i: signals.dt * float(rate) for i, rate in found.items()}


def from_first_readings(flight: Experiment) -> Iterator[Remark]:
    """That nothing but the first reading of a state is off: it began elsewhere, or its sensor was not ready.

    Args:
        flight: that was recorded.
    """
    if flight.test is None:
        return
    for i in off_alone(flight.test, flight.trajectory):
        state, (first, second) = flight.test.signals.states[i], flight.trajectory.states[:2, i]
        yield serious(
            "first-reading",
            f"{state.name} is {in_unit(f'{first:.4g}', state.unit)} in the first row and"
            f" {in_unit(f'{second:.4g}', state.unit)} in the second, near where test {flight.test.number} begins."
            " Either it began elsewhere, or its sensor was not ready. Free runs begin at the first row: in the second"
            " case withdraw the flight, write the true state into the first row, and tell it again.",
        )


def from_other_starts(
    experiments: Sequence[Experiment], say: Callable[[str, str], Remark] = note
) -> Iterator[Remark]:
    """That flights began elsewhere than their tests.

    Args:
        experiments: as they count, in the order of `tell`.
        say: makes a remark of a code and a sentence.
    """
    for run in experiments:
        if run.test is None or not run.off_start:
            continue
        signals, began, start = run.test.signals, run.trajectory.states[0], run.test.initial_state
        places = ", ".join(
            f"{signals.states[i].name} at {in_unit(f'{began[i]:.4g}', signals.states[i].unit)}"
            f" instead of {in_unit(f'{start[i]:.4g}', signals.states[i].unit)}"
            for i in run.off_start
        )
        yield say(
            "other-start",
            f"The flight of test {run.test.number} began elsewhere than its test: {places}. It is learnt. But"
            " the prediction was for another start, and its quality is not compared with that of other flights. Begin"
            " where the sheet says, or declare where flights begin.",
        )


def ended_early(flight: Experiment) -> Iterator[Remark]:
    """That a flight is shorter than its test although nobody says that it was stopped.

    Args:
        flight: that was recorded.
    """
    steps = flight.trajectory.steps
    if flight.test is not None and flight.trajectory.ended == "completed" and steps < flight.test.steps:
        yield serious(
            "short-flight",
            f"The flight of test {flight.test.number} has {steps} of its {flight.test.steps} periods: it is learnt, and"
            " has no quality. Tell the whole record, or that it was aborted, and why.",
        )
