"""The command `twinloop`: checks what it was asked before it works, and exits 0, 1 or 2."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from twinloop import __version__
from twinloop._ground.arrays import share
from twinloop._ground.loading import INTERRUPTED, NO_RESULT
from twinloop.campaign import Campaign
from twinloop.campaign.campaign_file import read_file
from twinloop.campaign.presets import PRESETS, options_of, parsed
from twinloop.errors import InvalidInput, NotAvailable, NotTrusted, TwinloopError, unknown
from twinloop.faces.answering import threads_option
from twinloop.faces.by_hand import abandon, ask, attach, new, tell
from twinloop.faces.certifying import certify
from twinloop.faces.console import Watch
from twinloop.faces.exporting import export
from twinloop.faces.from_file import run_file
from twinloop.faces.from_logs import identify
from twinloop.faces.log_check import check
from twinloop.faces.report.command import compare, report
from twinloop.faces.settings import settings
from twinloop.faces.stored import learn, resume, show
from twinloop.faces.terminal import prepared
from twinloop.faces.withdrawing import withdraw
from twinloop.faces.working import Answers, answering, check_experiments, patient, work
from twinloop.planning.planner import GOALS
from twinloop.planning.quality import KINDS
from twinloop.systems import BUILT_IN, Quadrotor

SAID_BY_A_FILE = (
    "seed",
    "preset",
    "goal",
    "quality",
    "weights",
    "generations",
    "test_generations",
    "noise",
    "gyroscopic",
    "harsh",
    "changes",
)
"""Options of `run` that a campaign file has."""
SPELT = {"changes": "set", "weights": "weight"}
"""Options of `run` whose names differ from those of their values."""
STUDIES = {
    "bench": "twinloop_exam.command",
    "dashboard": "twinloop.faces.dashboard.command",
    "reproduce": "twinloop.reproduce.command",
    "sweep": "twinloop.sweep.command",
}
"""Verbs that are loaded when they are called, by the module that holds each."""


class OneSentence(click.Group):
    """A group of commands that says what went wrong in one sentence, and exits 1 or 2."""

    def list_commands(self, context: click.Context) -> list[str]:
        """All verbs, those of studies among them."""
        return sorted([*super().list_commands(context), *filter(_is_here, STUDIES)])

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        """A verb by its name."""
        if name in STUDIES:
            return _study(name)
        return super().get_command(context, name)

    def main(self, args: Any = None, prog_name: str | None = None, **extra: Any) -> Any:  # type: ignore[override]
        """Runs the command line; see `click.Command.main`."""
        if not extra.pop("standalone_mode", True):
            return super().main(args, prog_name, standalone_mode=False, **extra)
        try:
            with warnings.catch_warnings(), prepared():
                code = super().main(args, prog_name, standalone_mode=False, **extra)
        except click.ClickException as misuse:
            _fail(misuse.format_message(), misuse.exit_code)
        except NotTrusted as failure:
            _fail(str(failure), 1)
        except (InvalidInput, NotAvailable) as misuse:
            _fail(str(misuse), 2)
        except TwinloopError as failure:
            _fail(str(failure), 1)
        except (click.Abort, KeyboardInterrupt):
            _fail(NO_RESULT, INTERRUPTED)
        except OSError as failure:
            _fail(f"The system refused: {failure}.", 1)
        sys.exit(code if isinstance(code, int) else 0)


@click.group(
    cls=OneSentence, context_settings={"help_option_names": ["-h", "--help"]}, invoke_without_command=True
)
@click.version_option(__version__, prog_name="twinloop", message="%(prog)s %(version)s")
@click.pass_context
def main(context: click.Context) -> None:
    """From a handful of experiments to a twin made of readable equations and a tuned controller."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@main.command()
