"""Innovations: correlated with themselves, and with each command before them."""

from __future__ import annotations

import numpy as np

from twinloop.campaign.examination.examination import Examination
from twinloop.faces.figures.figure import Bars, Figure, Level, Line, Panel
from twinloop.faces.figures.units import words

ROLES = ("a", "b", "c", "d", "e", "f")


def autocorrelation(found: Examination) -> Figure | None:
    """Of the innovations of each state, with 99 % limits."""
    own = found.autocorrelation
    if own is None:
        return None
    panels = [
        Panel(
            words(state.name),
            (
                Bars(own.lags[1:], own.values[i, 1:], "a", "correlation", 0.5),
                Level(own.limit, "limit", "99 % limit"),
                Level(-own.limit, "limit"),
            ),
            "lag (periods)",
            "correlation",
            y_range=_ends(own.values[i, 1:], own.limit),
            whole=True,
        )
        for i, state in enumerate(found.signals.states)
        if own.told[i]
    ]
    return Figure(
        "autocorrelation",
        "Autocorrelation of the innovations",
        panels,
        f"Errors of the prediction one period ahead, over {own.count} readings a state. For a complete twin"
        f" one bar in a hundred is outside the limits; here {100.0 * own.outside:.0f} % are outside.",
    )


def crosscorrelation(found: Examination) -> Figure | None:
    """Of the innovations of each state with each command before."""
    both = found.crosscorrelation
    if both is None:
        return None
    panels = []
    for i, state in enumerate(found.signals.states):
        if not both.told[i].any():
            continue
        lines = tuple(
            Line(both.lags, both.values[i, j], ROLES[j % len(ROLES)], words(command.name), dots=True)
            for j, command in enumerate(found.signals.commands)
        )
        # Grey: a command may have the colour of a limit.
        limits = (Level(both.limit, "target", "99 % limit"), Level(-both.limit, "target"))
        ends = _ends(both.values[i], both.limit)
        panels.append(
            Panel(
                words(state.name),
                (*lines, *limits),
                "command, periods before",
                "correlation",
                y_range=ends,
                whole=True,
            )
        )
    return Figure(
        "crosscorrelation",
        "Correlation of the innovations with earlier commands",
        panels,
        "This counts more: where it is large, the command acts in a way that the twin lacks. "
        f"{100.0 * both.outside:.0f} % are beyond the limits.",
    )


def _ends(values: np.ndarray, limit: float) -> tuple[float, float]:
    most = 1.15 * max(float(np.abs(values).max(initial=0.0)), 1.6 * limit)
    return -min(most, 1.05), min(most, 1.05)
