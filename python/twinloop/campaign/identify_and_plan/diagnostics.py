"""What speaks against the data or the twin as a whole: units, signs, records told twice, runs that were cut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.readings import suspicious
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory

MOVED = 20.0
"""Standard deviations of its noise that a state must have moved before it is held against its derivative."""
AS_FAST = (0.5, 2.0)
"""Times as fast as its derivative says, between which a state is taken to do what was declared."""
ALIKE = 0.5
"""Correlation with its integrated derivative below which a state is taken to do something else."""

OTHER = 0.5
"""Share of what commands do that may differ from what their controller gives, squared."""
LITTLE = 0.02
"""Share of their bounds by which commands may differ whatever they do."""
LEVELS = 5
"""Values that commands have at most that are sent in pulses."""
PULSES = 2.0
"""Times the span of a command that pulses may be behind or ahead of it."""


def diagnostics_of(
    experiments: Sequence[Experiment],
    signals: Signals,
    follows: bool,
    steps: int,
    missed: Sequence[float] = (),
    others: Sequence[int] = (),
    recurring: Sequence[str] = (),
    unmoved: Sequence[str] = (),
) -> list[Remark]:
    """What speaks against the data or the twin.

    Args:
        experiments: that were learnt from.
        signals: of the system.
        follows: whether the twin follows them when it is flown by itself.
        steps: of a whole run.
        missed: times further from each run than noise and disturbances explain that the free run is; 0 where they do.
        others: numbers of the tests whose recorded commands are none that their controllers give.
        recurring: states whose disturbance comes again in flight after flight.
        unmoved: states that move though their equations say that nothing moves them.

    Returns:
        Remarks, none where nothing does.
    """
    recorded = [run.trajectory for run in experiments]
    said = [*against_derivatives(recorded, signals), *suspicious(recorded, signals)]
    if others:
        said.append(
            serious(
                "other-commands",
                f"The commands recorded of test{'s' if len(others) > 1 else ''} {', '.join(map(str, others))} are"
                " none that its controller gives for the recorded states: check the signs, units and order of states"
                " and commands, and that the recorded controller is the one that the test names.",
            )
        )
    if unmoved:
        said.append(
            serious(
                "unmoved",
                f"By the law nothing moves {', '.join(unmoved)}, but the flights show motion that the controller"
                " answers to: what commands do there is lost in what disturbs. Gains for it cannot be tuned yet.",
            )
        )
    if not follows:
        cause = (
            "the remarks before this one say why"
            if any(remark.serious for remark in said)
            else "something acts that no term describes, such as a contact, play, friction that sticks, or a state that"
            " nobody reads; the records themselves show no wrong sign or unit"
        )
        said.append(
            serious(
                "does-not-follow",
                f"Flown by itself the twin does not follow the runs that it was learnt from: {cause}.",
            )
        )
    elif any(missed):
        worst = max(missed)
        how = (
            f"by {worst:.3g} times what noise and disturbances explain"
            if np.isfinite(worst)
            else "until it diverges"
        )
        said.append(
            serious(
                "free-run",
                f"Flown by itself the twin misses {sum(map(bool, missed))} of the {len(missed)} runs that it was"
                f" learnt from, {how}: something acts that no term describes. Do not believe it beyond the"
                " flights that were made.",
            )
        )
    if recurring:
        said.append(
            note(
                "model-error",
                f"What disturbs {', '.join(recurring)} comes again at the same times in flight after flight. So it is"
                " an error of the law, and no disturbance: a term is missing there.",
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
        sent, given = run.trajectory.commands, _given(run.test, run.trajectory.states)
        span = _span(run.test)
        size = np.square((given - given.mean(axis=0)) / span).mean()
        off = np.square((sent - given) / span).mean()
        if off > OTHER * size and off > LITTLE * LITTLE:
            found[run.test.number] = _pulses(sent, given, span)
    return found


def _pulses(sent: Floats, given: Floats, span: Floats) -> bool:
    """Whether few levels were sent, and until any time as much as the controller gives, up to a pulse or two."""
    if any(len(np.unique(command)) > LEVELS for command in sent.T):
        return False
    return bool((np.abs(np.cumsum(sent - given, axis=0)) <= PULSES * span).all())


def _given(test: Test, states: Floats) -> Floats:
    """What a test's controller gives on some readings, without an excitation (n, n_u)."""
    controller = test.controller()
    controller.reset()
    return np.array([controller.command(state, test.target(k)) for k, state in enumerate(states[:-1])])


def _span(test: Test) -> Floats:
    """From the smallest to the largest value of each command (n_u,)."""
    low, high = np.array([command.bounds for command in test.family.signals.commands]).T
    return np.asarray(high - low)


def against_derivatives(recorded: Sequence[Trajectory], signals: Signals) -> Iterator[Remark]:
    """States that do not change as their declared derivatives say.

    Args:
        recorded: runs, periodic states among them as they were wrapped.
        signals: of the system.
    """
    runs = [Run.of(run.states, run.commands) for run in recorded]
    noise = guessed_noise(runs, np.array([state.scale for state in signals.states]))
    for i, rate in enumerate(signals.states):
        if rate.derivative_of is None:
            continue
        j = signals.state_names.index(rate.derivative_of)
        pairs = [_moved(run.states[:, j], run.states[:, i], signals.dt) for run in runs]
        moved, declared = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        size, declared_size, product = (
            float(values.sum()) for values in (np.square(moved), np.square(declared), moved * declared)
        )
        if size <= len(moved) * MOVED * MOVED * noise[j] or declared_size == 0.0:
            continue
        how = ""
        if product * product < ALIKE * ALIKE * size * declared_size:
            how = "does not change as"
        elif not AS_FAST[0] * declared_size < product < AS_FAST[1] * declared_size:
            how = f"changes {product / declared_size:.3g} times as fast as"
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
