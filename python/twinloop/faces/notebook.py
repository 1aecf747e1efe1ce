"""What a notebook shows of a campaign, a twin, a test and a trajectory: HTML without scripts, all names escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from twinloop.campaign import Campaign
from twinloop.campaign.examination.checking import checks
from twinloop.faces.figures.figure import Band, Figure, Line, Panel
from twinloop.faces.figures.svg import drawing
from twinloop.faces.result import summary
from twinloop.faces.text import cell, verdict
from twinloop.law.twin import Twin
from twinloop.test import Test
from twinloop.trajectory import Trajectory


def html(value: object) -> str:
    """A value as HTML.

    Args:
        value: a campaign, a twin, a test or a trajectory.

    Raises:
        TypeError: something else.
    """
    if isinstance(value, Campaign):
        return _campaign(value)
    if isinstance(value, Twin):
        return _twin(value)
    if isinstance(value, Test):
        return _test(value)
    if isinstance(value, Trajectory):
        return drawing(trajectory(value))
    raise TypeError(f"expected a campaign, a twin, a test or a trajectory, found {type(value).__name__}")


def _campaign(campaign: Campaign) -> str:
    if not campaign.experiments:
        return f"<p>{escape(repr(campaign))}: nothing was told yet.</p>"
    found = campaign.examine()
    lines = verdict(summary(campaign, {"name": "campaign"}, {}, found), "below.").splitlines()
    said = "".join(f"<p>{escape(line)}</p>" for line in lines)
    rows = [[check.verdict, check.name, check.sentence] for check in checks(found)]
    return said + _table(["", "check", "what was found"], rows)


def _twin(twin: Twin) -> str:
    rows = [[row.run, row.open_loop, row.closed_loop, row.normalised, row.before] for row in twin.errors]
    head = ["test", "one step", "whole flight", "normalised", "before it was learnt"]
    return f"<pre>{escape(twin.equations())}</pre>" + _table(head, rows)


def _test(test: Test) -> str:
    gains = [[name, value] for name, value in test.parameters.items()]
    predicted = (
        "" if test.predicted is None else f", quality {cell(test.predicted)} ± {cell(test.spread)} predicted"
    )
    flown = "" if test.measured is None else f", {cell(test.measured)} flown"
    excited = ", excited" if test.excitation is not None else ""
    words = f"Test {test.number}: {test.steps} steps{excited}{predicted}{flown}. {test.reason}".strip()
    return f"<p>{escape(words)}</p>" + _table(["gain", "value"], gains)


def trajectory(run: Trajectory) -> Figure:
    """A run: every state and command over time.

    Args:
        run: recorded or simulated.
    """
    panels = []
    for i in range(run.states.shape[1]):
        band = (
            []
            if run.band is None
            else [Band(run.t, run.band[0, :, i], run.band[1, :, i], "twin", "90 % band")]
        )
        panels.append(Panel(f"state {i + 1}", [*band, Line(run.t, run.states[:, i], "a")], "time (s)"))
    for j in range(run.commands.shape[1]):
        held = np.append(run.commands[:, j], run.commands[-1:, j])
        panels.append(Panel(f"command {j + 1}", [Line(run.t, held, "c", steps=True)], "time (s)"))
    reason = f": {run.reason}" if run.reason else ""
    return Figure("trajectory", f"{run.steps} steps, {run.ended}{reason}", panels)


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    first = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell(value))}</td>" for value in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{first}</tr></thead><tbody>{body}</tbody></table>"
