"""Telling a campaign what was flown: the test by its number, and the log that was recorded of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from twinloop._ground.texts import whole_characters
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import learnt
from twinloop.campaign.data.copies import copied, copy_of, saved_again
from twinloop.campaign.examination.log_check import against
from twinloop.campaign.history import Experiment
from twinloop.campaign.history import called as names_of
from twinloop.campaign.withdrawing import is_record_of
from twinloop.errors import InvalidInput
from twinloop.faces.answering import next_command
from twinloop.logs import Log, read_log
from twinloop.test import Test
from twinloop.trajectory import Trajectory, check_period, recorded_as, row_in


def numbered(campaign: Campaign, number: int) -> Test:
    """A test of a campaign.

    Args:
        campaign: that it was made in.
        number: of the test.

    Raises:
        InvalidInput: no such test.
    """
    if not 0 <= number < len(campaign.tests):
        raise InvalidInput(
            f"Test: expected {_numbers(len(campaign.tests))}, found {number}; ask for one first."
        )
    return campaign.tests[number]


def _numbers(made: int) -> str:
    """Which numbers tests have, in words."""
    if made < 2:
        return "0, the only test so far" if made else "one that was made"
    return f"a number from 0 to {made - 1}"


def counted(campaign: Campaign) -> str:
    """How many experiments it has, in words.

    Args:
        campaign: of them.
    """
    return _experiments(len(campaign.experiments))


def unlearnt(campaign: Campaign) -> str:
    """How many experiments are not learnt yet, in words; empty where all are.

    Args:
        campaign: to look at.
    """
    missing = len(campaign.experiments) - learnt(campaign)
    return f"Not learnt yet: {_experiments(missing)}" if missing > 0 else ""


def _experiments(count: int) -> str:
    return f"{count} experiment{'' if count == 1 else 's'}"


def tell(
    campaign: Campaign,
    number: int,
    log: Path,
    *,
    aborted: str = "",
    name: str | None = None,
    otherwise: str = "say why it was stopped",
    columns: Mapping[str, str] | None = None,
) -> tuple[Test, Log]:
    """Tells the flight of a test.

    Args:
        campaign: that the test was made in.
        number: of the test.
        log: CSV or .npz.
        aborted: why the test was stopped before its end; empty where it was not.
        name: what messages call the log; None: its path.
        otherwise: what to do with a log that ends early, if it cannot be had whole.
        columns: what its columns are called, where not as the signals are.

    Returns:
        The test, and the log as it was read.

    Raises:
        InvalidInput: no such test, or a log that cannot be used, that was told before, or that ends early without a
            reason.
        StoreFailure: the store cannot be written.
    """
    test = numbered(campaign, number)
    called = str(log) if name is None else name
    ended = "aborted" if aborted else "completed"
    found = read_log(log, campaign.signals, called, columns)
    run = found.trajectory(ended, aborted)
    if not aborted and run.steps < test.steps:
        if run.steps:
            # Rows that are missing within it are no flight that was stopped.
            with found.errors():
                check_period(run, campaign.signals)
        raise InvalidInput(
            f"Log {called}: expected the {test.steps} steps of test {number}, found {run.steps}; record it whole, or"
            f" {otherwise}."
        )
    _refuse_told(campaign, run, called, test)
    with found.errors():
        campaign.tell(test, run)
    return test, found


def attach(
    campaign: Campaign, log: Path, *, name: str | None = None, columns: Mapping[str, str] | None = None
) -> Log:
    """Attaches a flight without a test.

    Args:
        campaign: that is to learn it.
        log: CSV or .npz.
        name: what messages call the log; None: its path.
        columns: what its columns are called, where not as the signals are.

    Returns:
        The log as it was read.

    Raises:
        InvalidInput: a log that cannot be used, or that is there already.
        StoreFailure: the store cannot be written.
    """
    called = str(log) if name is None else name
    found = read_log(log, campaign.signals, called, columns)
    run = found.trajectory()
    _refuse_told(campaign, run, called, None)
    with found.errors():
        campaign.attach(run, whole_characters(Path(called).name))
    return found


def tell_failed(
    campaign: Campaign,
    number: int,
    reason: str,
    log: Path | None = None,
    columns: Mapping[str, str] | None = None,
) -> tuple[Test, Log | None]:
    """Tells that a test failed.

    Args:
        campaign: that the test was made in.
        number: of the test.
        reason: in a few words.
        log: CSV or .npz with what was recorded; None: nothing.
        columns: what its columns are called, where not as the signals are.

    Returns:
        The test, and the log as it was read.

    Raises:
        InvalidInput: no such test, one with a recorded flight, no reason, the same failure once more, or a log that
            cannot be used.
        StoreFailure: the store cannot be written.
    """
    test = numbered(campaign, number)
    flights = [
        run
        for run in campaign.experiments
        if run.number == number and not any(is_record_of(run, each) for each in campaign.failures)
    ]
    if flights:
        status = "flown" if any(run.complete for run in flights) else "aborted"
        withdraw = next_command(campaign, "withdraw", number, "--reason", "WHY")
        raise InvalidInput(
            f"Test {number}: expected one without a recorded flight, found one that was {status}; if that was recorded"
            f" by mistake, withdraw it first: {withdraw}."
        )
    if log is None and any((told.test.number, told.reason) == (number, reason) for told in campaign.failures):
        raise InvalidInput(
            f"Test {number}: expected a failure that is not recorded yet, found {reason!r} recorded already; if it was"
            " flown again and failed again, say so in other words."
        )
    if log is None:
        campaign.tell_failed(test, reason)
        return test, None
    found = read_log(log, campaign.signals, None, columns)
    run = found.trajectory("aborted", reason)
    with found.errors():
        campaign.tell_failed(test, reason, run)
    return test, found


def to_be_flown(campaign: Campaign) -> list[Test]:
    """Tests without a run that nobody has given up: asked for, made by hand, or with a run that was withdrawn.

    Args:
        campaign: of them.
    """
    return [test for test in campaign.tests if campaign.status(test) == "asked"]


def awaited(campaign: Campaign) -> list[Test]:
    """Those of the tests to be flown of which a flight is awaited.

    Of somebody's own ones these are the first test, as long as none was flown, and a test whose run was withdrawn;
    another one may have been made only to see what the twin predicts.

    Args:
        campaign: of them.
    """
    begun = any(not run.attached for run in campaign.experiments)
    wanted = {test.number for test in campaign.waiting} | {each.test for each in campaign.withdrawals}
    return [test for test in to_be_flown(campaign) if not begun or test.number in wanted]


def is_chosen(campaign: Campaign, test: Test) -> bool:
    """Whether the campaign chose a test, by `ask`; otherwise it is a person's own.

    Args:
        campaign: of it.
        test: of the campaign.
    """
    return any(test.number == asked.number for asked in campaign.asked)


def against_it(campaign: Campaign, flight: Experiment, test: Test | None, read: Log | None) -> list[str]:
    """What speaks against a flight that was told or attached: said at once, while somebody can still look at the rig.

    Args:
        campaign: that it was recorded in.
        flight: one of its experiments.
        test: of the flight, as it was asked for; None: it was attached.
        read: its log; None: a system recorded it without one.
    """
    of_file = () if read is None else read.remarks
    found = against(flight, test, campaign.signals, None if read is None else read.lines)
    said = [remark.sentence for remark in (*of_file, *found)]
    return [*said, *_told_twice(campaign, flight, test)]


def said_against(remarks: Sequence[str]) -> list[str]:
    """The same as lines for a person, whoever recorded the flight.

    Args:
        remarks: of one flight.
    """
    return [f"Against this flight: {remark}" for remark in remarks]


def _told_twice(campaign: Campaign, flight: Experiment, test: Test | None) -> list[str]:
    """That a flight is the beginning of another record, or the other way round: a sentence for each of them."""
    run, said = flight.trajectory, []
    for other in campaign.experiments:
        if other is flight or (test is not None and _again(other.test, test)):
            continue
        short, long = sorted((run, other.trajectory), key=lambda each: each.steps)
        row = row_in(short, long)
        exact = row is not None
        if exact or copied(run, other.trajectory, campaign.signals):
            of = "an attached flight" if other.number is None else f"a flight of test {other.number}"
            withdraw = next_command(campaign, "withdraw", "LOG", "--reason", "WHY")
            which = f"{short.steps} steps, from row {row} on," if row else f"first {short.steps} steps"
            how = (
                "to the last digit"
                if exact
                else "but for digits far below the noise, which no two flights share"
            )
            said.append(
                f"{of.capitalize()} of {other.trajectory.steps} steps has the same {which} {how},"
                " so that they count twice: withdraw the"
                f" {'shorter record' if short.steps < long.steps else 'one that is the copy'} by its log: {withdraw}"
            )
    return said


def _refuse_told(campaign: Campaign, run: Trajectory, called: str, test: Test | None) -> None:
    """Refuses a log that is there already; a system without noise repeats itself where a test is flown again.

    A copy with other digits is refused where it would pass for a flight that was not learnt, or for a second one of a
    test. Of other tests it is only said: with nearly the same gains a simulator whose noise begins again flies nearly
    the same.
    """
    for told, name in zip(campaign.experiments, names_of(campaign.experiments), strict=True):
        otherwise = ""
        if recorded_as(run, told.trajectory, campaign.signals):
            if test is not None and _again(told.test, test):
                continue
            how = f"one that is recorded already, as {name}, equal to the last digit"
            if test is not None and told.number != test.number:
                withdraw = next_command(campaign, "withdraw", "LOG", "--reason", "WHY")
                otherwise = f"; if it is no flight of {name}, withdraw that first, by its log: {withdraw}"
        elif (test is None or (told.test is not None and told.test.number == test.number)) and saved_again(
            run, told.trajectory, campaign.signals
        ):
            how = copy_of(name)
        else:
            continue
        raise InvalidInput(
            f"Log {called}: expected a new flight, found {how}; nothing was changed. Name the log of this flight"
            f"{otherwise}."
        )


def _again(earlier: Test | None, test: Test) -> bool:
    """Whether a test asks for what another one did: an exact simulator then flies the same."""
    return earlier is not None and earlier.number != test.number and earlier.asks_as(test)
