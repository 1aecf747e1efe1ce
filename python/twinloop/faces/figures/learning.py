"""How the campaign learnt: errors before and after, predicted and flown qualities, equations that were considered."""

from __future__ import annotations

import math

import numpy as np

from twinloop.campaign.assessment import predicted_quality
from twinloop.campaign.examination.examination import Examination
from twinloop.faces.figures.figure import Cells, Figure, Level, Line, Mark, Panel, Spans
from twinloop.faces.figures.units import quality_label, words

LIGHTEST, DARKEST = -5.0, 0.0
"""Decades of the normalised error from which a cell is lightest, and at which it is darkest."""


def errors(found: Examination) -> Figure:
    """Error of each twin on each flight; framed: before the flight was learnt (Figure 6 of the paper as a map)."""
    by_twin = found.errors
    with np.errstate(divide="ignore", invalid="ignore"):
        decades = np.log10(by_twin.values)
    shades = np.clip((decades - LIGHTEST) / (DARKEST - LIGHTEST), 0.0, 1.0)
    shades[np.isinf(by_twin.values)] = 1.0
    texts = [[_said(value) for value in row] for row in by_twin.values]
    marked = [(i, j) for i, j in np.ndindex(by_twin.values.shape) if texts[i][j] and not by_twin.learnt[i, j]]
    return Figure(
        "errors",
        "Error of the twin on each flight, experiment by experiment",
        [
            Panel(
                "Error over that of a model that never moves",
                [
                    Cells(
                        np.where(np.isnan(shades), 0.0, shades),
                        texts,
                        found.names,
                        [str(number) for number in by_twin.iterations],
                        marked,
                    )
                ],
                "identification (experiments learnt)",
            )
        ],
        "Mean squares of whole flights: 0 is perfect, 1 is useless, ∞ diverged. Framed cells are flights that"
        " the twin had not learnt from: judge it by these.",
        columns=1,
    )


def _said(value: float) -> str:
    if math.isnan(value):
        return ""
    return f"{value:.1g}" if math.isfinite(value) else "∞"


def qualities(found: Examination) -> Figure | None:
    """Qualities as predicted, with what they were expected to scatter, and as flown."""
    numbered = [(run.test.number, run.quality, run.test) for run in found.experiments if run.test is not None]
    flown = [(number, quality) for number, quality, _ in numbered if quality is not None]
    predictions = [
        (number, test.predicted, test.spread or 0.0)
        for number, _, test in numbered
        if test.predicted is not None and math.isfinite(test.predicted)
    ]
    if not flown and not predictions:
        return None
    marks: list[Mark] = [
        Line([n for n, _ in flown], [q for _, q in flown], "measured", "flown", dots=True),
        Spans(
            [n + 0.1 for n, _, _ in predictions],
            [q - 2 * s for _, q, s in predictions],
            [q + 2 * s for _, q, s in predictions],
            "twin",
        ),
        Line(
            [n + 0.1 for n, _, _ in predictions],
            [q for _, q, _ in predictions],
            "twin",
            "predicted ± 2 spreads",
            joined=False,
        ),
    ]
    best = found.best
    predicted = None if best is None else predicted_quality(best, found.experiments)[0]
    if predicted is not None and math.isfinite(predicted):
        marks.append(Level(predicted, "target", "controller to fly, predicted"))
    most = max([q for _, q in flown] + [q + 2 * s for _, q, s in predictions] + [0.0])
    main = Panel(
        "Quality of each flight (lower is better)",
        marks,
        "test",
        quality_label(found),
        y_range=(0.0, 1.1 * most or 1.0),
        whole=True,
    )
    missed = [(n, (p - q) / s) for n, p, s in predictions for m, q in flown if m == n and s > 0.0]
    panels = [main]
    if missed:
        values = [value for _, value in missed]
        reach = 1.2 * max(3.0, *(abs(value) for value in values))
        panels.append(
            Panel(
                "Predicted − flown, in spreads",
                [
                    Line([n for n, _ in missed], values, "twin", joined=False),
                    Level(0.0, "target"),
                    Level(2.0, "limit", "2 spreads"),
                    Level(-2.0, "limit"),
                ],
                "test",
                "spreads",
                y_range=(-reach, reach),
                whole=True,
            )
        )
    return Figure("qualities", "Qualities, predicted and flown", panels, columns=2)


def complexity(found: Examination) -> Figure | None:
    """Terms against description length of the sums that were considered for each state; the choice is marked."""
    states = list(dict.fromkeys(rival.state for rival in found.rivals))
    panels = []
    for state in states:
        rivals = [rival for rival in found.rivals if rival.state == state]
        if len(rivals) < 2:
            continue
        others = [rival for rival in rivals if not rival.chosen]
        chosen = [rival for rival in rivals if rival.chosen]
        marks: list[Mark] = [
            Line(
                [len(r.terms) for r in others],
                [r.above for r in others],
                "a",
                "considered",
                joined=False,
                faint=True,
            ),
            Line([len(r.terms) for r in chosen], [0.0 for _ in chosen], "limit", "chosen", joined=False),
            Level(10.0, "target", "10: the flights contradict it"),
        ]
        most = max(r.above for r in rivals)
        panels.append(
            Panel(
                f"Equation of {words(state)}",
                marks,
                "terms",
                "above the chosen (χ²)",
                y_range=(-1.5, max(14.0, 1.08 * most)),
                whole=True,
            )
        )
    if not panels:
        return None
    return Figure(
        "complexity",
        "Complexity against error",
        panels,
        "Each dot is a sum of terms that annealing considered, with the increase in description length, which counts"
        " the error and the number of terms. Dots below the line are rivals that the flights hardly distinguish.",
    )
