"""`twinloop identify`: a twin from logs alone, with its report and no campaign."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from twinloop._experiment.limits import Limits
from twinloop._ground.texts import to_type, whole_characters
from twinloop._ground.writing import write_whole
from twinloop.campaign.campaign_file import read_fields, read_signals
from twinloop.campaign.from_logs import learnt_from_logs
from twinloop.campaign.presets import options_of
from twinloop.errors import InvalidInput
from twinloop.faces.answering import json_option, threads_option
from twinloop.faces.console import Watch
from twinloop.faces.files import check_writable
from twinloop.faces.report.page import report_page, templates
from twinloop.faces.result import plain_dict, to_json
from twinloop.faces.run_info import Stopwatch
from twinloop.faces.text import table
from twinloop.faces.text.words import every
from twinloop.law.twin import Twin
from twinloop.logs import read_log
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory, check_recorded, completed


@click.command()
@click.argument("logs", type=Path, nargs=-1, metavar="LOG...")
@click.option(
    "--config", type=Path, metavar="FILE.toml", required=True, help="Campaign file that names the signals."
)
@click.option(
    "--held-out",
    type=Path,
    multiple=True,
    metavar="LOG",
    help="Log for validation, not used for learning; repeat for more.",
)
@click.option("-o", "--output", type=Path, metavar="FILE.json", help="Write the twin to this file.")
@click.option("--report", type=Path, metavar="FILE.html", help="Write an HTML report with all checks.")
@click.option("--seed", type=int, default=0, show_default=True, help="Equal seeds give equal results.")
@threads_option
@json_option
@click.option("--force", is_flag=True, help="Write the twin even if it does not follow its own logs.")
def identify(
    logs: tuple[Path, ...],
    config: Path,
    held_out: tuple[Path, ...],
    output: Path | None,
    report: Path | None,
    seed: int,
    threads: int | None,
    as_json: bool,
    force: bool,
) -> None:
    """Learn a twin from LOGs alone, as CSV, .npz or .ulg: no flight is planned, and no controller is tuned.

    FILE.toml has dt, states and commands, as for a campaign, and may have [options]; other sections are not needed.
    """
    if not logs:
        raise InvalidInput("identify: expected at least one log, found none; name CSV, .npz or .ulg files.")
    for path, suffix in ((output, ".json"), (report, ".html")):
        if path is not None:
            check_writable(path, [suffix])
    if report is not None:
        templates()  # what is missing is said before any work
    signals, options = read_signals(config)
    runs, apart = ([_flight(file, signals, config) for file in files] for files in (logs, held_out))
    with Watch(options_of("default", options), len(runs), "logs") as watch:
        twin, campaign = learnt_from_logs(
            runs, signals, apart, logs=[whole_characters(file.name) for file in (*logs, *held_out)],
            seed=seed, options=options, threads=threads, progress=watch,
        )  # fmt: skip
    campaign.progress = None
    found = _facts(twin, [*logs, *held_out], [*runs, *apart], len(runs))
    click.echo(to_json(found) if as_json else _text(twin, found), nl=False)
    if report is not None:
        write_whole(
            report,
            report_page(
                campaign,
                config.stem,
                {"name": config.stem},
                Stopwatch(campaign.threads).info(),
                controller=False,
            ),
        )
        click.echo(f"Report: {report}", err=True)
    if output is not None:
        twin.export(output, force=force)
        click.echo(f"Twin: {output}", err=True)


def _flight(file: Path, signals: Signals, config: Path) -> Trajectory:
    log = read_log(file, signals, columns=read_fields(config))
    for remark in log.remarks:
        click.echo(f"Log {file}: {remark}", err=True)
    flight = completed(log.trajectory(), signals)
    try:
        with log.errors():
            check_recorded(flight, Limits(signals), None)
        return flight
    except InvalidInput as reason:
        raise InvalidInput(f"{reason} To look into it: {to_type('check', file, config)}") from reason


def _facts(twin: Twin, files: Sequence[Path], runs: Sequence[Trajectory], learnt: int) -> dict[str, Any]:
    logs = []
    for place, (file, run) in enumerate(zip(files, runs, strict=True)):
        fits = twin.fit(run)
        logs.append(
            {
                "file": str(file),
                "learnt": place < learnt,
                "seconds": float(run.t[-1] - run.t[0]),
                "fit": {row.name: row.fit for row in fits},
                "rmse": {row.name: row.rmse for row in fits},
                "piece": twin.piece_of(run) * twin.signals.dt,
            }
        )
    return plain_dict(
        {
            "form": twin.model.form,
            "equations": twin.equations().splitlines(),
            "exact_equations": twin.equations(digits=17).splitlines(),
            "follows": twin.follows,
            "logs": logs,
            "remarks": [
                {"code": each.code, "severity": each.severity, "sentence": each.sentence}
                for each in twin.remarks
            ],
        }
    )


def _text(twin: Twin, found: dict[str, Any]) -> str:
    names = twin.signals.state_names
    rows = [
        [
            log["file"],
            "learnt" if log["learnt"] else "held out",
            log["seconds"],
            *(None if log["fit"][name] is None else round(log["fit"][name], 1) for name in names),
        ]
        for log in found["logs"]
    ]
    head = ["log", "", "length (s)", *(f"FIT {name} (%)" for name in names)]
    remarks = "".join(f"{each['severity']}: {each['sentence']}\n" for each in found["remarks"])
    errors = table(head, rows)
    pieces = [log["piece"] for log in found["logs"] if log["piece"] < log["seconds"] - 0.5 * twin.signals.dt]
    note = (
        "FIT: of the free run from where the first readings say that it began; 100 is perfect, 0 no better than the"
        " mean."
    )
    if pieces:
        note += (
            "\nWhere no model could be followed for longer, the free run begins again at a reading"
            f" {every(pieces)}."
        )
    return (
        "\n".join([*found["equations"], "", errors, note, *([] if not remarks else ["", remarks.rstrip()])])
        + "\n"
    )
