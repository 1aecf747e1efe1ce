"""What was flown and what will be: coverage, and how the quality hangs on each gain."""

from __future__ import annotations

import math

import numpy as np

from twinloop.campaign.examination.examination import Examination
from twinloop.faces.figures.figure import Figure, Level, Line, Mark, Panel
from twinloop.faces.figures.units import labelled, quality_label, words

DOTS = 500
"""Of one panel at most."""
MOST = 12
"""Panels at most."""


def coverage(found: Examination) -> Figure | None:
    """State against command where it was flown, and the prediction for the controller to fly if there is one."""
    planned = found.planned
    states = np.concatenate([run.states[:-1] for run in found.flown])
    commands = np.concatenate([run.commands for run in found.flown])
    shown = np.unique(np.linspace(0, len(states) - 1, DOTS).astype(int))
    panels = []
    signals = found.signals
    for i in found.moved:
        for j in found.strongest(i):
            x_label, y_label = (
                labelled(each.name, each.unit) for each in (signals.states[i], signals.commands[j])
            )
            low, high = signals.commands[j].bounds
            marks: list[Mark] = [
                Line(
                    states[shown, i],
                    commands[shown, j],
                    "measured",
                    "flown",
                    joined=False,
                    faint=True,
                ),
                Level(low, "limit", "bound of the command"),
                Level(high, "limit"),
            ]
            if planned is not None:
                x, y = planned.states[:-1, i], planned.commands[:, j]
                marks.insert(1, Line(x, y, "twin", "controller to fly"))
            panels.append(
                Panel(
                    f"{words(signals.states[i].name)} × {words(signals.commands[j].name)}",
                    marks,
                    x_label,
                    y_label,
                )
            )
    beyond = found.beyond
    share = f"{100.0 * (beyond or 0.0):.0f} % of the planned flight"
    leaves = (
        "" if beyond is None else f" {share} lies beyond the range that was flown in some state or command."
    )
    return Figure(
        "coverage",
        "Flown range" + (", and the prediction for the controller to fly" if planned else ""),
        panels[:MOST],
        "Beyond the dots the twin extrapolates."
        if planned is None
        else f"Where the line leaves the dots the twin extrapolates.{leaves}",
    )


def gains(found: Examination) -> Figure | None:
    """The quality on the twin against each gain, ± 20 %, or where it is near 0 ± 5 % of its range."""
    if not found.slopes:
        return None
    panels = []
    finite = [q for each in found.slopes for q in each.qualities if q is not None and math.isfinite(q)]
    if not finite:
        return None
    low, high = min(finite), max(finite)
    room = 0.1 * max(high - low, 0.02 * high)
    for each in found.slopes:
        there = [
            (100.0 * change, q)
            for change, q in zip(each.changes, each.qualities, strict=True)
            if q is not None
        ]
        held = f" (at its {each.at_bound} bound)" if each.at_bound else ""
        panels.append(
            Panel(
                f"{each.gain} = {each.value:.4g}{held}",
                [
                    Line(
                        [x for x, _ in there], [y for _, y in there], "twin", "quality on the twin", dots=True
                    )
                ],
                f"change of the gain (%{' of its range' if each.of_range else ''})",
                quality_label(found),
                x_range=(110.0 * each.changes[0], 110.0 * each.changes[-1]),
                y_range=(low - room, high + room),
            )
        )
    none = any(each.of_range for each in found.slopes)
    of_none = (
        " A gain below 1 % of its range is changed by shares of the range: 20 % of nearly nothing would show nothing."
        if none
        else ""
    )
    return Figure(
        "gains",
        "Quality against each gain, ± 20 %",
        panels,
        "One gain at a time, the others held, on the twin without noise. A flat line: the gain need not be"
        f" exact. A line that ends early: the gain is at its bound.{of_none}",
        columns=3,
    )
