"""The exam's results as a page: which version measured them, the bars, and the tables of each system."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop_exam.results import Results
from twinloop_exam.tables import BARS_TITLE, Table, as_markdown, tables

COMMAND = "twinloop bench power --page docs/exam-results.md"


def as_page(results: Results, versions: Sequence[str]) -> str:
    """A page of Markdown; whoever changes it by hand loses what was changed.

    Args:
        results: what was measured.
        versions: of the code that has measured it.

    Returns:
        Text with a last line break.
    """
    found = tables(results)
    bars = [each for each in found if each.title == BARS_TITLE]
    parts = [
        "# The exam's results",
        f"Written by `{COMMAND}` from what the exam's store holds. What is asked, and of whom, is on"
        " [The exam](exam.md).",
        _measured_by(versions),
        "## Bars",
        *(_untitled(each) for each in bars),
    ]
    for system in results.systems:
        of_system = [each for each in found if each.title.startswith(f"{system}:")]
        if of_system:
            parts += [f"## {system}", *(_section(each, system) for each in of_system)]
    return "\n\n".join(parts) + "\n"


def _measured_by(versions: Sequence[str]) -> str:
    if not versions:
        return "Which version of the code has measured them is not known."
    if len(versions) == 1:
        return f"All rows are of one version of the code: {versions[0]}."
    return f"**Rows are of {len(versions)} versions of the code**: {', '.join(versions)}."


def _section(shown: Table, system: str) -> str:
    title = shown.title.removeprefix(f"{system}: ")
    return f"### {title[0].upper()}{title[1:]}\n\n{_untitled(shown)}"


def _untitled(shown: Table) -> str:
    return as_markdown(shown).split("\n\n", 1)[1].strip()
