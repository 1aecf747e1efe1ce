"""`twinloop export`: the twin or the controller of a stored campaign, for use elsewhere."""

from __future__ import annotations

from pathlib import Path

import click

from twinloop.campaign import Campaign
from twinloop.campaign.keeping import look
from twinloop.errors import InvalidInput, NotTrusted, unknown
from twinloop.faces.answering import answer, json_option, name_option
from twinloop.faces.opening import opened_to_look, say_if_changed, say_if_unlearnt, with_plain_progress
from twinloop.law.exports.export import PRECISIONS, SUFFIXES
from twinloop.law.twin import load_twin
from twinloop.store import is_address

WHAT = ("twin", "controller")
"""What a campaign has to be taken away."""


@click.command("export")
@click.argument("source")
@click.argument("what", default="twin")
@click.option("--to", "kind", help=f"Kind: {', '.join(SUFFIXES)}; for a controller python or c.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="File to write, its kind by the suffix; without it, the text of --to on standard output.",
)
@name_option
@click.option("--precision", default="double", show_default=True, help=f"For C: {' or '.join(PRECISIONS)}.")
@click.option(
    "--force", is_flag=True, help="Export also a twin that fails its checks, and skip the comparison."
)
@json_option
def export(
    source: str,
    what: str,
    kind: str | None,
    output: Path | None,
    name: str | None,
    precision: str,
    force: bool,
    as_json: bool,
) -> None:
    """Export the TWIN (or the CONTROLLER) of SOURCE: a store with a campaign, or a twin as JSON.

    What is exported is run on the campaign's own flights and compared before it is written.
    """
    if what not in WHAT:
        raise unknown("thing to export", what, WHAT)
    if kind is None and output is None:
        raise InvalidInput(
            f"Export: expected --to {'|'.join(SUFFIXES)} or --output FILE, found neither; add one."
        )
    file = None if is_address(source) else Path(source)
    if file is not None and not file.exists():
        raise InvalidInput(
            f"Export: expected a store or a twin as JSON, found no file {source!r}; check its name."
        )
    to: str | Path = output if output is not None else str(kind)
    of_file = kind if output is not None else None
    if what == "twin":
        if file is not None and file.suffix == ".json":
            twin = load_twin(file)
            against = [] if force else [remark.sentence for remark in twin.remarks if remark.serious]
            if against:
                raise NotTrusted(
                    f"Export: expected a twin without serious remarks, found: {' '.join(against)} Learn from"
                    " more logs, or pass --force."
                )
            made = twin.export(to, kind=of_file, precision=precision, force=force)
        else:
            known = look(source, name, read_only=True).name
            held = with_plain_progress(Campaign.load(source, known, read_only=True), known)
            say_if_changed(source, held, known)
            say_if_unlearnt(source, held, known)
            made = held.export_twin(to, kind=of_file, precision=precision, force=force)
    else:
        if file is not None and file.suffix == ".json":
            raise InvalidInput(
                "Export: expected a store with a campaign, found JSON, which holds a twin alone."
            )
        held, known = opened_to_look(source, name)
        say_if_unlearnt(source, held, known)
        made = held.export_controller(to, kind=of_file, precision=precision, force=force)
    if isinstance(made, str):
        answer({"kind": kind, "text": made}, made.removesuffix("\n"), as_json)
    else:
        files = [str(path) for path in made]
        answer({"kind": kind, "files": files}, f"Wrote {', '.join(files)}.", as_json)
