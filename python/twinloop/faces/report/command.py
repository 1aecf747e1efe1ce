"""The commands `twinloop report` and `twinloop compare`."""

from __future__ import annotations

from pathlib import Path

import click

from twinloop._ground.writing import write_whole
from twinloop.errors import InvalidInput
from twinloop.faces.answering import answer, json_option, name_option
from twinloop.faces.figures.catalogue import FIGURES
from twinloop.faces.figures.saving import FORMATS, check_format, picture
from twinloop.faces.files import check_writable
from twinloop.faces.opening import say_if_changed, say_if_unlearnt, with_plain_progress
from twinloop.faces.report.alike import not_comparable, task_differences
from twinloop.faces.report.comparison import compared, comparison, comparison_page
from twinloop.faces.report.page import source_page, templates
from twinloop.faces.report.source import Source, source
from twinloop.faces.text import table
from twinloop.store import shown_name


@click.command()
@click.argument("campaign")
@name_option
@click.option(
    "-o", "--output", type=Path, metavar="FILE.html|FOLDER", help="File to write; by default report.html."
)
@click.option(
    "--format", "form", help=f"Instead of the page, all figures as files in FOLDER: {', '.join(FORMATS)}."
)
@json_option
def report(campaign: str, name: str | None, output: Path | None, form: str | None, as_json: bool) -> None:
    """Write an HTML report on CAMPAIGN, a store or a record in a file: what to trust, and why."""
    if form is not None:
        files = _figures(campaign, name, output or Path("figures"), form)
        answer({"files": files}, "\n".join(f"Figure: {file}" for file in files), as_json, err=True)
        return
    path = Path("report.html") if output is None else output
    check_writable(path, [".html"])
    templates()  # what is missing is said before any work
    found = _opened(campaign, name)
    text = source_page(found)
    write_whole(path, text)
    answer({"files": [str(path)]}, f"Report: {path}", as_json, err=True)


def _opened(where: str, name: str | None) -> Source:
    """A campaign to look at; what it was begun with, what is not kept, and its progress are said beside it."""
    found = source(where, name)
    say_if_changed(where, found.campaign, found.name)
    if found.sessions and not found.campaign.interrupted:  # a record in a file has none, and nothing keeps it
        say_if_unlearnt(where, found.campaign, found.name)
    with_plain_progress(found.campaign, found.name)
    return found


def _figures(campaign: str, name: str | None, folder: Path, form: str) -> list[str]:
    check_format(form)
    if not folder.is_dir():
        if folder.exists() or not folder.parent.is_dir():
            raise InvalidInput(
                f"Folder {str(folder)!r}: expected a folder for the figures, or a place to make it in, found none; name"
                " another one."
            )
        folder.mkdir()
    found = _opened(campaign, name)
    examined, files = found.campaign.examine(), []
    for figure_name, drawn in FIGURES.items():
        figure = drawn(examined)
        if figure is not None:
            path = folder / f"{figure_name}.{form}"
            write_whole(path, picture(figure, form))
            files.append(str(path))
    return files


@click.command()
@click.argument("first")
@click.argument("second")
@click.option(
    "--name",
    "names",
    multiple=True,
    help="Name of the campaign in each store, if they hold several; give it twice.",
)
@click.option("-o", "--output", type=Path, metavar="FILE.html", help="Also write an HTML page.")
@json_option
def compare(first: str, second: str, names: tuple[str, ...], output: Path | None, as_json: bool) -> None:
    """Compare two campaigns, FIRST and SECOND: stores, or records in files."""
    if len(names) not in (0, 1, 2):
        raise InvalidInput(f"--name: expected it at most twice, found {len(names)} of them.")
    if output is not None:
        check_writable(output, [".html"])
        templates()
    chosen = (names or (None,)) * 2 if len(names) < 2 else names
    sources = [_opened(where, name) for where, name in zip((first, second), chosen, strict=False)]
    names_shown, answers = [each.name for each in sources], compared(sources)
    if len(set(names_shown)) == 1:  # such as "campaign", which each has that nobody named
        names_shown = [shown_name(where) for where in (first, second)]
    note = not_comparable(list(task_differences([each.campaign.setup for each in sources])))
    found = comparison(names_shown, answers, note)
    words = table(list(found.head), found.rows) + (f"\n{note}" if note else "")
    answer({"campaigns": names_shown, "answers": answers, "not_comparable": note}, words, as_json)
    if output is not None:
        write_whole(output, comparison_page(found))
        click.echo(f"Page: {output}", err=True)
