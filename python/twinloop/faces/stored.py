"""The commands for campaigns in a store: `twinloop resume`, `twinloop learn` and `twinloop show`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing, suppress
from typing import Any

import click

from twinloop.campaign import Campaign
from twinloop.campaign.assessment import behind, learnt
from twinloop.campaign.keeping import heading, look
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.faces.answering import json_option, name_option, next_command, threads_option
from twinloop.faces.answers import DO_NOT_FLY
from twinloop.faces.console import Watch
from twinloop.faces.from_file import beside, run_file
from twinloop.faces.opening import say_if_changed, with_plain_progress
from twinloop.faces.result import summary, to_json
from twinloop.faces.run_info import Stopwatch
from twinloop.faces.telling import awaited, counted, unlearnt
from twinloop.faces.terminal import is_utf_8
from twinloop.faces.text import render, table
from twinloop.faces.withdrawing import named
from twinloop.faces.working import Answers, answering, described, knows_nothing, patient, work
from twinloop.store import Stored, StoredAs, listed, opened
from twinloop.systems import BUILT_IN, Quadrotor


@click.command()
@click.argument("store")
@name_option
@click.option("--experiments", type=int, help="Total number of runs; by default as first requested.")
@threads_option
@patient
@answering
@click.pass_context
def resume(
    context: click.Context,
    store: str,
    name: str | None,
    experiments: int | None,
    threads: int | None,
    timeout: float | None,
    answers: Answers,
) -> None:
    """Continue a campaign of STORE on its system, with the same bits.

    The system is a built-in one, or the one that the campaign file beside the store names.
    """
    answers.check()
    held = look(store, name, read_only=False)
    file = beside(store)
    if file is not None:
        wanted = held.experiments if experiments is None else experiments
        if wanted is None:
            raise InvalidInput(
                "resume: expected --experiments N for a campaign that was flown by hand so far, found none;"
                " state the total number of runs."
            )
        context.exit(run_file(file, store, held.name, wanted, threads, answers, timeout))
    kind, rig = _system(held)
    budget = held.experiments if experiments is None else experiments
    assert budget is not None  # it stands beside the system
    campaign = Campaign.load(store, held.name, threads=threads)
    watch = Watch(campaign.options, budget, kind)
    campaign.progress = watch
    context.exit(work(campaign, rig, watch, budget, answers, kind, timeout))


@click.command()
@click.argument("store")
@name_option
@threads_option
@json_option
def learn(store: str, name: str | None, threads: int | None, as_json: bool) -> None:
    """Learn from all recorded flights of a campaign of STORE, as the next ask would, without planning a test."""
    known, _ = heading(store, name)
    with closing(with_plain_progress(Campaign.load(store, known, threads=threads), known)) as campaign:
        _ = campaign.twin
        with suppress(NotAvailable):  # there may be no controller to fly yet
            _ = campaign.best_test
        say_if_changed(store, campaign, known)
        text = f"Learnt from {counted(campaign)}: {next_command(campaign, 'show')}\n"
        _print({"learnt": len(campaign.experiments)}, text, as_json)


@click.command()
@click.argument("store")
@name_option
@json_option
def show(store: str, name: str | None, as_json: bool) -> None:
    """Show the contents of STORE; nothing is learnt or changed, and a writer is not delayed."""
    campaigns = _campaigns(store)
    if name is None and len(campaigns) != 1:
        rows = [[row["name"], row["created"], row["tests"], row["experiments"]] for row in campaigns]
        text = table(["campaign", "begun", "tests", "experiments"], rows) + "\n"
        _print({"campaigns": campaigns}, text, as_json)
        return
    held = look(store, name, read_only=True)
    stored_as = StoredAs.among(store, held.name, campaigns)
    campaign = Campaign.load(store, held.name, read_only=True)
    facts = _facts(held, campaign)
    campaign.interrupted = True  # what was learnt so far is enough
    known = bool(campaign.experiments) and held.memory is not None and not knows_nothing(campaign)
    result = _result(campaign, held) if known else None
    text = _sentences(stored_as, facts, unlearnt(campaign))
    if result is not None:
        # Looking took no time that anyone asks for.
        shown = {**result, "run_info": {**result["run_info"], "seconds": None}}
        text += f"\n{render(shown, _learnt(campaign, held), stored_as.to_type('report'))}"
        untried = result["controller"] is not None and result["controller"]["test"] is None
        if untried and result["verdict"]["controller"]["answer"] != DO_NOT_FLY:
            text += f"To fly the tuned gains: {stored_as.to_type('ask', '--last')}\n"
    say_if_changed(store, campaign, held.name)
    _print({"store": facts, "result": result}, text, as_json)


def _result(campaign: Campaign, held: Stored) -> dict[str, Any]:
    """The twin when the store was written last; `interrupted` if it has not learnt all runs."""
    result: dict[str, Any] = summary(campaign, _named(held), Stopwatch(campaign.threads).info())
    result["interrupted"] = behind(campaign)
    return result


def _learnt(campaign: Campaign, held: Stored) -> str | None:
    """How far learning is, where a person flies or not every flight is learnt; None: as the result says it."""
    if learnt(campaign) < len(campaign.experiments):
        return f"learnt from {learnt(campaign)} of"
    return "learnt from" if held.experiments is None else None


def _campaigns(store: str) -> list[dict[str, Any]]:
    source = opened(store, read_only=True)
    try:
        return listed(source)
    finally:
        source.close()


def _system(held: Stored) -> tuple[str, Quadrotor]:
    """The system that a campaign flies, and its name, if it is a built-in one."""
    kind = None if held.system is None else held.system["kind"]
    if kind not in BUILT_IN:
        raise NotAvailable(
            "resume: expected a campaign that flies a built-in system, or a campaign"
            " file beside the store that names one, found neither; write [system] into that file, fly"
            " yourself with twinloop ask, or continue from Python with the same arguments and store=."
        )
    return kind, BUILT_IN[kind].from_record(held.system)


def _named(held: Stored) -> dict[str, object]:
    try:
        kind, system = _system(held)
    except (NotAvailable, InvalidInput):
        return {"name": "a system of your own"}
    return described(kind, system)


def _facts(held: Stored, campaign: Campaign) -> dict[str, object]:
    return {
        "name": held.name,
        "created": held.created,
        "preset": campaign.setup.preset,
        "seed": campaign.setup.seed,
        "tests": len(held.logbook["tests"]),
        "told": len(campaign.experiments),
        "learnt": learnt(campaign),
        "experiments": held.experiments,
        "waiting": [test.number for test in awaited(campaign)],
        "failed": [failure.test.number for failure in campaign.failures],
        "abandoned": [test.number for test in campaign.tests if campaign.status(test) == "abandoned"],
        "withdrawn": [
            {"test": each.test, "what": named(each, log), "reason": each.reason, "at": at}
            for each, log, at in zip(
                campaign.withdrawals, campaign.withdrawn_logs, held.withdrawn_at, strict=False
            )
        ],
        "sessions": list(held.sessions),
    }


def _sentences(stored_as: StoredAs, facts: dict[str, Any], missing: str) -> str:
    of = "" if facts["experiments"] is None else f" of {facts['experiments']}"
    lines = [
        f"{stored_as.store}: campaign {facts['name']!r}, begun {facts['created']}.",
        f"Preset {facts['preset']}, seed {facts['seed']}.",
        f"Experiments recorded: {facts['told']}{of}. Tests made: {facts['tests']}.",
    ]
    if missing:
        lines.append(f"{missing}; to learn now: {stored_as.to_type('learn')}.")
    for key, words in (("waiting", "waiting to be flown"), ("failed", "failed"), ("abandoned", "abandoned")):
        if facts[key]:
            numbers = ", ".join(str(number) for number in facts[key])
            lines.append(f"Test{'s' if len(facts[key]) > 1 else ''} {words}: {numbers}.")
    for each in facts["withdrawn"]:
        lines.append(f"Withdrawn at {each['at']}: {each['what']} ({each['reason']}).")
    return "\n".join(lines) + "\n"


def _print(result: Mapping[str, object], text: str, as_json: bool) -> None:
    click.echo(to_json(result, ascii_only=not is_utf_8()) if as_json else text, nl=False)
