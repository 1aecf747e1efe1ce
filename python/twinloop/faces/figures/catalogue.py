"""All figures of a campaign, by name, in the order in which they are looked at."""

from __future__ import annotations

from collections.abc import Callable

from twinloop.campaign.examination.examination import Examination
from twinloop.errors import NotAvailable, unknown
from twinloop.faces.figures import flights, learning, loops, residuals, use
from twinloop.faces.figures.figure import Figure

Drawn = Callable[[Examination], Figure | None]
FIGURES: dict[str, Drawn] = {
    "unseen": flights.unseen,
    "autocorrelation": residuals.autocorrelation,
    "crosscorrelation": residuals.crosscorrelation,
    "errors": learning.errors,
    "bode": loops.bode,
    "coverage": use.coverage,
    "complexity": learning.complexity,
    "step": flights.step,
    "nyquist": loops.nyquist,
    "sensitivities": loops.sensitivities,
    "closed": loops.closed,
    "gains": use.gains,
    "qualities": learning.qualities,
    "flights": flights.flights,
}
TWIN = ("unseen", "autocorrelation", "crosscorrelation", "errors", "bode", "coverage", "complexity")
CONTROLLER = ("step", "nyquist", "sensitivities", "closed", "gains")
CAMPAIGN = ("qualities", "flights")


def figure(found: Examination, name: str) -> Figure | None:
    """One figure of a campaign.

    Args:
        found: its examination.
        name: of the figure.

    Returns:
        The figure; None where the campaign has nothing to show there.

    Raises:
        InvalidInput: no such figure.
    """
    if name not in FIGURES:
        raise unknown("figure", name, FIGURES)
    return FIGURES[name](found)


def asked(found: Examination, name: str) -> Figure:
    """One figure that somebody asks for.

    Args:
        found: the examination of a campaign.
        name: of the figure.

    Raises:
        InvalidInput: no such figure.
        NotAvailable: the campaign has nothing to show there.
    """
    drawn = figure(found, name)
    if drawn is None:
        raise NotAvailable(
            f"Figure {name!r}: expected a campaign that has something to show there, found none, such as no flight that"
            " was not learnt, no noise, or no controller to fly; campaign.checks() says what is missing."
        )
    return drawn
