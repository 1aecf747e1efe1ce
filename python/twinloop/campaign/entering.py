"""Entering: what a recorded run must be before a campaign learns from it, and the experiment that it makes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

from twinloop import _core
from twinloop._experiment.replay import Replay
from twinloop._ground.texts import in_unit, one_line, text
from twinloop.campaign.data.begun import not_ready
from twinloop.campaign.data.copies import copy_of, saved_again
from twinloop.campaign.history import Experiment, called
from twinloop.campaign.setup import Setup
from twinloop.errors import InvalidInput
from twinloop.law.accuracy import squares
from twinloop.objectives import frozen_error
from twinloop.signals import Signals
from twinloop.test import Test, final_distance
from twinloop.trajectory import Trajectory, check_recorded, completed, continued

Judge = Callable[[Experiment], float | None]
"""The error, on a run, of what is known so far; None where nothing is."""


def flown_test(setup: Setup, test: Test, trajectory: Trajectory, judge: Judge, least: int = 2) -> Experiment:
    """The experiment of a test that was flown.

    Args:
        setup: of the campaign.
        test: of the campaign.
        trajectory: what the system answered.
        judge: the error on it of what is known so far.
        least: steps that it must have.

    Raises:
        InvalidInput: a trajectory that cannot be learnt from.
    """
    trajectory = completed(trajectory, setup.signals, test.initial_state)
    check_recorded(trajectory, setup.limits, test.steps, least)
    recorded = continued(trajectory, setup.signals, test.initial_state)
    check_first_reading(recorded, test)
    distance = quality = None
    if recorded.ended == "completed" and recorded.steps == test.steps:
        distance = quality = final_distance(recorded.states[-1], test.target(test.steps), setup.signals)
        if setup.preset != "paper":
            quality = setup.quality.flown(recorded, test.target_state)
    run = Experiment(test, recorded, None, _frozen(recorded, setup), distance, quality)
    return dataclasses.replace(run, before=judge(run))


def attached_run(setup: Setup, trajectory: Trajectory, judge: Judge, log: str = "") -> Experiment:
    """The experiment of an attached run.

    Args:
        setup: of the campaign.
        trajectory: what was recorded, of any length.
        judge: the error on it of what is known so far.
        log: what it is called; empty where nobody has said so.

    Raises:
        InvalidInput: a trajectory that cannot be learnt from, or a name that is no text.
    """
    name = one_line(text("Campaign.attach, log", log))
    trajectory = completed(trajectory, setup.signals)
    check_recorded(trajectory, setup.limits, None)
    recorded = continued(trajectory, setup.signals, trajectory.states[0])
    replayed = Replay(setup.signals, recorded.states[0], recorded.commands)
    run = Experiment(replayed, recorded, None, _frozen(recorded, setup), None, None, attached=True, log=name)
    return dataclasses.replace(run, before=judge(run))


def refuse_copy(trajectory: Trajectory, experiments: Sequence[Experiment], signals: Signals) -> None:
    """Refuses to attach what is recorded already: learnt twice, one flight would be the evidence of two.

    Args:
        trajectory: to be attached.
        experiments: of the campaign.
        signals: of the system.

    Raises:
        InvalidInput: it is a flight of these, perhaps saved with fewer digits.
    """
    for run, name in zip(experiments, called(experiments), strict=True):
        if saved_again(trajectory, run.trajectory, signals):
            raise InvalidInput(
                f"Campaign.attach: expected a new flight, found {copy_of(name)}; nothing was changed. Attach another"
                " one."
            )


def renewed_run(run: Experiment, setup: Setup) -> Experiment:
    """A run that an earlier version has entered, with errors in the units of the states: their ratio stays.

    Args:
        run: as it was read.
        setup: of the campaign.
    """
    frozen = _frozen(run.trajectory, setup)
    before = run.before
    if before is not None and run.frozen > 0.0:
        before *= frozen / run.frozen
    return dataclasses.replace(run, before=before, frozen=frozen)


def partial_run(partial: Trajectory | None, reason: str) -> Trajectory | None:
    """What was recorded of a test that failed, as a run that was cut for a reason.

    Args:
        partial: what was recorded until then; None: nothing.
        reason: what happened.

    Raises:
        InvalidInput: no reason.
    """
    if not isinstance(reason, str) or not reason.strip():
        raise InvalidInput(
            f"Campaign.tell_failed, reason: expected what happened, in words, found {reason!r}; write it down."
        )
    text("Campaign.tell_failed, reason", reason)
    if isinstance(partial, Trajectory):
        ended = "diverged" if partial.ended == "diverged" else "aborted"
        return dataclasses.replace(partial, ended=ended, reason=reason)
    return partial


def replay_of_record(record: object, setup: Setup) -> Replay:
    """What a twin flies for the comparison with an attached run, from the record of the experiment.

    Args:
        record: of an experiment, from anywhere.
        setup: of the campaign.
    """
    found = record.get("trajectory") if isinstance(record, Mapping) else None
    trajectory = Trajectory.from_record(found)
    return Replay(setup.signals, trajectory.states[0], trajectory.commands)


def with_run(selected: _core.SelectedTests, replayed: Test | Replay, run: Trajectory) -> _core.SelectedTests:
    """The engine's tests with one more.

    Args:
        selected: those before.
        replayed: the test, or the commands as they were recorded.
        run: what the system answered.
    """
    if isinstance(replayed, Replay):
        return selected.with_record(run.states, run.commands)
    held = None if replayed.hold_back is None else replayed.hold_back.engine
    return selected.with_test(
        replayed.genes, replayed.target_state, run.states, run.commands, replayed.excitation, held
    )


def _frozen(recorded: Trajectory, setup: Setup) -> float:
    """Error of the model that never moves."""
    if not setup.in_scales:
        return frozen_error(recorded, setup.signals)
    return float(squares(recorded.states[1:], recorded.states[0], setup.signals).mean())


def check_first_reading(trajectory: Trajectory, test: Test) -> None:
    """Refuses a first reading that only a sensor that was not ready can have given: free runs begin there.

    Args:
        trajectory: what the system answered.
        test: that was flown.

    Raises:
        InvalidInput: a state that begins far off, with the next readings where they should be, and with readings of
            its rate that did not take it there.
    """
    for i in not_ready(test, trajectory):
        state = test.signals.states[i]
        raise InvalidInput(
            f"Campaign.tell: expected {state.name} to begin near {in_unit(f'{test.initial_state[i]:g}', state.unit)},"
            f" found {trajectory.states[0, i]:g} in the first row and {trajectory.states[1, i]:g} in the second; the"
            " sensor was not ready: write the true state into the first row, or run the test again."
        )
