"""The verbs `twinloop bench`, and `bench power`: works the exam off, tunes the others, and prints the tables."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import click

from twinloop._ground.arrays import whole
from twinloop._ground.writing import write_whole
from twinloop.campaign.remaining import duration
from twinloop.errors import NotAvailable, unknown
from twinloop.faces.result import to_json
from twinloop.sweep.seeds import seeds_of
from twinloop.sweep.workers import HERE, processes
from twinloop_exam.kinds import Fitter, Tuner
from twinloop_exam.learners import LEARNERS, for_smoke, learner
from twinloop_exam.page import as_page
from twinloop_exam.plan import TUNING_SEEDS, Scope, available, planned
from twinloop_exam.results import Results
from twinloop_exam.store import Store
from twinloop_exam.study import work_off
from twinloop_exam.systems import SUBJECTS
from twinloop_exam.tables import FORMATS, as_text, render
from twinloop_exam.tuning import EXPERIMENTS as TUNING_EXPERIMENTS
from twinloop_exam.tuning import score, tuned, tuned_as_values, variants
from twinloop_exam.version import version
from twinloop_exam.zoo.command import zoo

ASK_ABOVE = 600.0
"""Seconds of estimated work above which a person at a terminal is asked first."""
SMOKE_SYSTEMS = ("quadrotor-0", "quadrotor")
SMOKE_SEEDS = range(1)
SMOKE_LEFT_OUT = ("ours-*", "without-*")


@click.group(invoke_without_command=True)
@click.option("--smoke", is_flag=True, help="All studies in turn: do they run? The numbers mean nothing.")
@click.pass_context
def bench(context: click.Context, smoke: bool) -> None:
    """Compare Twinloop with others, and with its targets."""
    if context.invoked_subcommand is not None:
        context.default_map = {context.invoked_subcommand: {"smoke": smoke}}
    elif not smoke:
        click.echo(context.get_help())
    else:
        codes = (study.main(["--smoke"], standalone_mode=False) for study in (power, zoo))
        context.exit(next((code for code in codes if code), 0))


bench.add_command(zoo)


@bench.command()
@click.option("--systems", help=f"Comma-separated names: {', '.join(SUBJECTS)}; all by default.")
@click.option("--learners", help="Comma-separated names, * allowed, such as ours,sindy-*; all by default.")
@click.option("--seeds", help="FIRST:LAST+1, such as 10:35, or one seed.")
@click.option("--experiments", type=int, help="After the first flight, at most; by default as each needs.")
@click.option("--data", help="Learner whose flights the fits are made on; ours by default.")
@click.option("--store", type=Path, metavar="FILE.db", help="Where rows are kept; exam.db by default.")
@click.option(
    "--cluster", default=HERE, show_default=True, help="here, local:N, or a Dask scheduler's address."
)
@click.option("--table", "form", help=f"Only print what the store holds: {', '.join(FORMATS)}.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--page", type=Path, metavar="FILE.md", help="Only write what the store holds as a page.")
@click.option("--tune", is_flag=True, help="Compare hyper-parameters of the others on seeds 0 to 9.")
@click.option("--retry", is_flag=True, help="Try again what failed.")
@click.option("--yes", is_flag=True, help="Do not ask before a long run.")
@click.option("--smoke", is_flag=True, help="Less than a minute: does it run? The numbers mean nothing.")
@click.pass_context
def power(
    context: click.Context,
    systems: str | None,
    learners: str | None,
    seeds: str | None,
    experiments: int | None,
    data: str | None,
    store: Path | None,
    cluster: str,
    form: str | None,
    as_json: bool,
    page: Path | None,
    tune: bool,
    retry: bool,
    yes: bool,
    smoke: bool,
) -> None:
    """The exam: how little data a twin and a controller need, beside what others need."""
    if form is not None and form not in FORMATS:
        raise unknown("form of the tables", form, FORMATS)
    processes(cluster)
    if experiments is not None:
        experiments = whole("--experiments", experiments)
    names = _chosen("system of the exam", systems, SMOKE_SYSTEMS if smoke else list(SUBJECTS), SUBJECTS)
    known = [name for name in LEARNERS if not (smoke and _matches(name, SMOKE_LEFT_OUT))]
    chosen = [learner(name) for name in _chosen("learner", learners, known, LEARNERS)]
    chosen_seeds = SMOKE_SEEDS if smoke and seeds is None else None if seeds is None else seeds_of(seeds)
    names, chosen = available(names, chosen, _say)
    source = learner("ours" if data is None else data)
    if smoke:
        chosen, source = [for_smoke(who) for who in chosen], for_smoke(source)
    with tempfile.TemporaryDirectory() as folder:
        path = store or (Path(folder) / "smoke.db" if smoke else Path("exam.db"))
        shown_only = form is not None or page is not None
        if shown_only and not path.exists():
            raise NotAvailable(f"Store {str(path)!r}: expected a file, found none; run the exam first.")
        scope = Scope(names, chosen, source, chosen_seeds, experiments, retry)
        if tune:
            click.echo(_tune(scope, path, cluster, yes, as_json or form == "json"), nl=False)
            return
        try:
            failed = 0 if shown_only else _run(scope, path, cluster, yes)
        except KeyboardInterrupt:
            _say(f"Interrupted: what was measured is in {path.name}; the same command goes on from there.")
            context.exit(130)
        kept = Store(path)
        try:
            results = Results(kept, names, chosen, source, chosen_seeds)
            if page is None:
                click.echo(render(results, "json" if as_json else form or "text"), nl=False)
            else:
                write_whole(page, as_page(results, kept.versions))
                if as_json:
                    click.echo(to_json({"files": [str(page)]}), nl=False)
        finally:
            kept.close()
    if smoke:
        _say("A smoke run: the numbers mean nothing.")
    context.exit(1 if smoke and failed else 0)


def _run(scope: Scope, path: Path, cluster: str, yes: bool) -> int:
    """Says what it will cost, then does it; how many jobs failed."""
    scope = _with_source(scope)
    store = Store(path)
    try:
        todo = planned(scope, store)
        if todo:
            store.measured_by(version())
    finally:
        store.close()
    count = processes(cluster) or 1
    cost = sum(job.seconds for job in todo) / count
    _say(
        f"{len(todo)} jobs to do, about {duration(cost)} on {count} process{'es' if count > 1 else ''} (as"
        f" measured in {path.name}, guessed where it holds nothing)."
    )
    if cost > ASK_ABOVE and not yes and sys.stdin.isatty():
        click.confirm("Begin?", abort=True, err=True)
    return work_off(path, todo, cluster) if todo else 0


def _with_source(scope: Scope) -> Scope:
    """Fits need flights: whoever makes them is measured too."""
    fitted = any(isinstance(who, Fitter) for who in scope.learners)
    if not fitted or any(who.name == scope.data.name for who in scope.learners):
        return scope
    return replace(scope, learners=[scope.data, *scope.learners])


def _tune(scope: Scope, path: Path, cluster: str, yes: bool, as_json: bool) -> str:
    system = "quadrotor" if "quadrotor" in scope.systems else scope.systems[0]
    grids = [who for who in scope.learners if isinstance(who, Fitter | Tuner) and who.grid]
    tried = [variant for who in grids for variant in variants(who)]
    seeds = scope.seeds or TUNING_SEEDS
    _run(Scope([system], tried, scope.data, seeds, max(TUNING_EXPERIMENTS), scope.retry), path, cluster, yes)
    store = Store(path)
    try:
        scored = [
            (
                who,
                [
                    (variant, score(Results(store, [system], [variant], scope.data, seeds), system, variant))
                    for variant in variants(who)
                ],
            )
            for who in grids
        ]
    finally:
        store.close()
    if as_json:
        return to_json({"tuned": [value for who, scores in scored for value in tuned_as_values(who, scores)]})
    return "\n\n".join(as_text(tuned(who, scores)) for who, scores in scored) + "\n"


def _chosen(kind: str, asked: str | None, by_default: Sequence[str], known: Iterable[str]) -> list[str]:
    if asked is None:
        return list(by_default)
    found: list[str] = []
    for pattern in (word.strip() for word in asked.split(",")):
        matching = [name for name in known if fnmatch(name, pattern)]
        if not matching:
            raise unknown(kind, pattern, known)
        found += [name for name in matching if name not in found]
    return found


def _matches(name: str, patterns: Sequence[str]) -> bool:
    return any(fnmatch(name, pattern) for pattern in patterns)


def _say(sentence: str) -> None:
    click.echo(sentence, err=True)