@click.argument("system")
@click.option("--seed", type=int, default=0, show_default=True, help="Equal seeds give equal results.")
@threads_option
@click.option("--preset", default="default", show_default=True, help=f"Set of options: {', '.join(PRESETS)}.")
@click.option(
    "--experiments",
    type=int,
    default=4,
    show_default=True,
    help="Number of runs on the system, including the first.",
)
@click.option("--goal", help=f"What flights are for: {', '.join(GOALS)}; by default both.")
@click.option("--quality", help=f"What is minimised: {', '.join(KINDS)}; by default the preset's.")
@click.option(
    "--weight",
    "weights",
    multiple=True,
    metavar="STATE=NUMBER",
    help="Weight of a state in the quality; repeat for others.",
)
@click.option("--generations", type=int, help="Preset paper: generations of the model loop per iteration.")
@click.option(
    "--test-generations",
    type=int,
    help="Preset paper: generations of the test loop; by default a share of --generations.",
)
@click.option(
    "--noise",
    type=float,
    help="Standard deviation of the sensors' noise in rad; in rad/s five times as large.  [default: 0]",
)
@click.option(
    "--gyroscopic", default="physical", show_default=True, help="Signs of the rotor terms: physical, print."
)
@click.option("--harsh", is_flag=True, help="The same vehicle with drag, slow motors, gusts and noise 0.001.")
@click.option("--set", "changes", multiple=True, metavar="NAME=VALUE", help="Any other option of the preset.")
@click.option(
    "--store",
    metavar="FILE.db|URL",
    help="Store the campaign in this file, or continue the one that it holds.",
)
@click.option("--name", default="campaign", show_default=True, help="Name of the campaign in the store.")
@click.option(
    "--max-risk", type=float, help="Highest probability of leaving the envelope that a test may have."
)
@patient
@answering
@click.pass_context
def run(
    context: click.Context,
    system: str,
    seed: int,
    threads: int | None,
    preset: str,
    experiments: int,
    goal: str | None,
    quality: str | None,
    weights: tuple[str, ...],
    generations: int | None,
    test_generations: int | None,
    noise: float | None,
    gyroscopic: str,
    harsh: bool,
    changes: tuple[str, ...],
    store: str | None,
    name: str,
    max_risk: float | None,
    timeout: float | None,
    answers: Answers,
) -> None:
    """Experiment on a SYSTEM: learn its twin, tune its controller.

    SYSTEM is a built-in one (quadrotor), or a campaign file such as rig.toml that names one; that campaign is kept in
    rig.db beside it.
    """
    if max_risk is not None:
        share("--max-risk", max_risk)
    if Path(system).suffix == ".toml":
        _refuse_beside_a_file(context)
        kept_in = Path(system).with_suffix(".db") if store is None else store
        file = read_file(system)
        context.exit(run_file(file, kept_in, name, experiments, threads, answers, timeout, max_risk))
    if system not in BUILT_IN:
        raise unknown("system", system, BUILT_IN)
    check_experiments(experiments)
    options = dict(_change(preset, change) for change in changes)
    options |= _generations(preset, generations, test_generations)
    rig = _vehicle(system, noise, seed, gyroscopic, harsh)
    watch = Watch(options_of(preset, options), experiments, system)
    answers.check()
    campaign = Campaign(
        rig.signals,
        controller=rig.controller,
        initial_state=rig.initial_state,
        target_state=rig.target_state,
        duration=rig.duration,
        preset=preset,
        seed=seed,
        options=options,
        goal=goal,
        quality=quality,
        weights=dict(_weight(text) for text in weights),
        threads=threads,
        progress=watch,
        store=store,
        name=name,
    )
    context.exit(work(campaign, rig, watch, experiments, answers, system, timeout, max_risk))


for command in (new, ask, tell, attach, abandon, withdraw):
    main.add_command(command)
main.add_command(check)
main.add_command(identify)
main.add_command(resume)
main.add_command(learn)
main.add_command(show)
main.add_command(report)
main.add_command(compare)
main.add_command(export)
main.add_command(certify)
main.add_command(settings)


def _refuse_beside_a_file(context: click.Context) -> None:
    """Refuses options that a campaign file has."""
    for name in SAID_BY_A_FILE:
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            option = f"--{SPELT.get(name, name.replace('_', '-'))}"
            raise InvalidInput(
                f"run: expected {option} in the campaign file, found it beside it; write it there."
            )


def _change(preset: str, text: str) -> tuple[str, object]:
    name, separator, value = (part.strip() for part in text.partition("="))
    if not separator:
        example = options_of(preset).example
        raise InvalidInput(f"--set: expected NAME=VALUE, found {text!r}; such as --set {example}.")
    if preset in PRESETS and not hasattr(PRESETS[preset], name):
        for other, options in PRESETS.items():
            if hasattr(options, name):
                raise InvalidInput(
                    f"--set: expected an option of the preset {preset!r}, found {name!r}, which is one of the preset"
                    f" {other!r}; leave it out, or choose --preset {other}."
                )
    return name, parsed(preset, name, value)


def _weight(text: str) -> tuple[str, float]:
    name, _, number = (part.strip() for part in text.partition("="))
    try:
        return name, float(number)
    except ValueError as reason:
        raise InvalidInput(
            f"--weight: expected STATE=NUMBER, found {text!r}; such as --weight pitch=2."
        ) from reason


def _generations(preset: str, models: int | None, tests: int | None) -> dict[str, object]:
    given = {"model_generations": models, "test_generations": tests}
    options: dict[str, object] = {name: value for name, value in given.items() if value is not None}
    if options and options_of(preset).identifies:
        raise InvalidInput(
            f"--generations, --test-generations: expected the preset 'paper', found {preset!r}, which identifies"
            " instead of evolving whole models; leave them out, or choose --preset paper."
        )
    return options


def _vehicle(system: str, noise: float | None, seed: int, gyroscopic: str, harsh: bool) -> Quadrotor:
    given: dict[str, Any] = {} if noise is None else {"noise": noise}
    if not harsh:
        return BUILT_IN[system](**given, seed=seed, gyroscopic=gyroscopic)
    if gyroscopic != "physical":
        raise InvalidInput(
            f"--harsh: expected --gyroscopic physical, found {gyroscopic!r}; leave one of the two out."
        )
    return BUILT_IN[system].harsh(**given, seed=seed)


def _is_here(name: str) -> bool:
    return find_spec(STUDIES[name].partition(".")[0]) is not None


def _study(name: str) -> click.Command:
    if not _is_here(name):
        raise NotAvailable(
            f"{name!r} is not part of the installed package: clone the repository, `make test`, and call"
            f" `.venv/bin/twinloop {name}` there."
        )
    verb: click.Command = getattr(import_module(STUDIES[name]), name)
    return verb


def _fail(sentence: str, code: int) -> None:
    click.echo(f"twinloop: {sentence}", err=True)
    sys.exit(code)


if __name__ == "__main__":
    main()
