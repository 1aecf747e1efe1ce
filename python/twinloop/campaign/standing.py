"""Standing: where tests are in their lives, and how those that were flown have fared."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.data.gains import FlownOtherwise
from twinloop.campaign.history import Experiment, Iteration, Lesson
from twinloop.campaign.logbook import Logbook
from twinloop.planning.proposal import Fared
from twinloop.test import Test

HELD = 0.5
"""Share of the way to the envelope by which states may go on after an excitation was held back to nothing."""

Turn = TypeVar("Turn", Lesson, Iteration)


def status(book: Logbook, test: object) -> str:
    """Where a test is in its life: "asked", "flown", "aborted", "failed" or "abandoned".

    Args:
        book: of the campaign.
        test: of the campaign.

    Raises:
        InvalidInput: a test of another campaign.
    """
    number = book.own(test).number
    runs = [run for run in book.experiments if run.number == number]
    if failed(book, number):
        return "failed"
    if runs:
        return "flown" if any(run.complete for run in runs) else "aborted"
    return "abandoned" if number in book.abandoned else "asked"


def complete(book: Logbook, test: int) -> list[Experiment]:
    """Complete runs of a test; those that began elsewhere than the test only where all did.

    Args:
        book: of the campaign.
        test: its number.
    """
    runs = [run for run in _runs(book, test) if run.quality is not None]
    return [run for run in runs if not run.off_start] or runs


def measured(book: Logbook, test: int) -> float | None:
    """Quality of a test on the system, mean over complete runs; None if there was none.

    Runs that began elsewhere than the test count only where all did.

    Args:
        book: of the campaign.
        test: its number.
    """
    values = [run.quality for run in complete(book, test) if run.quality is not None]
    return math.fsum(values) / len(values) if values else None


def measured_on_task(book: Logbook, test: Test) -> float | None:
    """Quality of a test of the campaign's own task on the system, as by `measured`; None of another task.

    Args:
        book: of the campaign.
        test: of it.
    """
    return measured(book, test.number) if on_task(book, test) else None


def best_flown(book: Logbook) -> Test | None:
    """The flown test of the best quality; the first one if no run was complete, None if no test was flown.

    Tests that are not known to fly, of which the paper knows nothing, come after all others; then those that began or
    led elsewhere than the campaign's own task, whose quality says nothing of it.

    Args:
        book: of the campaign.
    """

    def rank(test: Test) -> tuple[bool, bool, bool, float]:
        quality = measured(book, test.number)
        if quality is None:
            return True, True, True, math.inf
        unfit = book.setup.preset != "paper" and not flies(book, test.number)
        return False, unfit, not on_task(book, test), quality

    return min((run.test for run in book.experiments if run.test is not None), key=rank, default=None)


def first_flown(book: Logbook) -> Test | None:
    """The first test that was flown; None where none was.

    Args:
        book: of the campaign.
    """
    return next((run.test for run in book.experiments if run.test is not None), None)


def trusted(book: Logbook) -> Test | None:
    """The first test that is known to fly, whose gains a person can go back to; None where none is.

    Args:
        book: of the campaign.
    """
    flown = (run.test for run in book.experiments if run.test is not None)
    return next((test for test in flown if flies(book, test.number)), None)


def flies(book: Logbook, test: int) -> bool:
    """Whether a test is known to fly: each of its runs went to its end inside the envelope.

    Args:
        book: of the campaign.
        test: its number.
    """
    runs = _runs(book, test)
    return bool(runs) and all(run.kept_envelope for run in runs) and not failed(book, test)


def finishes(book: Logbook, test: int) -> bool:
    """Whether each run of a test went to its end, inside the envelope or not.

    Args:
        book: of the campaign.
        test: its number.
    """
    runs = _runs(book, test)
    return bool(runs) and all(run.complete for run in runs) and not failed(book, test)


def was_lost(run: Experiment) -> bool:
    """Whether a flight left its envelope or diverged.

    Args:
        run: that was recorded.
    """
    return run.left_envelope or run.trajectory.ended == "diverged"


def failed(book: Logbook, test: int) -> bool:
    """Whether a test has failed on the system.

    Args:
        book: of the campaign.
        test: its number.
    """
    return any(failure.test.number == test for failure in book.failures)


def unfit(book: Logbook) -> list[Floats]:
    """Genes of tests that failed on the system, or were cut; those that were flown, where they were others.

    Args:
        book: of the campaign.
    """
    flown = [number for number in sorted(book.flown) if _has_result(book, number)]
    asked = [book.tests[number].genes for number in flown if not finishes(book, number)]
    others = [
        run.replayed.genes
        for run in book.experiments
        if isinstance(run.replayed, FlownOtherwise) and not run.complete
    ]
    return asked + others


def borne(book: Logbook) -> int:
    """How many of the last tests in a row that were held back are known to fly: each bore a stronger excitation.

    One that was flown without its excitation shows nothing of it. None counts whose states went on by half of the way
    to the envelope or more once the excitation was nothing: holding back has not held it, and would not hold a stronger
    one.

    Args:
        book: of the campaign.
    """
    count, signals = 0, book.setup.signals
    for test in reversed(book.tests):
        if test.hold_back is None or not _has_result(book, test.number):
            continue
        runs = _runs(book, test.number)
        excited = any(run.test is not None and run.test.excitation is not None for run in runs)
        if test.excitation is not None and runs and not excited:
            continue
        went_on = max((test.hold_back.overrun(signals, run.trajectory.states) for run in runs), default=0.0)
        if not flies(book, test.number) or went_on >= HELD:
            break
        count += 1
    return count


def reached(book: Logbook, genes: Floats) -> Floats | None:
    """Smallest and largest value of each state (2, n_x) that all flights of some gains that kept the envelope reached.

    What only one of them has reached was its excitation or a gust, and not the controller. None where there are none.

    Args:
        book: of the campaign.
        genes: of them (size,).
    """
    kept = [
        run
        for run in book.experiments
        if run.test is not None and run.kept_envelope and run.test.genes.tobytes() == genes.tobytes()
    ]
    if not kept:
        return None
    each = np.stack([read_in(book, [run]) for run in kept])
    return np.stack([each[:, 0].max(axis=0), each[:, 1].min(axis=0)])


def read_in(book: Logbook, flights: Sequence[Experiment]) -> Floats:
    """Smallest and largest reading of each state (2, n_x), of angles that are continued through whole turns.

    Args:
        book: of the campaign.
        flights: of it, at least one.
    """
    signals, start = book.setup.signals, book.setup.initial_state
    states = np.concatenate([signals.continued(run.trajectory.states, start=start) for run in flights])
    return np.stack([states.min(axis=0), states.max(axis=0)])


def fared(book: Logbook, genes: Floats, excited: bool) -> Fared:
    """How some gains have fared so far, in tests with or without an excitation.

    Args:
        book: of the campaign.
        genes: of them (size,).
        excited: whether they are to fly with an excitation. Without one, only flights without one count if there were
            any.
    """
    flown = [
        (run.test, run.kept_envelope and not failed(book, run.test.number))
        for run in book.experiments
        if run.test is not None
    ]
    flown += [(failure.test, False) for failure in book.failures if not failure.recorded]
    same = [
        (test.excitation is None, kept) for test, kept in flown if test.genes.tobytes() == genes.tobytes()
    ]
    quiet = [(is_quiet, kept) for is_quiet, kept in same if is_quiet]
    counted = quiet if quiet and not excited else same
    return Fared(len(counted), sum(not kept for _, kept in counted))


def times_flown(book: Logbook, genes: Floats) -> int:
    """How often some gains have flown, with any excitation.

    Args:
        book: of the campaign.
        genes: of them (size,).
    """
    tests = (run.test for run in book.experiments if run.test is not None)
    return sum(test.genes.tobytes() == genes.tobytes() for test in tests)


def on_task(book: Logbook, test: Test) -> bool:
    """Whether a test begins and leads where the campaign does, and so did a flight of it, if it was flown.

    Args:
        book: of the campaign.
        test: of the campaign.
    """
    runs = _runs(book, test.number)
    if runs and all(run.off_start for run in runs):
        return False
    ends = (test.initial_state, book.setup.initial_state), (test.target_state, book.setup.target_state)
    return all(np.array_equal(*pair) for pair in ends)


def with_asked(book: Logbook, turns: Sequence[Turn]) -> tuple[Turn, ...]:
    """Turns of the loop with the tests that were asked for after each, and the quality that these have flown.

    Args:
        book: of the campaign.
        turns: in order.
    """
    return tuple(replace(turn, asked=_asked_after(book, turn)) for turn in turns)


def known_when_asked(book: Logbook, learnt: Callable[[int], int]) -> list[int]:
    """Of each test that was asked for, how many of the experiments that count it was planned from.

    Args:
        book: of the campaign.
        learnt: number of experiments that a turn of the loop has learnt, by its number.
    """
    known = list(book.withdrawals[-1].known) if book.withdrawals else []
    return known + [learnt(iteration) for iteration, _ in book.asked[len(known) :]]


def _asked_after(book: Logbook, turn: Turn) -> tuple[Any, ...]:
    """Of the kind that the preset asks for: a campaign has no other.

    A withdrawal has renumbered the turns of before: there the number of learnt experiments tells. What was planned
    with a withdrawn flight is of no turn that is left.
    """
    known = book.withdrawals[-1].known if book.withdrawals else ()
    gone = {number for each in book.withdrawals for number in each.planned}
    after = [
        turn.iteration > 0 and known[i] == len(turn.tests) if i < len(known) else turn.iteration == iteration
        for i, (iteration, _) in enumerate(book.asked)
    ]
    return tuple(
        replace(asked, flown=measured(book, asked.test))
        for (_, asked), is_after in zip(book.asked, after, strict=True)
        if is_after and asked.test not in gone
    )


def _has_result(book: Logbook, test: int) -> bool:
    """Whether anything was told of the gains of a test."""
    return bool(_runs(book, test)) or failed(book, test)


def _runs(book: Logbook, test: int) -> list[Experiment]:
    """Runs of a test under its own gains."""
    return [run for run in book.experiments if run.test is not None and run.test.number == test]
