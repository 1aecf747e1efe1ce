"""Withdrawing: which record of a flight counts no more, and what then counts no more of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from twinloop._ground.texts import text
from twinloop.campaign.data.excited import as_excited, excited, hidden
from twinloop.campaign.data.gains import flown_otherwise
from twinloop.campaign.data.rows import late_commands
from twinloop.campaign.history import Experiment, Failure, Withdrawal
from twinloop.errors import InvalidInput
from twinloop.test import Test
from twinloop.trajectory import equal_runs

if TYPE_CHECKING:
    from twinloop.campaign.logbook import Logbook

Place = tuple[int | None, int | None]
"""Of a run among all that were recorded and of a failure among all; None where there is none."""


def withdrawal_of(book: Logbook, which: object, reason: str, known: Sequence[int]) -> Withdrawal:
    """What is entered where a flight is withdrawn.

    Args:
        book: of the campaign, before.
        which: test, its number, an experiment or a failure.
        reason: what was wrong with it.
        known: of each test that was asked for, how many of the experiments it was planned from.

    Raises:
        InvalidInput: nothing of that kind counts, or no reason.
    """
    if not isinstance(reason, str) or not reason.strip():
        raise InvalidInput(
            f"Campaign.withdraw, reason: expected what was wrong, in words, found {reason!r}; such as"
            ' "columns exchanged".'
        )
    text("Campaign.withdraw, reason", reason)
    run, failure = _place(book, which)
    if run is None:
        assert failure is not None
        test: int | None = book.reported[failure].test.number
        aware = [entry.test > book.reported[failure].test.number for _, entry in book.asked]
        left = list(known)
    else:
        test, before = book.recorded[run].number, _counting(book)[0].index(run)
        aware = [before < count for count in known]
        left = [count - (before < count) for count in known]
    planned = [entry.test for (_, entry), knew in zip(book.asked, aware, strict=True) if knew]
    return Withdrawal(reason, test, run, failure, len(book.recorded), tuple(left), tuple(planned))


def as_it_counts(run: Experiment, place: int, book: Logbook) -> Experiment:
    """A run as it was flown, without what was predicted of it by a twin that had learnt a withdrawn flight.

    Args:
        run: as it was recorded.
        place: among all that were.
        book: of the campaign. The preset "paper" learns from tests of its controllers only, as they were asked for.
    """
    test, setup, withdrawals = run.test, book.setup, book.withdrawals
    # In other rows than those of their readings commands tell neither gains nor an excitation.
    late = test is not None and any(late_commands(test, run.trajectory))
    if test is not None and not late and setup.preset != "paper":
        others = book.tests[: _made_by(run, place, book)]
        otherwise = flown_otherwise(test, run.trajectory, setup.controller, others)
        if otherwise is not None:
            return replace(run, replayed=otherwise, before=None, final_distance=None, quality=None)
    if test is not None:
        flown = test if late else as_excited(test, excited(test, run.trajectory))
        as_asked = flown is test or hidden(test, run.trajectory)
        # Of what was not asked for nothing was predicted.
        if not as_asked or any(test.number in each.planned for each in withdrawals):
            flown = replace(flown, predicted=None, spread=None, risk=None)
        run = run if flown is test else replace(run, replayed=flown)
    if any(
        each.planned and each.run is not None and each.run < place < each.recorded for each in withdrawals
    ):
        run = replace(run, before=None)
    return run


def _made_by(run: Experiment, place: int, book: Logbook) -> int:
    """How many tests surely had been made when a run was told: what it counts for must not change with later ones.

    They are those up to the last that had been told, or asked for. A test is asked for after as many runs as counted
    then, beside those that had been withdrawn.
    """
    told = [each.number for each in [*book.recorded[:place], run] if each.number is not None]
    withdrawn = [len(each.known) for each in book.withdrawals if each.run is not None]
    asked = [
        entry.test
        for turn, (counting, entry) in enumerate(book.asked)
        if counting + sum(turns <= turn for turns in withdrawn) <= place
    ]
    return 1 + max(told + asked)


def check_withdrawals(book: Logbook, where: str) -> None:
    """Refuses entries of flights that there are not, or that were withdrawn before.

    Args:
        book: of the campaign.
        where: how to call them in an error.

    Raises:
        InvalidInput: such an entry.
    """
    for key, there in (("run", len(book.recorded)), ("failure", len(book.reported))):
        places = [place for each in book.withdrawals if (place := getattr(each, key)) is not None]
        if len(set(places)) < len(places) or not all(0 <= place < there for place in places):
            raise InvalidInput(
                f"Record {where}: expected each {key} once, by a place from 0 to {there - 1}, found {places}."
            )
    for each in book.withdrawals:
        if (each.run is None and each.failure is None) or len(each.known) > len(book.asked):
            raise InvalidInput(f"Record {where}: expected a run or a failure of this campaign, found none.")


def _counting(book: Logbook) -> tuple[list[int], list[int]]:
    """Places of the runs and of the failures that count."""
    runs, failures = {each.run for each in book.withdrawals}, {each.failure for each in book.withdrawals}
    return (
        [place for place in range(len(book.recorded)) if place not in runs],
        [place for place in range(len(book.reported)) if place not in failures],
    )


def _place(book: Logbook, which: object) -> Place:
    if isinstance(which, Experiment):
        return _of_experiment(book, which)
    if isinstance(which, Failure):
        return _of_failure(book, which)
    if isinstance(which, Test):
        return _of_test(book, book.own(which).number)
    if isinstance(which, int) and not isinstance(which, bool):
        return _of_test(book, which)
    raise InvalidInput(
        "Campaign.withdraw: expected a test, its number, or one of campaign.experiments or campaign.failures, found"
        f" {type(which).__name__}."
    )


def _of_test(book: Logbook, number: int) -> Place:
    """The run of a test that was told last, with the failure whose record it is; the last failure if there is no run.

    The book has no order of both. `tell --failed` refuses a test with a flight: there a failure comes first.
    """
    runs, failures = _counting(book)
    told = [place for place in runs if book.recorded[place].number == number]
    failed = [place for place in failures if book.reported[place].test.number == number]
    if failed and not told:
        return _of_failure(book, book.reported[failed[-1]])
    if not told:
        told_of = sorted(book.flown)
        of = f"one of {', '.join(map(str, told_of))}" if told_of else "a flight that was told"
        raise InvalidInput(
            f"Campaign.withdraw: expected the number of a test with a recorded flight, {of}, found {number};"
            " there is nothing to withdraw."
        )
    return told[-1], _failure_of(book, book.recorded[told[-1]])


def _of_failure(book: Logbook, failure: Failure) -> Place:
    runs, failures = _counting(book)
    places = [place for place in failures if book.reported[place] is failure]
    if not places:
        raise InvalidInput(
            "Campaign.withdraw: expected one of campaign.failures, found another failure, or a withdrawn one."
        )
    if not failure.recorded:
        return None, places[0]
    parts = [place for place in runs if is_record_of(book.recorded[place], failure)]
    return (parts[-1] if parts else None), places[0]


def _of_experiment(book: Logbook, run: Experiment) -> Place:
    runs, _ = _counting(book)
    counted = list(zip(runs, book.experiments, strict=True))
    itself = [place for place, each in counted if each is run]
    places = itself or [
        place
        for place, each in counted
        if each.number == run.number and equal_runs(each.trajectory, run.trajectory)
    ]
    if not places:
        raise InvalidInput(
            "Campaign.withdraw: expected one of campaign.experiments, found another one, or a withdrawn one."
        )
    return places[0], _failure_of(book, run)


def _failure_of(book: Logbook, run: Experiment) -> int | None:
    """The failure whose record a run is; None: it is that of none."""
    of = [place for place in _counting(book)[1] if is_record_of(run, book.reported[place])]
    return of[-1] if of else None


def is_record_of(run: Experiment, failure: Failure) -> bool:
    """Whether a run is what was recorded until a test failed.

    Args:
        run: of a campaign.
        failure: of the same.
    """
    same = run.number == failure.test.number and run.trajectory.reason == failure.reason
    return failure.recorded and same
