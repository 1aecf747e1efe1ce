"""The verb `twinloop reproduce`: runs one of the paper's studies and shows both sides."""

from __future__ import annotations

from pathlib import Path

import click

from twinloop._ground.arrays import whole
from twinloop._ground.writing import write_whole
from twinloop.campaign import available_threads
from twinloop.errors import InvalidInput, unknown
from twinloop.faces.answering import json_option, threads_option
from twinloop.faces.files import check_picture, check_writable
from twinloop.faces.result import to_json
from twinloop.faces.run_info import Stopwatch
from twinloop.faces.terminal import is_utf_8
from twinloop.reproduce import figure6, table1, table2, table3
from twinloop.reproduce.study import Setting

STUDIES = {"table1": table1, "table2": table2, "table3": table3, "figure6": figure6}
RUNS = {"table1": 1, "table2": 5, "table3": 25, "figure6": 5}
SMOKE_RUNS, SMOKE_GENERATIONS = 2, 20


@click.command()
@click.argument("study")
@click.option("--runs", type=int, help="Independent runs; by default the paper's number.")
@click.option(
    "--generations", type=int, help="Of the model loop; 15000 by default, the test loop keeps its ratio."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Equal seeds give equal results.")
@threads_option
@click.option("--smoke", is_flag=True, help="A few seconds: does it run? The numbers mean nothing.")
@click.option("--output", type=Path, metavar="FILE.json", help="Also write the result there, as JSON.")
@click.option(
    "--plot", type=Path, metavar="FILE.svg|png", help="Where to draw figure6; figure6.svg by default."
)
@json_option
@click.pass_context
def reproduce(
    context: click.Context,
    study: str,
    runs: int | None,
    generations: int | None,
    seed: int,
    threads: int | None,
    smoke: bool,
    output: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Measure a STUDY of the paper again: table1, table2, table3 or figure6."""
    if study not in STUDIES:
        raise unknown("study", study, STUDIES)
    runs = runs if runs is not None else min(SMOKE_RUNS, RUNS[study]) if smoke else RUNS[study]
    if generations is None:
        generations = SMOKE_GENERATIONS if smoke and study != "table1" else 15_000
    setting = Setting(
        study,
        whole("--runs", runs, least=1),
        whole("--generations", generations, least=1),
        whole("--seed", seed),
        None if threads is None else whole("--threads", threads, least=1),
    )
    _ = setting.options  # refused now rather than later
    if plot is not None and study != "figure6":
        raise InvalidInput(f"--plot: expected with figure6 only, found with {study}; leave it out.")
    picture = (plot or Path("figure6.svg")) if study == "figure6" else None
    if output is not None:
        check_writable(output, [".json"])
    if picture is not None:
        check_picture(picture)
    if study == "table3":
        table3.require()

    stopwatch = Stopwatch(available_threads() if threads is None else threads)
    result = {**STUDIES[study].compute(setting), "smoke": smoke, "run_info": stopwatch.info()}
    if output is not None:
        write_whole(output, to_json(result))
    if picture is not None:
        figure6.draw(result, picture)
    if as_json:
        click.echo(to_json(result, ascii_only=not is_utf_8()), nl=False)
    else:
        click.echo(STUDIES[study].render(result))
        click.echo(_footer(result, picture))
    context.exit(130 if result["interrupted"] else 0)


def _footer(result: dict[str, object], picture: Path | None) -> str:
    lines = ["", "Where this differs from the paper:"]
    differences, info = result["differences"], result["run_info"]
    assert isinstance(differences, list) and isinstance(info, dict)
    lines += [f"- {difference}" for difference in differences]
    lines.append(
        f"Seed {result['seed']}, {result['runs_asked']} run{'s' * (result['runs_asked'] != 1)} asked,"
        f" {result['model_generations']} generations of models, {result['test_generations']} of tests;"
        f" {info['seconds']:.1f} s on {info['threads']} thread{'s' * (info['threads'] != 1)}."
    )
    if result["smoke"]:
        lines.append("A smoke run: the numbers mean nothing, and versions may come out equal.")
    if result["interrupted"]:
        lines.append("Interrupted: only what was finished is shown.")
    if picture is not None:
        lines.append(f"Picture: {picture}")
    return "\n".join(lines)
