"""`twinloop check`: whether a log can be learnt, before it is told."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import click
import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.times import shown_time
from twinloop.campaign.campaign_file import read_fields, read_signals
from twinloop.campaign.examination.log_check import LogCheck, check_log
from twinloop.errors import InvalidInput
from twinloop.faces.answering import json_option
from twinloop.faces.files import check_writable
from twinloop.faces.result import plain_dict, to_json
from twinloop.faces.text import table
from twinloop.logs import TIME, Window, evenly, read_log, write_columns
from twinloop.unmeasured import columns_of, names_of


@click.command()
@click.argument("log", type=Path)
@click.argument("config", type=Path, metavar="FILE.toml")
@click.option("--from", "start", type=float, metavar="S", help="Only from so many s after its beginning on.")
@click.option("--to", "stop", type=float, metavar="S", help="Only until so many s after its beginning.")
@click.option("--even", is_flag=True, help="Bring times that jitter onto the period dt first.")
@click.option("-o", "--output", type=Path, metavar="FILE.csv", help="Also write the log as CSV, for tell.")
@json_option
def check(
    log: Path,
    config: Path,
    start: float | None,
    stop: float | None,
    even: bool,
    output: Path | None,
    as_json: bool,
) -> int:
    """Check a LOG, as CSV, .npz or .ulg, before it is used: clock, gaps, sensors, commands and units.

    FILE.toml has dt, states and commands, as for a campaign; its section [log] names the columns that are called
    otherwise, and for a .ulg the field of each. Exits with 1 if something has to be corrected first.
    """
    if output is not None:
        check_writable(output, [".csv"])
    signals, _ = read_signals(config)
    read = read_log(log, signals, None, read_fields(config), Window(start, stop))
    rows, name = len(read.t), f"Log {log}"
    t = _numbers(f"{name}, t", read.t, np.shape(read.t)[:1])
    states = _numbers(f"{name}, states", read.states, (rows, columns_of(read.states, signals)))
    commands = _numbers(f"{name}, commands", read.commands, (max(0, rows - 1), signals.n_u))
    if even:
        read = evenly(dataclasses.replace(read, t=t, states=states, commands=commands))
        t, states, commands = read.t, read.states, read.commands
    found = check_log(t, states, commands, signals, read.lines)
    found = dataclasses.replace(found, remarks=(*read.remarks, *found.remarks))
    if as_json:
        facts = {"file": str(log), "fit": found.fit, **dataclasses.asdict(found)}
        click.echo(to_json(plain_dict(facts)), nl=False)
    else:
        click.echo(_text(log, found), nl=False)
    if output is not None:
        if output.exists() and output.samefile(log):
            raise InvalidInput(
                f"twinloop check, --output: expected another file than the log {log}, which stays as it was recorded,"
                " found the same; name another."
            )
        columns = dict(zip(names_of(states, signals), states.T, strict=True))
        columns |= dict(zip(signals.command_names, commands.T, strict=True))
        write_columns(output, {TIME: t, **columns})
        click.echo(f"Log: {output}", err=True)
    return 0 if found.fit else 1


def _numbers(what: str, values: Floats, shape: tuple[int, ...]) -> Floats:
    """What a file of NumPy holds may be of any kind and shape; gaps are what is looked for."""
    if values.dtype.kind not in "iufb" or values.shape != shape:
        raise InvalidInput(
            f"{what}: expected real numbers {shape}, found {values.dtype} {values.shape}; check the file."
        )
    return np.asarray(values, dtype=np.float64)


def _period(seconds: float) -> str:
    """A period as people say it: with its rate where it is short."""
    return shown_time(seconds, 4) + ("" if seconds >= 1.0 else f" ({1.0 / seconds:.4g} Hz)")


def _clock(found: LogCheck) -> str:
    """How long the log is and how far its rows are apart, where its times say so."""
    if not found.seconds >= 0.0:
        return ""
    rate = f", one in {_period(found.period)}" if found.period and found.period > 0.0 else ""
    return f" over {found.seconds:.4g} s{rate}"


def _text(log: Path, found: LogCheck) -> str:
    lines = [f"{log}: {found.rows} row{'s' * (found.rows != 1)}{_clock(found)}."]
    rows = [
        [
            column.name,
            column.unit or "1",
            column.least,
            column.greatest,
            column.moved,
            None if column.at_bound is None else 100.0 * column.at_bound,
            None if column.beyond is None else 100.0 * column.beyond,
        ]
        for column in found.columns
    ]
    head = ["", "unit", "least", "greatest", "moved (noise σ)", "at a bound (%)", "beyond (%)"]
    lines += ["", table(head, rows), ""]
    lines += [f"{'✗' if remark.serious else '○'} {remark.sentence}" for remark in found.remarks]
    lines.append(
        "The log can be used for learning. Whether its commands are those of the controller, and whether it is whole,"
        " is seen when it is told as the flight of a test."
        if found.fit
        else "Correct what is marked ✗ before you use the log."
    )
    return "\n".join(lines) + "\n"
