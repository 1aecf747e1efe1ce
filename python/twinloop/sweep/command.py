"""The verb `twinloop sweep`: many campaigns at once, and a table at the end."""

from __future__ import annotations

import json
from pathlib import Path

import click

from twinloop.campaign.presets import PRESETS
from twinloop.errors import InvalidInput
from twinloop.faces.answering import json_option
from twinloop.store import is_address, shown_name
from twinloop.sweep.campaigns import Outcome
from twinloop.sweep.campaigns import sweep as fly_all
from twinloop.sweep.jobs import Job, crossed
from twinloop.sweep.progress import JobBar
from twinloop.sweep.seeds import seeds_of
from twinloop.sweep.summary import as_text, summarised
from twinloop.sweep.workers import HERE


@click.command()
@click.argument("systems", nargs=-1, required=True)
@click.option("--seeds", default="0:5", show_default=True, help="FIRST:LAST+1, or one seed.")
@click.option(
    "--presets", default="default", show_default=True, help=f"Comma-separated: {', '.join(PRESETS)}."
)
@click.option("--experiments", type=int, default=4, show_default=True, help="Experiments of each campaign.")
@click.option(
    "--vary", multiple=True, metavar="NAME=VALUE", help="An option; repeat it to try further values."
)
@click.option(
    "--cluster", default=HERE, show_default=True, help="here, local:N, or the address of a Dask scheduler."
)
@click.option(
    "--store",
    default="sweep.db",
    show_default=True,
    metavar="FILE.db|URL",
    help="Where the campaigns are stored.",
)
@json_option
@click.pass_context
def sweep(
    context: click.Context,
    systems: tuple[str, ...],
    seeds: str,
    presets: str,
    experiments: int,
    vary: tuple[str, ...],
    cluster: str,
    store: str,
    as_json: bool,
) -> None:
    """Fly campaigns on SYSTEMS over seeds, presets and options; campaigns in the store are not flown again.

    A system is a built-in one, such as quadrotor, quadrotor:noise=0.001 or quadrotor:harsh, or module:object.
    """
    jobs = crossed(
        systems,
        seeds_of(seeds),
        presets=[name.strip() for name in presets.split(",")],
        options=_varied(vary),
        experiments=experiments,
    )
    outcomes: list[Outcome] = []
    try:
        _work(jobs, store, cluster, outcomes)
    except KeyboardInterrupt:
        click.echo(
            f"Interrupted: what was finished is in {shown_name(store)}; the same command goes on from there.",
            err=True,
        )
        context.exit(130)
    rows = summarised(outcomes)
    found = {"store": shown_name(store), "groups": rows}
    click.echo(json.dumps(found) if as_json else as_text(rows), nl=as_json)
    context.exit(1 if any(outcome.failure is not None for outcome in outcomes) else 0)


def _work(jobs: list[Job], store: str, cluster: str, outcomes: list[Outcome]) -> None:
    with JobBar("sweep", len(jobs)) as bar:
        for outcome in fly_all(jobs, store if is_address(store) else Path(store), cluster):
            outcomes.append(outcome)
            bar.advance(outcome.job.name, outcome.failure, known=outcome.seconds is None)


def _varied(changes: tuple[str, ...]) -> dict[str, list[str]]:
    axes: dict[str, list[str]] = {}
    for change in changes:
        name, equals, value = (part.strip() for part in change.partition("="))
        if not equals:
            raise InvalidInput(f"--vary: expected NAME=VALUE, found {change!r}; such as --vary moves=1000.")
        axes.setdefault(name, []).append(value)
    return axes
