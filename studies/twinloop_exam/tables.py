"""The exam's tables out of what a store holds: as text, as Markdown, or as one JSON object."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from twinloop.faces.result import to_json
from twinloop.faces.text import table
from twinloop_exam.bars import BARS
from twinloop_exam.measures import number
from twinloop_exam.results import Results, Spread, spread
from twinloop_exam.systems import subject

FORMATS = ("text", "markdown", "json")
BARS_TITLE = "Bars"
COLUMNS = (0, 1, 2, 3, 4, 6, 9, 10, 15, 19, 20)
"""Experiments after Υ0 that have a column, where they were measured."""
MEASURES = (
    "error_median",
    "error_p90",
    "diverged",
    "quality",
    "flown_quality",
    "violated",
    "ask_seconds",
    "learn_seconds",
    "terms",
    "predicted_minus_flown",
    "coverage",
)


@dataclass(frozen=True)
class Table:
    """One table.

    Args:
        title: of the table.
        head: of the columns.
        rows: of texts.
        notes: how to read it.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()


def render(results: Results, form: str) -> str:
    """All tables.

    Args:
        results: what was measured.
        form: "text", "markdown" or "json".

    Returns:
        Text with a last line break.
    """
    if form == "json":
        return to_json({"cells": _cells(results), "bars": _bars_as_values(results)})
    show = as_markdown if form == "markdown" else as_text
    return "\n\n".join(show(each) for each in tables(results)) + "\n"


def tables(results: Results) -> list[Table]:
    """Every table that has a row.

    Args:
        results: what was measured.
    """
    found = []
    for system in results.systems:
        measured = [who for who in results.learners if results.rows(system, who)]
        ablated = [who for who in measured if who.startswith("without-")]
        others = [who for who in measured if who not in ablated]
        found += [_held_out(results, system, others), _controllers(results, system, others)]
        found += [_conduct(results, system, others)]
        if ablated:
            found.append(_ablations(results, system, ["ours", *ablated]))
    found.append(_bars(results))
    return [each for each in found if each.rows or each.title == BARS_TITLE]


def _held_out(results: Results, system: str, learners: Sequence[str]) -> Table:
    learners = [who for who in learners if _has_twin(results, system, who)]
    columns = _columns(results, system, learners)
    rows = [
        [
            who,
            *(_error_cell(results, system, who, k) for k in columns),
            _diverged(results, system, who, columns),
        ]
        for who in learners
    ]
    notes = (
        "Cells: median over seeds of the median / of the 90th percentile over 100 held-out controllers,"
        " [quartiles over seeds of the median], number of seeds. 1 is a model that never moves. Medians and percentiles"
        " are of ranks, in which a run that diverges comes last. The last column: how many of the 100 diverge, median"
        " over seeds, for each of the columns before, or for all of them.",
    )
    head = [*_headed(columns), "of 100 diverge"]
    return Table(f"{system}: normalised error on held-out controllers", head, rows, notes)


def _diverged(results: Results, system: str, learner: str, columns: Sequence[int]) -> str:
    """How many of the held-out runs diverge, for each column."""
    counts = [spread(results.values(system, learner, "diverged", k)) for k in columns]
    shown = ["–" if count is None else f"{count.median:g}" for count in counts]
    return shown[0] if len(set(shown)) == 1 else ", ".join(shown)


def _has_twin(results: Results, system: str, learner: str) -> bool:
    if learner in ("optimum", "random-gains"):
        return False
    failed = any(row.failure is not None for row in results.rows(system, learner))
    return failed or bool(results.all_values(system, learner, "error_median"))


def _error_cell(results: Results, system: str, learner: str, k: int) -> str:
    middle = spread(results.values(system, learner, "error_median", k))
    upper = spread(results.values(system, learner, "error_p90", k))
    failed = results.failures(system, learner, k)
    if middle is None or upper is None:
        return f"– ({failed} failed)" if failed else "–"
    shown = [number(value, 2) for value in (middle.median, upper.median, middle.low, middle.high)]
    text = "{} / {} [{}, {}]".format(*shown)
    return f"{text} {_seeds(middle, failed)}"


def _controllers(results: Results, system: str, learners: Sequence[str]) -> Table:
    learners = [who for who in learners if results.all_values(system, who, "quality")]
    flying = [who for who in learners if who != "optimum"]
    columns = _columns(results, system, flying or learners)
    rows = []
    for who in flying:
        cells = []
        for k in columns:
            found = spread(results.values(system, who, "quality", k))
            failed = results.failures(system, who, k)
            cells.append(_spread_cell(found, failed))
        rows.append([who, *cells])
    if not rows and "optimum" not in learners:
        return Table("", [], [])
    judged = subject(system)
    first = next((results.values(system, who, "flown_quality", 0) for who in flying), {})
    best = results.values(system, "optimum", "quality")
    notes = [
        f"Cells: {_quality_name(judged.quality)} of the true states with the controller to fly; median over"
        " seeds, [quartiles], number of seeds. Flights are experiments and Υ0: k + 1.",
        f"Doing nothing: {judged.nothing:.3g}. C0: {_plain(spread(first))}. Optimum (CMA-ES on the true"
        f" system): {_plain(spread(best))}.",
    ]
    return Table(f"{system}: controller to fly", _headed(columns), rows, notes)


