"""The verb `twinloop bench zoo`: the preset as it comes, on plants that nobody tuned it for."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import click

from twinloop._ground.arrays import whole
from twinloop.errors import unknown
from twinloop.sweep.progress import JobBar
from twinloop.sweep.seeds import seeds_of
from twinloop.sweep.workers import HERE, finished, processes
from twinloop_exam.ablations import ABLATIONS, SMOKE_OPTIONS, ablation
from twinloop_exam.tables import as_markdown, as_text
from twinloop_exam.zoo import ablated, bars, results
from twinloop_exam.zoo.campaign import Job, Measured, fly
from twinloop_exam.zoo.halves import HALVES
from twinloop_exam.zoo.optima import FLIGHTS, STARTS, keep, optimum
from twinloop_exam.zoo.plants import PLANTS, plant

SMOKE_PLANTS = ("pendulum", "heater", "end-stop")
FORMATS = {"text": as_text, "markdown": as_markdown}


@click.command()
@click.option("--half", help=f"{' or '.join(HALVES)}; both by default.")
@click.option(
    "--plants", help="Comma-separated names, * allowed, such as body-*,arm; all of the half by default."
)
@click.option("--seeds", default="0:2", show_default=True, help="FIRST:LAST+1, or one seed.")
@click.option("--experiments", type=int, default=5, show_default=True, help="Flights of each campaign.")
@click.option("--results", "folder", type=Path, default=Path("zoo-results"), show_default=True, metavar="FOLDER",
              help="Where campaigns are kept, one JSON file each; what is there is not flown again.")  # fmt: skip
@click.option(
    "--cluster", default=HERE, show_default=True, help="here, local:N, or a Dask scheduler's address."
)
@click.option("--table", "form", help=f"Only show what is there: {', '.join((*FORMATS, 'json'))}.")
@click.option("--ablation", "without", metavar="NAMES",
              help="Also without some ideas, comma-separated, or all: compared with the whole preset.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option(
    "--optima", is_flag=True, help="Search the optima by CMA-ES instead, and write them to their file."
)
@click.option("--smoke", is_flag=True, help="Less than a minute: does it run? The numbers mean nothing.")
@click.pass_context
def zoo(
    context: click.Context,
    half: str | None,
    plants: str | None,
    seeds: str,
    experiments: int,
    folder: Path,
    cluster: str,
    form: str | None,
    without: str | None,
    as_json: bool,
    optima: bool,
    smoke: bool,
) -> None:
    """What is foretold is what flies: campaigns on plants that nobody tuned for, against the bars."""
    form = "json" if as_json else form
    if form is not None and form not in (*FORMATS, "json"):
        raise unknown("form of the tables", form, (*FORMATS, "json"))
    ideas = _ablations(without)
    names = _chosen(half, plants, smoke)
    if optima:
        _search(names)
        return
    jobs = _smoke_jobs(names) if smoke else _jobs(names, seeds, whole("--experiments", experiments, least=1))
    jobs += [job.ablated(idea) for job in jobs for idea in ideas]
    with tempfile.TemporaryDirectory() as scratch:
        where = Path(scratch) if smoke else folder
        try:
            if form is None or as_json:
                _work(jobs, where, cluster)
        except KeyboardInterrupt:
            _say(f"Interrupted: what was finished is in {where}; the same command goes on from there.")
            context.exit(130)
        there = list(results.kept(jobs, where).values())
    _show(there, half, ideas, form or "text")
    failed = sum(one["failure"] is not None for one in there)
    if smoke:
        _say("A smoke run: the numbers mean nothing.")
    context.exit(1 if smoke and (failed or len(there) < len(jobs)) else 0)


def _jobs(names: Sequence[str], seeds: str, flights: int) -> list[Job]:
    return [Job(name, seed, flights) for seed in seeds_of(seeds) for name in names]


def _smoke_jobs(names: Sequence[str]) -> list[Job]:
    return [Job(name, 0, 2, tuple(SMOKE_OPTIONS["default"].items()), held_out=4) for name in names]


def _show(campaigns: Sequence[Measured], half: str | None, ideas: Sequence[str], form: str) -> None:
    seeds = len({one["seed"] for one in campaigns})
    plants = len({one["plant"] for one in campaigns})
    if ideas:
        rows = ablated.compared(ideas, campaigns)
        answer = {
            "half": half,
            "plants": plants,
            "seeds": seeds,
            "versions": sorted({one["version"] for one in campaigns}),
            "ablations": rows,
        }
        tables = [ablated.table(f"{half or 'both'}: {plants} plants, {seeds} seeds", rows)]
    else:
        answer = {"half": half, "bars": bars.judged(campaigns), "worst": bars.worst(campaigns)}
        title = f"{half or 'both'}: {len(campaigns)} campaigns, {plants} plants, {seeds} seeds"
        tables = bars.tables(title, campaigns)
    if form == "json":
        click.echo(json.dumps(answer))
    else:
        click.echo("\n\n".join(FORMATS[form](table) for table in tables if table.rows))


def _work(jobs: Sequence[Job], folder: Path, cluster: str) -> None:
    """Flies what the folder lacks, and keeps each campaign as soon as it is there."""
    there = results.kept(jobs, folder)
    todo = [job for job in jobs if job not in there]
    _say(f"{len(todo)} of {len(jobs)} campaigns to fly.")
    processes(cluster)
    with JobBar("zoo", len(todo)) as bar:
        for job, measured in finished(fly, todo, cluster):
            if isinstance(measured, BaseException):
                bar.advance(job.name, f"{type(measured).__name__}: {measured}")
                continue
            results.keep(job, measured, folder)
            bar.advance(job.name, result=f"{bars.best_flown(measured, job.flights):.3f} × the optimum")


def _search(names: Sequence[str]) -> None:
    for name in names:
        _say(f"{name}: {STARTS} starts of {FLIGHTS} flights …")
        found = optimum(plant(name))
        keep({name: found})
        worst = max(found["starts"]) / found["quality"]
        _say(
            f"{name}: {found['quality']:.5g}; the first controller {found['first'] / found['quality']:.2f} ×, the worst"
            f" start {worst:.3f} ×"
        )


def _chosen(half: str | None, patterns: str | None, smoke: bool) -> list[str]:
    """Names of plants that are meant and can be flown here."""
    if half is not None and half not in HALVES:
        raise unknown("half of the zoo", half, HALVES)
    known = list(PLANTS) if half is None else [name for name in PLANTS if name in HALVES[half]]
    if patterns is None:
        chosen = [name for name in known if not smoke or name in SMOKE_PLANTS]
    else:
        words = [word.strip() for word in patterns.split(",")]
        for word in words:
            if not any(fnmatch(name, word) for name in known):
                raise unknown("plant of the zoo", word, known)
        chosen = [name for name in known if any(fnmatch(name, word) for word in words)]
    there = []
    for name in chosen:
        missing = plant(name).why_missing
        if missing is None:
            there.append(name)
        else:
            _say(f"Left out: {name}: {missing}")
    return there


def _ablations(text: str | None) -> list[str]:
    """Names of the ideas that are switched off, one at a time."""
    if text is None:
        return []
    if text.strip() == "all":
        return list(ABLATIONS)
    names = [word.strip() for word in text.split(",")]
    for name in names:
        ablation(name)
    return list(dict.fromkeys(names))


def _say(sentence: str) -> None:
    click.echo(sentence, err=True)
