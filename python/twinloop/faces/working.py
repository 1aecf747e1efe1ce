"""A campaign from the command line: checked, watched while it flies, and answered for at its end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from twinloop._ground.arrays import number
from twinloop._ground.writing import write_whole
from twinloop.campaign import Campaign, controller_to_fly, refused_an_answer
from twinloop.campaign.history import Experiment
from twinloop.errors import InvalidInput, NoAnswer, TooRisky, TwinloopError
from twinloop.faces.answering import json_option, next_command
from twinloop.faces.console import Watch
from twinloop.faces.files import check_picture, check_writable
from twinloop.faces.result import Result, summary, to_json
from twinloop.faces.run_info import Stopwatch
from twinloop.faces.telling import against_it, said_against
from twinloop.faces.terminal import is_closed, is_utf_8
from twinloop.faces.text import render
from twinloop.systems import Folder, Quadrotor, System
from twinloop.systems.patience import raised_in_a_run
from twinloop.systems.raised import raised
from twinloop.test import Test

Answer = TypeVar("Answer")
Command = TypeVar("Command", bound=Callable[..., Any])
KEPT_NOWHERE = "run it with --store FILE.db, then twinloop report FILE.db"
"""What shows the checks of a campaign that no store keeps."""


@dataclass(frozen=True)
class Answers:
    """Where the result of a campaign goes.

    Args:
        output: a file for it, as JSON; None: none.
        plot: a file for its picture; None: none.
        as_json: whether it is printed as JSON.
    """

    output: Path | None
    plot: Path | None
    as_json: bool

    def check(self) -> None:
        """Refuses files that cannot be written, before any work is done.

        Raises:
            InvalidInput: a file cannot be written, or there is nowhere to print to.
            NotAvailable: matplotlib is missing.
        """
        if self.output is not None:
            check_writable(self.output, [".json"])
        elif is_closed():
            raise InvalidInput(
                "Standard output: expected somewhere to print the result, found it closed; open it, or pass --output."
            )
        if self.plot is not None:
            check_picture(self.plot)


def answering(command: Callable[..., None]) -> Callable[..., None]:
    """The options of a command that answers with the result of a campaign, which it gets as its `answers`.

    Args:
        command: of click.
    """

    @wraps(command)
    def asked(*given: Any, output: Path | None, plot: Path | None, as_json: bool, **options: Any) -> None:
        command(*given, answers=Answers(output, plot, as_json), **options)

    for option in (
        json_option,
        click.option("--plot", type=Path, metavar="FILE.svg|png", help="Also draw the runs and the errors."),
        click.option(
            "--output", type=Path, metavar="FILE.json", help="Also write the result there, as JSON."
        ),
    ):
        asked = option(asked)
    return asked


def patient(command: Command) -> Command:
    """The option of a command that flies a system: `timeout`.

    Args:
        command: of click.
    """
    return click.option(
        "--timeout",
        type=float,
        callback=lambda context, option, value: (
            None if value is None else number("--timeout (s)", value, above=0.0)
        ),
        help="Longest time that the system may take for a test, s; then the command stops, and nothing is lost.",
    )(command)


def check_experiments(experiments: int) -> None:
    """Refuses a number of runs that is none.

    Args:
        experiments: runs in all.

    Raises:
        InvalidInput: fewer than one.
    """
    if experiments < 1:
        raise InvalidInput(
            f"--experiments: expected at least 1, found {experiments}; the first flight counts."
        )


def work(
    campaign: Campaign,
    rig: System,
    watch: Watch,
    experiments: int,
    answers: Answers,
    name: str,
    timeout: float | None = None,
    max_risk: float | None = None,
) -> int:
    """Flies a campaign to its end, and shows what came out.

    Args:
        campaign: to be run.
        rig: that it flies.
        watch: that shows its progress.
        experiments: runs in all.
        answers: where the result goes.
        name: of the system.
        timeout: seconds that a run may take; None: as long as it wants.
        max_risk: probability of leaving the envelope above which a test is not flown; None: any.

    Returns:
        The exit code: 130 after an interruption, 1 where no controller is fit to fly, nothing was flown to learn from,
        a test was too risky, or the system did not answer in time, or raised.

    Raises:
        KeyboardInterrupt: an interruption before there was a result.
    """
    clock = Stopwatch(campaign.threads)
    stopped = ended = False
    campaign.landed = lambda test, flight: _say_against(campaign, rig, watch, experiments, test, flight)
    try:
        with watch, suppress(KeyboardInterrupt):
            try:
                campaign.run(rig, experiments, timeout=timeout, max_risk=max_risk)
            except (TooRisky, NoAnswer) as reason:
                click.echo(f"twinloop: {reason}", err=True)
                stopped = True
            except Exception as reason:
                said = _fault_of(name, reason, campaign.store is not None)
                if said is None:
                    raise
                click.echo(f"twinloop: {said}", err=True)
                stopped = True
            controller_to_fly(campaign)  # learns the last flight
            ended = True
        if (campaign.interrupted or stopped) and campaign.store is not None:
            click.echo(f"Saved. Continue with: {next_command(campaign, 'resume')}", err=True)
        if stopped and not campaign.experiments:
            return 1
        if ended and not campaign.experiments and not campaign.interrupted:
            click.echo(f"twinloop: {_nothing_flown(campaign, experiments)}", err=True)
            return 1
        if not campaign.experiments or knows_nothing(campaign):
            raise KeyboardInterrupt
        result = _uninterrupted(lambda: summary(campaign, described(name, rig), clock.info()))
        evidence = KEPT_NOWHERE if campaign.store is None else next_command(campaign, "report")
    finally:
        campaign.close()
    try:
        if answers.output is not None:
            write_whole(answers.output, to_json(result))
            click.echo(f"Result: {answers.output}", err=True)
    finally:  # a full disk must not take the result with it
        show_result(result, answers.as_json, evidence)
    plot = answers.plot
    if plot is not None:
        _uninterrupted(lambda: campaign.plot(plot))
        click.echo(f"Picture: {plot}", err=True)
    return 130 if campaign.interrupted else 1 if stopped or result["controller"] is None else 0


def _fault_of(name: str, reason: Exception, kept: bool) -> str | None:
    """What the code of a system did wrong, and what becomes of the test that it was to fly; None: nothing."""
    waits = "The test still waits and nothing is lost: correct that, then go on." if kept else "Correct that."
    if refused_an_answer(reason):
        return f"System {name!r}: its answer cannot be entered. {reason} {waits}"
    if isinstance(reason, TwinloopError) or not raised_in_a_run(reason):
        return None
    return f"System {name!r}: expected a run, found {raised(reason)}. {waits}"


def _nothing_flown(campaign: Campaign, experiments: int) -> str:
    """That nothing was flown that something can be learnt from, why, and what to do."""
    found = "its only run is spent" if experiments == 1 else f"all {experiments} runs are spent"
    again = "Begin again with another controller that you trust."
    if campaign.store is not None:
        again = f"Go on with more: {next_command(campaign, 'resume', '--experiments', campaign.runs + 1)}"
    if campaign.failures:
        failure = campaign.failures[-1]
        found = f"test {failure.test.number} failed: {failure.reason}"
        if campaign.store is not None:
            withdraw = next_command(campaign, "withdraw", failure.test.number, "--reason", "WHY")
            again = f"If its gains were not the cause, take that back: {withdraw}. {again}"
    return f"Expected a flight to learn from, found none: {found}. {again}"


def _say_against(
    campaign: Campaign, rig: System, watch: Watch, experiments: int, test: Test, flight: Experiment
) -> None:
    """Says what speaks against a flight as it lands, as `tell` does, and that flights go on all the same."""
    lines = said_against(against_it(campaign, flight, test, rig.log if isinstance(rig, Folder) else None))
    if lines and campaign.runs < experiments:
        back = ""
        if campaign.store is not None:
            withdraw = next_command(campaign, "withdraw", test.number, "--reason", "WHY")
            back = f" To take this one back: {withdraw}"
        lines.append(
            f"Flights go on after test {test.number}, whatever speaks against it; Ctrl-C stops them.{back}"
        )
    for line in lines:
        watch.say(line)


def show_result(result: Result, as_json: bool, evidence: str) -> None:
    """Prints a result.

    Args:
        result: a `twinloop.faces.result.summary`.
        as_json: whether as JSON.
        evidence: the command that shows all checks.
    """
    text = to_json(result, ascii_only=not is_utf_8()) if as_json else render(result, evidence=evidence)
    click.echo(text, nl=False)


def knows_nothing(campaign: Campaign) -> bool:
    """Whether nothing was ever learnt to its end: there is nothing to show then.

    Args:
        campaign: with or without experiments.
    """
    return campaign.options.identifies and not campaign.history


def described(name: str, rig: System) -> dict[str, object]:
    """What a result says of a system.

    Args:
        name: of the system.
        rig: the system.
    """
    if not isinstance(rig, Quadrotor):
        return {"name": name}
    return {
        "name": name,
        "noise": rig.noise,
        "gyroscopic": rig.gyroscopic,
        "inertia": rig.inertia.tolist(),
        "natural_frequency": rig.natural_frequency,
        "drag": rig.drag.tolist(),
        "motor_lag": rig.motor_lag,
        "gusts": rig.gusts,
    }


def _uninterrupted(work: Callable[[], Answer]) -> Answer:
    """Does short work to its end, even if Ctrl-C is pressed once more."""
    try:
        return work()
    except KeyboardInterrupt:
        return work()