def _conduct(results: Results, system: str, learners: Sequence[str]) -> Table:
    rows = []
    for who in learners:
        violated = results.all_values(system, who, "violated")
        asked = spread(results.all_values(system, who, "ask_seconds"))
        learnt = spread(results.all_values(system, who, "learn_seconds"))
        if not violated and learnt is None:
            continue
        gaps = [abs(value) for value in results.all_values(system, who, "predicted_minus_flown")]
        rows.append(
            [
                who,
                f"{sum(violated):.0f} of {len(violated)}" if violated else "–",
                "–" if asked is None else f"{asked.median:.2g} / {asked.most:.2g}",
                "–" if learnt is None else f"{learnt.median:.2g} / {learnt.most:.2g}",
                _plain(spread(results.values(system, who, "terms"))),
                _plain(spread(gaps)),
                _plain(spread(results.all_values(system, who, "coverage"))),
            ]
        )
    head = [
        "learner",
        "left envelope",
        "ask, s",
        "learn, s",
        "terms at the end",
        "|predicted − flown|",
        "in 90 % band",
    ]
    notes = ("Seconds of processors: median / largest. The others: medians over seeds and experiments.",)
    return Table(f"{system}: safety, time, size, honesty", head, rows, notes)


def _ablations(results: Results, system: str, learners: Sequence[str]) -> Table:
    rows = []
    results = results.at(results.shared_seeds(system, learners))
    for who in learners:
        cells = [_error_cell(results, system, who, k) for k in (1, 2)]
        cells += [
            _spread_cell(spread(results.values(system, who, "quality", k)), results.failures(system, who, k))
            for k in (1, 2)
        ]
        rows.append([who, *cells])
    head = ["option off", "error, Υ0 + 1", "error, Υ0 + 2", "controller, Υ0 + 1", "controller, Υ0 + 2"]
    notes = ("All rows are of the same seeds, those with which each was measured.",)
    return Table(f"{system}: ablations", head, rows, notes)


def _bars(results: Results) -> Table:
    rows = []
    for bar in BARS:
        if bar.system in results.systems and (verdict := bar.judge(results)) is not None:
            rows.append([bar.system, bar.text, bar.limit, verdict[0], "yes" if verdict[1] else "NO"])
    missing = sum(bar.judge(results) is None for bar in BARS if bar.system in results.systems)
    notes = (f"{missing} bars of these systems are not measured.",) if missing else ()
    return Table(BARS_TITLE, ["system", "measure", "bar", "measured", "met"], rows, notes)


def _cells(results: Results) -> list[dict[str, object]]:
    cells: list[dict[str, object]] = []
    for system in results.systems:
        for who in results.learners:
            for k in results.experiments(system, who):
                failed = results.failures(system, who, k)
                measures = {
                    name: dataclasses.asdict(found)
                    for name in MEASURES
                    if (found := spread(results.values(system, who, name, k))) is not None
                }
                cells.append({"system": system, "learner": who, "k": k, "failed": failed, **measures})
    return cells


def _bars_as_values(results: Results) -> list[dict[str, object]]:
    values: list[dict[str, object]] = []
    for bar in BARS:
        verdict = bar.judge(results) if bar.system in results.systems else None
        measured, met = (None, None) if verdict is None else verdict
        values.append(
            {"system": bar.system, "measure": bar.text, "bar": bar.limit, "measured": measured, "met": met}
        )
    return values


def _columns(results: Results, system: str, learners: Sequence[str]) -> list[int]:
    measured = {k for who in learners for k in results.experiments(system, who)}
    return [k for k in COLUMNS if k in measured]


def _headed(columns: Sequence[int]) -> list[str]:
    return ["after Υ0 +", *(str(k) for k in columns)]


def _spread_cell(found: Spread | None, failed: int) -> str:
    if found is None:
        return f"– ({failed} failed)" if failed else "–"
    return f"{found.median:.3g} [{found.low:.3g}, {found.high:.3g}] {_seeds(found, failed)}"


def _seeds(found: Spread, failed: int) -> str:
    return f"({found.seeds}, {failed} failed)" if failed else f"({found.seeds})"


def _plain(found: Spread | None) -> str:
    return "–" if found is None else f"{found.median:.3g}"


def _quality_name(kind: str) -> str:
    return (
        "distance at the end"
        if kind == "final_distance"
        else "integrated absolute error of the angles, rad s,"
    )


def as_text(shown: Table) -> str:
    """A table for a terminal.

    Args:
        shown: the table.
    """
    return "\n".join([shown.title, table(shown.head, shown.rows), *shown.notes])


def as_markdown(shown: Table) -> str:
    """A table for a page.

    Args:
        shown: the table.
    """
    lines = [" | ".join(cell.replace("|", "\\|") for cell in row) for row in (shown.head, *shown.rows)]
    lines.insert(1, " | ".join("---" for _ in shown.head))
    return "\n".join([f"**{shown.title}**", "", *(f"| {line} |" for line in lines), "", *shown.notes])
