"""Two campaigns side by side: what each twin is worth, and what each controller promises and has shown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from twinloop import _core
from twinloop._experiment.envelope import is_bounded
from twinloop.campaign.assessment import number_of, predicted_quality
from twinloop.campaign.examination.checking import checks
from twinloop.faces.figures.units import labelled, words
from twinloop.faces.report.alike import task_differences
from twinloop.faces.report.page import templates
from twinloop.faces.report.source import Source
from twinloop.faces.report.tables.table import Table, shown_value
from twinloop.faces.text.words import controller_name
from twinloop.planning.leaving import risk_of_what, short_risk
from twinloop.planning.quality import quality_unit

Row = tuple[str, object]


def compared(sources: Sequence[Source]) -> dict[str, list[object]]:
    """By question what each campaign answers, None where it does not.

    Args:
        sources: at least one.

    Returns:
        Also in what their tasks and qualities differ; where they do, no quality is said to be the better one.
    """
    differences = task_differences([source.campaign.setup for source in sources])
    better = "" if differences else ", lower is better"
    answers = [dict(_answers(source, better)) for source in sources]
    questions = list(dict.fromkeys(question for each in answers for question in each))
    found = {question: [each.get(question) for each in answers] for question in questions}
    before = questions.index("twin")
    return {
        **{question: found[question] for question in questions[:before]},
        **differences,
        **{question: found[question] for question in questions[before:]},
    }


def comparison(names: Sequence[str], found: Mapping[str, Sequence[object]], note: str = "") -> Table:
    """A row a question, a column a campaign.

    Args:
        names: of the campaigns.
        found: what they answer.
        note: on what cannot be compared; empty where everything can.
    """
    rows = [[question, *(shown_value(value) for value in values)] for question, values in found.items()]
    return Table("comparison", "Side by side", ["", *names], rows, note)


def comparison_page(table: Table) -> str:
    """The same as one page of HTML.

    Args:
        table: of the campaigns.

    Raises:
        NotAvailable: Jinja2 is missing.
    """
    text: str = (
        templates()
        .get_template("compare.html")
        .render(title=" against ".join(table.head[1:]), table=table, version=_core.__version__)
    )
    return text


def _answers(source: Source, better: str) -> list[Row]:
    campaign = source.campaign
    found = campaign.examine()
    judged = checks(found)
    best, first = found.best, found.first_flown
    unit = quality_unit(campaign.setup.quality)
    unit = f" ({unit})" if unit else ""
    rows: list[Row] = [
        ("system", source.system),
        ("preset, seed", f"{campaign.setup.preset}, {campaign.setup.seed}"),
        ("experiments", len(found.experiments)),
        ("twin", "trust it" if judged.twin_passed else "do not trust it"),
        ("checks that fail", ", ".join(check.name for check in judged.failed) or "none"),
    ]
    if found.unseen:
        last = found.unseen[-1]
        rows.append(("error on the last unseen flight (0 perfect, 1 useless)", last.error))
        rows += [
            (f"FIT of it, {words(state.name)} (%)", float(last.fit[i]))
            for i, state in enumerate(found.signals.states)
        ]
    rmse = campaign.rmse
    for state, error in zip(found.signals.states, rmse.tolist(), strict=True):
        rows.append((f"error of whole flights, {labelled(state.name, state.unit)}", error))
    rows.append(("controller", "none" if best is None else controller_name(number_of(campaign, best))))
    if best is not None:
        predicted, spread = predicted_quality(best, found.experiments)
        rows += [
            (f"quality predicted{unit}{better}", predicted),
            (f"± spread{unit}", spread),
            (f"quality flown{unit}", best.measured),
            (
                f"risk of {risk_of_what(is_bounded(found.signals))}",
                short_risk(best.risk, campaign.setup.predicted_flights),
            ),
        ]
    rows.append((f"quality of the first gains, flown{unit}", None if first is None else first.quality))
    if found.margins is not None and found.twin.follows:
        worst = found.margins.worst
        gain = min(loop.gain for loop in worst)
        if all(loop.stable for loop in worst):
            rows += [
                ("worst gain margin (dB)", 20.0 * math.log10(gain)),
                ("worst phase margin (°)", math.degrees(min(loop.phase for loop in worst))),
                ("worst delay margin (ms)", 1e3 * min(loop.delay for loop in worst)),
                ("largest Ms", max(loop.sensitivity for loop in worst)),
            ]
        else:
            rows.append(("margins", "none: a loop is unstable"))
    if best is not None:
        units = {gain.name: f" ({gain.unit})" for gain in campaign.family.law_gains if gain.unit}
        rows += [(f"gain {name}{units.get(name, '')}", value) for name, value in best.parameters.items()]
    return rows
