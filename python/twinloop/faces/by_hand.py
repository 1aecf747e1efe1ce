"""The commands for people who fly their system themselves: new, ask, tell, attach, abandon."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import click

from twinloop._ground.texts import to_type
from twinloop._ground.writing import write_whole
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import foreseen
from twinloop.campaign.campaign_file import read_file, template
from twinloop.campaign.persistence import stored_as
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.faces.about_test import foretold
from twinloop.faces.answering import answer, json_option, name_option, next_command, threads_option
from twinloop.faces.cautions import advised_to_stop
from twinloop.faces.columns import columns, columns_file, refuse_other
from twinloop.faces.files import check_writable
from twinloop.faces.first_test import first_test
from twinloop.faces.from_file import file_beside
from twinloop.faces.opening import fields_beside, opened_by_hand
from twinloop.faces.result import to_json
from twinloop.faces.sheet import Sheet
from twinloop.faces.telling import (
    against_it,
    counted,
    numbered,
    said_against,
    tell_failed,
    to_be_flown,
)
from twinloop.faces.telling import attach as attach_flight
from twinloop.faces.telling import tell as tell_flight
from twinloop.logs import write_columns
from twinloop.planning.quality import quality_unit
from twinloop.store import StoredAs, shown_name
from twinloop.test import Test

STOPPED = "stopped early"
"""Why a test was aborted, where nobody says it."""


@click.command()
@click.argument("file", type=Path)
@json_option
def new(file: Path, as_json: bool) -> None:
    """Write a commented campaign FILE.toml to fill in for a system of your own."""
    check_writable(file, [".toml"])
    if file.exists():
        raise InvalidInput(f"File {file}: expected none there, found one; choose another name, or remove it.")
    store = file.with_suffix(".db")
    write_whole(file, template(str(store)))
    text = f"Wrote {file}: fill it in, then ask for the first test: {to_type('ask', store)}"
    answer({"files": [str(file)], "store": str(store)}, text, as_json)


@click.command()
@click.argument("store")
@click.option("--last", is_flag=True, help="The last test of the campaign: fly the best gains found so far.")
@click.option("--again", is_flag=True, help="Plan another test although one is still to be flown.")
@click.option(
    "--batch",
    type=click.IntRange(1, 100),
    metavar="N",
    help="Plan N alternative tests, the best first; fly them in any order.",
)
@name_option
@threads_option
@json_option
def ask(
    store: str,
    last: bool,
    again: bool,
    batch: int | None,
    name: str | None,
    threads: int | None,
    as_json: bool,
) -> None:
    """Plan the next test: a test sheet, and a file with the excitation and the predicted run.

    If STORE.db has no campaign yet, it is begun from STORE.toml beside it. A waiting test is shown again, with --last
    the waiting last one.
    """
    if batch is not None:
        _ask_batch(store, batch, last or again, name, threads, as_json)
        return
    with closing(opened_by_hand(store, name, threads)) as campaign:
        # Whatever was attached: the first test is the controller that is trusted.
        if all(run.attached for run in campaign.experiments):
            waiting = next(iter(to_be_flown(campaign)), None)
            if again and waiting is not None:
                raise InvalidInput(_not_again(campaign, waiting))
            test = waiting or _first(store, campaign)
        else:
            known = campaign.waiting_last if last else next(iter(campaign.waiting), None)
            test = campaign.ask(last=last) if again or known is None else known
        text, described = _shown(campaign, test, advised_to_stop(campaign))
        click.echo(to_json(described) if as_json else text, nl=False)


def _not_again(campaign: Campaign, waiting: Test) -> str:
    """Why there is no other test while the first one waits."""
    return (
        "twinloop ask --again: expected the flight of a test, from which another test is planned, found none; fly test"
        f" {waiting.number}, which {next_command(campaign, 'ask')} shows, or give it up to write other gains into"
        f" [first]: {next_command(campaign, 'abandon', waiting.number)}."
    )


def _ask_batch(
    store: str, batch: int, other: bool, name: str | None, threads: int | None, as_json: bool
) -> None:
    """Alternatives: those that wait, and as many more as are missing."""
    if other:
        raise InvalidInput("ask: expected --batch alone, found --last or --again beside it; leave one out.")
    with closing(opened_by_hand(store, name, threads)) as campaign:
        if not campaign.experiments:
            raise InvalidInput(
                "twinloop ask --batch: expected a recorded flight, found none; fly the first test:"
                f" {next_command(campaign, 'ask')}."
            )
        tests, advice = campaign.ask_batch(batch), advised_to_stop(campaign)
        shown = [_shown(campaign, test, advice) for test in tests]
        if as_json:
            click.echo(to_json({"tests": [described for _, described in shown]}), nl=False)
            return
        click.echo(
            f"{len(shown)} alternatives, the best first. Fly them in any order and record each with tell;"
            f" for a test that you will not fly: {next_command(campaign, 'abandon', 'TEST')}\n"
        )
        click.echo("\n".join(text for text, _ in shown), nl=False)


def _shown(campaign: Campaign, test: Test, advice: str) -> tuple[str, dict[str, object]]:
    """The sheet of a test, with the advice to stop if there is one, and the same as facts; its file is written."""
    place, predicted = stored_as(campaign), foreseen(campaign, test)
    assert place is not None  # it was opened in a store
    file = columns_file(place, test)
    refuse_other(file)
    write_columns(file, columns(test, predicted))
    shown = Sheet.of(campaign, place, test, predicted, str(file), advice)
    return shown.text, shown.facts


@click.command()
@click.argument("store")
@click.argument("test", type=int)
@click.argument("flight", type=Path, required=False)
@click.option(
    "--failed", metavar="REASON", help="Why the test failed; FLIGHT is its partial log, if there is one."
)
@click.option("--aborted", type=Path, metavar="FLIGHT", help="Log of a test that was stopped before its end.")
@click.option(
    "--reason", metavar="REASON", help=f"Why it was stopped, beside --aborted; without it: {STOPPED}."
)
@name_option
@json_option
def tell(
    store: str,
    test: int,
    flight: Path | None,
    failed: str | None,
    aborted: Path | None,
    reason: str | None,
    name: str | None,
    as_json: bool,
) -> None:
    """Record the result of a TEST: a FLIGHT as CSV or .npz, complete or aborted, or why there is none."""
    log = _log_of(store, name, test, flight, failed, aborted, reason)
    with closing(opened_by_hand(store, name)) as campaign:
        if failed is not None:
            asked, read = tell_failed(campaign, test, failed, log, fields_beside(store))
        else:
            assert log is not None  # refused above
            asked, read = tell_flight(
                campaign,
                test,
                log,
                aborted="" if aborted is None else STOPPED if reason is None else reason,
                otherwise=f"record a test that was stopped early: {_aborted(store, name, test, log, 'why')}",
                columns=fields_beside(store),
            )
        text = (
            f"Saved: test {test} {campaign.status(asked)}{_as_expected(campaign, asked)}; {counted(campaign)} in"
            f" {shown_name(store)}."
        )
        runs = [run for run in campaign.experiments if run.number == asked.number]
        quality = {
            "predicted": asked.predicted,
            "spread": asked.spread,
            "quality": runs[-1].quality if runs else None,
        }
        remarks = [] if read is None else against_it(campaign, runs[-1], asked, read)
        if len(runs) > 1 and failed is None:
            text += (
                f" It is flight {len(runs)} of this test, and all of them are learnt from; to take the last one back:"
                f" {next_command(campaign, 'withdraw', test, '--reason', 'WHY')}"
            )
        answer({**_standing(campaign, asked), **quality, "remarks": remarks}, text, as_json)
        _say(campaign, remarks, test)


def _log_of(
    store: str,
    name: str | None,
    test: int,
    flight: Path | None,
    failed: str | None,
    aborted: Path | None,
    reason: str | None,
) -> Path | None:
    """The log of a run, once the arguments fit together."""
    if failed is not None and aborted is not None:
        raise InvalidInput("tell: expected --failed or --aborted, found both; leave one out.")
    if flight is not None and aborted is not None:
        why = str(aborted) if reason is None else reason
        raise InvalidInput(
            f"tell: expected the log of an aborted flight behind --aborted, found {flight} before it; write:"
            f" {_aborted(store, name, test, flight, why)}."
        )
    if reason is not None and (aborted is None or not reason.strip()):
        raise InvalidInput(
            "tell: expected --reason with a few words beside --aborted FLIGHT, found it without one of the two; a test"
            " that failed says why itself: --failed REASON."
        )
    if failed is not None and not failed.strip():
        raise InvalidInput(
            'tell: expected what happened behind --failed, found nothing; such as "motor cut out".'
        )
    if failed is None and flight is None and aborted is None:
        raise InvalidInput(
            "tell: expected a flight, found none; name its file, or say --aborted FLIGHT, or --failed REASON."
        )
    return flight if aborted is None else aborted


def _aborted(store: str, name: str | None, test: int, log: Path, why: str) -> str:
    """The command that tells an aborted flight."""
    return StoredAs(shown_name(store), name).to_type("tell", test, "--aborted", log, "--reason", why)


@click.command()
@click.argument("store")
@click.argument("flight", type=Path)
@name_option
@json_option
def attach(store: str, flight: Path, name: str | None, as_json: bool) -> None:
    """Add a recorded FLIGHT without a test, as CSV or .npz."""
    with closing(opened_by_hand(store, name)) as campaign:
        read = attach_flight(campaign, flight, columns=fields_beside(store))
        text = f"Saved: {flight}; {counted(campaign)} in {shown_name(store)}."
        remarks = against_it(campaign, campaign.experiments[-1], None, read)
        answer(
            {"file": str(flight), "experiments": len(campaign.experiments), "remarks": remarks}, text, as_json
        )
        _say(campaign, remarks, flight)


@click.command()
@click.argument("store")
@click.argument("test", type=int)
@name_option
@json_option
def abandon(store: str, test: int, name: str | None, as_json: bool) -> None:
    """Mark a TEST as not to be flown."""
    with closing(opened_by_hand(store, name)) as campaign:
        asked = numbered(campaign, test)
        campaign.abandon(asked)
        text = f"Saved: test {test} abandoned in {shown_name(store)}."
        answer(_standing(campaign, asked), text, as_json)


def _say(campaign: Campaign, remarks: Sequence[str], which: int | Path) -> None:
    """Says what speaks against a flight at once, while somebody can still look at the rig, and how to take it back."""
    for line in said_against(remarks):
        click.echo(line, err=True)
    if remarks and not any(" withdraw " in remark for remark in remarks):
        withdraw = next_command(campaign, "withdraw", which, "--reason", "WHY")
        click.echo(f"If its log is wrong, take it back, and tell the right one: {withdraw}", err=True)


def _standing(campaign: Campaign, test: Test) -> dict[str, object]:
    """Where a test is in its life, for a program."""
    told = len(campaign.experiments)
    return {"test": test.number, "status": campaign.status(test), "experiments": told}


def _as_expected(campaign: Campaign, test: Test) -> str:
    """The quality that was flown beside the one that was predicted, where there are both."""
    runs = [run.quality for run in campaign.experiments if run.number == test.number]
    if not runs or runs[-1] is None:
        return ""
    expected = "" if test.predicted is None else f", predicted {foretold(test)}"
    unit = quality_unit(campaign.setup.quality)
    return f", quality {runs[-1]:.4g}{expected}{f' {unit}' if unit else ''}"


def _first(store: str, campaign: Campaign) -> Test:
    """The test of the controller that is trusted, by the campaign file beside a store."""
    file = file_beside(store)
    if file is None or not file.exists():
        where = "a campaign file beside the store" if file is None else str(file)
        raise NotAvailable(
            f"ask: expected the gains of the first test in {where}, found no such file; add it."
        )
    return first_test(campaign, read_file(file))
