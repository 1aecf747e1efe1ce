"""The page: everything that is shown, handed to a template that escapes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from importlib import resources
from typing import Any

from twinloop import _core
from twinloop._experiment.envelope import is_bounded
from twinloop.campaign import Campaign
from twinloop.campaign.examination.checking import checks
from twinloop.campaign.examination.examination import Examination
from twinloop.errors import NotAvailable
from twinloop.faces.figures.catalogue import CAMPAIGN, CONTROLLER, FIGURES, TWIN
from twinloop.faces.figures.figure import Figure
from twinloop.faces.figures.style import DARK, LIGHT, RULES, SCROLL, variables
from twinloop.faces.figures.svg import panel_svg
from twinloop.faces.figures.units import words
from twinloop.faces.report.cost import cost_table
from twinloop.faces.report.moot import moot
from twinloop.faces.report.source import OWN, Source
from twinloop.faces.report.tables import controller as of_controller
from twinloop.faces.report.tables import flights as of_flights
from twinloop.faces.report.tables import twin as of_twin
from twinloop.faces.report.tables.table import Table, shown_spread
from twinloop.faces.result import summary
from twinloop.faces.telling import awaited
from twinloop.faces.text.controller import advice_words
from twinloop.faces.verdict import evidence, verdict
from twinloop.planning.leaving import risk_words

UNNAMED = "campaign"
"""The name of a campaign that nobody has named."""


def templates() -> Any:
    """Jinja's environment of the package's own templates; all that is put into them is escaped.

    Raises:
        NotAvailable: Jinja2 is missing.
    """
    try:
        import jinja2
    except ImportError as missing:
        raise NotAvailable(
            "Reports need Jinja2, which is not installed: pip install 'twinloop[report]'."
        ) from missing
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=jinja2.FunctionLoader(_source),
    )  # fmt: skip
    # Drawings are made by an XML library, which has escaped what stands in them.
    environment.globals["draw"] = lambda panel: _markup(panel_svg(panel))
    environment.globals["style"] = _markup(style())
    environment.globals["script"] = _markup(_source("page.js"))
    return environment


def style() -> str:
    """The style sheet of pages and figures, light and dark."""
    themes = (
        f":root{{color-scheme:light dark;{variables(LIGHT)}}}"
        f"@media (prefers-color-scheme:dark){{:root{{{variables(DARK)}}}}}"
        f"@media print{{:root{{{variables(LIGHT)}}}}}"
    )
    return themes + RULES + SCROLL + _source("page.css")


def report_page(
    campaign: Campaign, name: str, system: Mapping[str, object], run_info: Mapping[str, object],
    sessions: Sequence[Mapping[str, Any]] = (), controller: bool = True, elapsed: float | None = None,
) -> str:  # fmt: skip
    """The report of a campaign.

    Args:
        campaign: with at least one run.
        name: of the campaign, for its title.
        system: what was experimented on.
        run_info: of the process that makes the report.
        sessions: that have worked on the campaign, where a store knows them.
        controller: whether a controller was to be tuned; otherwise the page is about the twin alone.
        elapsed: seconds on the clock from the beginning of the campaign to its last flight, where a store knows them.

    Returns:
        One page of HTML that needs nothing else.

    Raises:
        NotAvailable: nothing was told, or Jinja2 is missing.
    """
    template = templates().get_template("page.html")
    found = campaign.examine()
    result, checked = summary(campaign, system, run_info, found), checks(found)
    if not controller:
        found.best = None
    text: str = template.render(
        name=_title(campaign, name, str(system["name"])),
        result=result,
        system=OWN if system["name"] == UNNAMED else system["name"],
        unlearnt=len(found.experiments) - found.learnt,
        tuned=controller,
        verdict=verdict(found, checked, result)[: None if controller else 1],
        checks=[check for check in checked if controller or check.subject == "twin"],
        evidence=evidence(found),
        moot=moot(found),
        equations="\n".join(result["twin"]["equations"]),  # type: ignore[call-overload,index,arg-type]
        remarks=campaign.twin.remarks,
        twin_figures=_figures(found, TWIN),
        controller_figures=_figures(found, CONTROLLER if controller else ()),
        campaign_figures=_figures(found, CAMPAIGN),
        twin_tables=_present(
            of_twin.states(result), of_twin.disturbances(result), of_twin.actuators(result), of_twin.rivals(found),
            *of_twin.poles(found, controller), of_twin.ranges(found),
        ),
        controller_tables=_present(
            of_controller.gains(result), of_controller.margins(found), of_controller.steps(found),
            of_controller.effort(found), of_controller.envelope(found), *of_twin.closed_poles(found),
        ) if controller else [],
        campaign_tables=_present(
            *((cost_table(result, elapsed), of_flights.flights(found, result)) if controller else ()),
            of_flights.data(found),
        ),
        next=_next(campaign, result),
        risk=partial(risk_words, bounded=is_bounded(found.signals)),
        spread=shown_spread,
        failures=campaign.failures,
        withdrawals=result["withdrawn"],
        sessions=sessions,
        version=_core.__version__,
    )  # fmt: skip
    return text


def source_page(found: Source) -> str:
    """The report of a campaign from where it is kept.

    Args:
        found: the campaign with what is known about it.

    Returns:
        One page of HTML that needs nothing else.
    """
    system = {"name": found.system}
    return report_page(found.campaign, found.name, system, {}, found.sessions, elapsed=found.elapsed)


def _title(campaign: Campaign, name: str, system: str) -> str:
    """What a campaign is called: by its own name, else by its system's, else by its states."""
    for known in (name, system):
        if known not in (UNNAMED, OWN):
            return known
    return ", ".join(words(state) for state in campaign.signals.state_names)


def _present(*found: Table | None) -> list[Table]:
    return [table for table in found if table is not None]


def _figures(found: Examination, names: Sequence[str]) -> list[Figure]:
    drawn = (FIGURES[name](found) for name in names)
    return [figure for figure in drawn if figure is not None]


def _next(campaign: Campaign, result: Mapping[str, Any]) -> dict[str, object]:
    """What is waiting to be flown, and what another flight would bring."""
    known = "advice" in result and result["advice"]["gain"] is not None
    return {
        "waiting": awaited(campaign),
        "words": advice_words(result) if known else "",
        "flights": campaign.setup.predicted_flights,
    }


def _source(name: str) -> str:
    return resources.files("twinloop.faces.report").joinpath(name).read_text(encoding="utf-8")


def _markup(text: str) -> Any:
    from markupsafe import Markup

    return Markup(text)
