"""The command `twinloop withdraw`: takes back a flight that was told or attached by mistake."""

from __future__ import annotations

import re
from contextlib import closing
from pathlib import Path

import click

from twinloop.campaign import Campaign
from twinloop.campaign.history import Experiment, Withdrawal
from twinloop.errors import InvalidInput
from twinloop.faces.answering import answer, json_option
from twinloop.faces.telling import counted
from twinloop.logs import load
from twinloop.store import shown_name
from twinloop.trajectory import equal_runs

ATTACHED = re.compile(r"attached-(\d+)")
"""How an attached flight is called, counted from 1."""


@click.command()
@click.argument("store")
@click.argument("which")
@click.option(
    "--reason", required=True, metavar="REASON", help="What was wrong with the flight, in a few words."
)
@click.option("--name", help="Name of the campaign, if the store holds several.")
@json_option
def withdraw(store: str, which: str, reason: str, name: str | None, as_json: bool) -> None:
    """Take back a flight that was recorded by mistake: nothing is learnt from it any more.

    WHICH is the number of a test, the log as it was recorded, or attached-1, attached-2 … for the attached flights in
    their order. The record stays, with the reason. The test is asked again: tell the right log.
    """
    with closing(Campaign.load(store, name)) as campaign:
        campaign.withdraw(chosen(campaign, which), reason)
        withdrawn = campaign.withdrawals[-1]
        given_up = [test.number for test in campaign.tests if _given_up(campaign, withdrawn, test.number)]
        facts = {
            "test": withdrawn.test, "reason": reason, "abandoned": given_up, "experiments": len(campaign.experiments),
        }  # fmt: skip
        answer(facts, _sentences(withdrawn, given_up, counted(campaign), shown_name(store)), as_json)


def chosen(campaign: Campaign, which: str) -> int | Experiment:
    """The flight that somebody names.

    Args:
        campaign: that it was recorded in.
        which: number of a test, attached-N, or a log.

    Raises:
        InvalidInput: no such flight.
    """
    if which.isdecimal():
        return int(which)
    attached = [run for run in campaign.experiments if run.attached]
    place = ATTACHED.fullmatch(which)
    if place is not None and 0 < int(place[1]) <= len(attached):
        return attached[int(place[1]) - 1]
    if place is None and Path(which).is_file():
        run = load(Path(which), campaign.signals)
        equal = [each for each in campaign.experiments if equal_runs(run, each.trajectory)]
        if equal:
            return equal[-1]
    raise InvalidInput(
        f"twinloop withdraw: expected the number of a test, a log as it was recorded, or {_names(attached)},"
        f" found {which}; nothing was changed."
    )


def named(test: int | None) -> str:
    """A withdrawn flight by its test.

    Args:
        test: its number; None for an attached flight.
    """
    return "an attached flight" if test is None else f"the flight of test {test}"


def _given_up(campaign: Campaign, withdrawn: Withdrawal, number: int) -> bool:
    return number in withdrawn.planned and campaign.status(campaign.tests[number]) == "abandoned"


def _names(attached: list[Experiment]) -> str:
    if not attached:
        return "attached-N for an attached flight (there is none)"
    runs = (f"attached-{i} ({run.replayed.steps} steps)" for i, run in enumerate(attached, start=1))
    return ", ".join(runs)


def _sentences(withdrawn: Withdrawal, given_up: list[int], told: str, store: str) -> str:
    lines = [f"Saved: {named(withdrawn.test)} withdrawn; {told} in {store}."]
    if given_up:
        tests = f"Test{'s' if len(given_up) > 1 else ''} {', '.join(map(str, given_up))}"
        lines.append(f"{tests} abandoned: planned with it.")
    if withdrawn.test is not None:
        lines.append(f"Its right log, if there is one: twinloop tell {store} {withdrawn.test} FLIGHT.csv")
    return "\n".join(lines)
