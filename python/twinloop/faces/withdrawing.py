"""The command `twinloop withdraw`: takes back a flight that was told or attached by mistake."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import click

from twinloop.campaign import Campaign
from twinloop.campaign.history import Experiment, Withdrawal
from twinloop.errors import InvalidInput
from twinloop.faces.answering import answer, json_option, name_option, next_command
from twinloop.faces.opening import fields_beside
from twinloop.faces.telling import counted
from twinloop.logs import read_log
from twinloop.store import shown_name
from twinloop.trajectory import recorded_as

ATTACHED = re.compile(r"attached-(\d+)")
"""How an attached flight is called, counted from 1."""


@click.command()
@click.argument("store")
@click.argument("which")
@click.option(
    "--reason", required=True, metavar="REASON", help="What was wrong with the flight, in a few words."
)
@name_option
@json_option
def withdraw(store: str, which: str, reason: str, name: str | None, as_json: bool) -> None:
    """Take back a flight that was recorded by mistake: nothing is learnt from it any more.

    WHICH is the number of a test, the log as it was recorded, or attached-1, attached-2 … for the attached flights in
    their order. The record stays, with the reason. The test is asked again: tell the right log.
    """
    with closing(Campaign.load(store, name)) as campaign:
        before = campaign.experiments
        # A campaign file that cannot be read must not keep a flight that was recorded by mistake.
        columns = fields_beside(store) if Path(which).is_file() else None
        campaign.withdraw(chosen(campaign, which, columns), reason)
        test = campaign.withdrawals[-1].test
        others = [run for run in campaign.experiments if test is not None and run.number == test]
        failures = [each for each in campaign.failures if each.test.number == test and not each.recorded]
        facts = {
            "test": test, "reason": reason, "abandoned": given_up(campaign), "experiments": len(campaign.experiments),
        }  # fmt: skip
        which_one = _which(campaign, before) if others else ""
        what = named(campaign.withdrawals[-1], campaign.withdrawn_logs[-1])
        lines = [
            f"Saved: {what}{which_one} withdrawn; {counted(campaign)} in {shown_name(store)}.",
            *given_up_words(campaign),
        ]
        if others or failures:
            left = [*map(_described, others), *(f"its failure: {each.reason}" for each in failures)]
            again = next_command(campaign, "withdraw", test, "--reason", "WHY")
            lines.append(f"Still recorded of test {test}: {', '.join(left)}. To take it back, too: {again}")
        elif test is not None:
            told = next_command(campaign, "tell", test, "FLIGHT.csv")
            lines.append(f"Its right log, if there is one: {told}")
        answer(facts, "\n".join(lines), as_json)


def chosen(campaign: Campaign, which: str, columns: Mapping[str, str] | None = None) -> int | Experiment:
    """The flight that somebody names.

    Args:
        campaign: that it was recorded in.
        which: number of a test, attached-N, or a log.
        columns: what the columns of a log are called, where not as the signals are.

    Raises:
        InvalidInput: no such flight.
    """
    if which.isdecimal():
        return int(which)
    attached, place = _attached(campaign), ATTACHED.fullmatch(which)
    if place is not None and (found := attached.get(_attached_name(int(place[1])))):
        return found
    if place is None and Path(which).is_file():
        run = read_log(Path(which), campaign.signals, None, columns).trajectory()
        equal = [each for each in campaign.experiments if recorded_as(run, each.trajectory, campaign.signals)]
        if equal:
            return equal[-1]
    # Its log may have been moved since.
    called = [run for run in campaign.experiments if run.log == which]
    if len(called) == 1 and not Path(which).is_file():
        return called[0]
    raise InvalidInput(
        f"twinloop withdraw: expected the number of a test, a log as it was recorded, or {_names(attached)},"
        f" found {which}; nothing was changed."
    )


def _which(campaign: Campaign, before: Sequence[Experiment]) -> str:
    """What the run was that was withdrawn last, where it is not the only one of its test.

    Args:
        campaign: after it was withdrawn.
        before: the experiments with it.
    """
    *earlier, last = campaign.withdrawals
    if last.run is None:
        return ""
    place = last.run - sum(each.run is not None and each.run < last.run for each in earlier)
    alike = [run for run in before if run.number == before[place].number]
    number = 1 + next(i for i, run in enumerate(alike) if run is before[place])
    return f" (number {number} of the {len(alike)} told: {_described(before[place])})"


def _described(run: Experiment) -> str:
    """A run in a few words."""
    found = run.trajectory
    return f"{found.steps} steps, {found.ended}{f': {found.reason}' if found.reason else ''}"


def named(withdrawal: Withdrawal, log: str) -> str:
    """What was withdrawn, in words.

    Args:
        withdrawal: the entry of it.
        log: what the log of an attached flight is called; empty where nobody has said so.
    """
    if withdrawal.test is None:
        return f"the attached log {log}" if log else "an attached flight"
    what = (
        "flight" if withdrawal.failure is None else "failure" if withdrawal.run is None else "failed flight"
    )
    return f"the {what} of test {withdrawal.test}"


def recorded(campaign: Campaign) -> dict[str, str]:
    """What `chosen` calls each flight and each failure that can be withdrawn, and what people call it; the last first.

    Args:
        campaign: that they were recorded in.
    """
    runs = {run.number for run in campaign.experiments}
    tests = {
        str(test.number): f"the {'flight' if test.number in runs else 'failure'} of test {test.number}"
        for test in campaign.tests
        if campaign.status(test) in ("flown", "aborted", "failed")
    }
    flights = {
        name: f"{name.replace('-', ' flight ')} ({_log(run)})" for name, run in _attached(campaign).items()
    }
    return dict(reversed({**flights, **tests}.items()))


def given_up(campaign: Campaign) -> list[int]:
    """Tests that were planned with the flight that was withdrawn last, and will not be flown.

    Args:
        campaign: with a withdrawn flight.
    """
    planned = campaign.withdrawals[-1].planned
    return [number for number in planned if campaign.status(campaign.tests[number]) == "abandoned"]


def given_up_words(campaign: Campaign) -> list[str]:
    """The same in a sentence; none if there are no such tests.

    Args:
        campaign: with a withdrawn flight.
    """
    numbers = given_up(campaign)
    if not numbers:
        return []
    return [
        f"Test{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))} abandoned: planned with it."
    ]


def _attached(campaign: Campaign) -> dict[str, Experiment]:
    """Attached flights, attached-1 first."""
    runs = [run for run in campaign.experiments if run.attached]
    return {_attached_name(place): run for place, run in enumerate(runs, start=1)}


def _attached_name(place: int) -> str:
    return f"attached-{place}"


def _names(attached: Mapping[str, Experiment]) -> str:
    if not attached:
        return "attached-N for an attached flight (there is none)"
    return ", ".join(f"{name} ({_log(run)})" for name, run in attached.items())


def _log(run: Experiment) -> str:
    """What the log of an attached flight is called, if somebody has said so, and its length."""
    return f"{f'{run.log}, ' if run.log else ''}{run.replayed.steps} steps"
