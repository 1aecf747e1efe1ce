"""Flights beside the twin: those that it had not learnt, and all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit
from twinloop.campaign.examination.beside import Beside
from twinloop.campaign.examination.examination import Examination
from twinloop.faces.figures.figure import Band, Figure, Level, Line, Mark, Panel
from twinloop.faces.figures.units import labelled, shortened, words
from twinloop.faces.text.words import every, flown_words
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory, continued

MOST = 6
"""Flights of one figure: the last ones."""


def _earlier(found: Examination) -> str:
    """How many readings of earlier flights that had not been learnt are inside the bands of their time."""
    before = found.unseen[:-1]
    known = [
        f"{found.names[each.place]} {100.0 * each.inside:.0f} %" for each in before if each.inside is not None
    ]
    bare = len(before) - len(known)
    text = f" Earlier unseen flights, each with the twin of that time: {', '.join(known)}." if known else ""
    # What an older version has learnt has no band.
    if bare:
        text += f" Of {bare} earlier unseen flight{'s' * (bare != 1)} the band is no longer known."
    return text


def unseen(found: Examination) -> Figure | None:
    """The last flight that had not been learnt beside what had been predicted of it."""
    if not found.unseen:
        return None
    last = found.unseen[-1]
    flown = continued(last.flown, found.signals, last.flown.states[0])
    panels = []
    for i, state in enumerate(found.signals.states):
        fit = last.fit[i]
        error = (
            f"RMSE {in_unit(f'{last.rmse[i]:.3g}', state.unit)}"
            if np.isfinite(last.rmse[i])
            else "it diverged"
        )
        title = f"{words(state.name)}: {error}" + (f", FIT {fit:.1f} %" if np.isfinite(fit) else "")
        panels.append(_state_panel(found.signals, i, flown, last.predicted, title, piece=last.piece))
    band = (
        ""
        if last.inside is None
        else f" {100.0 * last.inside:.0f} % of the readings are inside the 90 % band."
    )
    others = _earlier(found)
    by_commands = found.experiments[last.place].test is None
    how = "its recorded commands" if by_commands else "the test's own controller"
    begins = "where its first readings say that it began" if by_commands else "the first reading"
    used = "no later one was used" if by_commands else "no reading after the first was used"
    if last.piece < last.flown.steps:
        again = every([last.piece * found.signals.dt])
        used = f"it begins again at a reading {again}, where the line breaks: no model could be followed for longer"
    return Figure(
        "unseen",
        f"The twin against {found.names[last.place]}, which it had not learnt from",
        panels,
        f"Free run from {begins} by the twin of {last.learnt} experiment{'s' * (last.learnt != 1)}, under"
        f" {how}; {used}.{band}{others}",
    )


def flights(found: Examination) -> Figure:
    """All flights, the last ones where there are many, beside free runs of the twin of today."""
    panels = []
    shown = list(zip(found.names, found.beside, strict=True))[-MOST:]
    for i, state in enumerate(found.signals.states):
        for name, each in shown:
            title = f"{shortened(name)}: {words(state.name)}"
            target = None if each.run.test is None else each.run.test.target_state
            panels.append(
                _state_panel(found.signals, i, each.flown, each.simulated, title, target, each.piece)
            )
    return Figure(
        "flights",
        "All flights beside the twin" if len(shown) == len(found.experiments) else f"The last {MOST} flights",
        panels,
        f"Free runs of the current twin, which has learnt from these flights{_but(found)}: they show its residuals, not"
        f" how well it predicts.{_in_pieces(found, shown)}",
        columns=len(shown),
        rows=True,
    )


def _but(found: Examination) -> str:
    """Which flights the twin of today has not learnt."""
    unlearnt = found.names[found.learnt :]
    return f", but for {', '.join(unlearnt)}" if unlearnt else ""


def _in_pieces(found: Examination, shown: Sequence[tuple[str, Beside]]) -> str:
    """That free runs begin again where no model could be followed for longer, and how often."""
    short = [each.piece * found.signals.dt for _, each in shown if each.piece < each.flown.steps]
    if not short:
        return ""
    return (
        f" Where a line breaks, the free run begins again at a reading, {every(short)}: no model could be followed"
        " for longer."
    )


def step(found: Examination) -> Figure | None:
    """The task on the twin under the controller to fly, with its band; as it was flown, and under the old gains."""
    if found.planned is None:
        return None
    panels = []
    for i in found.moved:
        panel = _state_panel(
            found.signals,
            i,
            None if found.best_flown is None else found.best_flown.trajectory,
            found.planned,
            words(found.signals.states[i].name),
            found.setup.target_state,
        )
        old = [] if found.old is None else [_line(found.old, i, "old", "first gains, on the twin")]
        panels.append(Panel(panel.title, (*old, *panel.marks), panel.x_label, panel.y_label))
    return Figure(
        "step",
        f"The task under the controller to fly: predicted, {flown_words(found)}",
        panels,
        "Without excitation, from the campaign's start to its target. The band holds nine of ten readings, by the"
        " committee and the sensors' noise.",
    )


def _state_panel(
    signals: Signals,
    i: int,
    flown: Trajectory | None,
    predicted: Trajectory | None,
    title: str,
    target: Floats | None = None,
    piece: int | None = None,
) -> Panel:
    state = signals.states[i]
    marks: list[Mark] = []
    if target is not None:
        marks.append(_target(signals, i, target))
    if predicted is not None and predicted.band is not None:
        low, high = predicted.band[:, :, i]
        marks.append(Band(predicted.t, low, high, "twin", "90 % band"))
    if flown is not None:
        marks.append(Line(flown.t - flown.t[0], flown.states[:, i], "measured", "flown"))
    if predicted is not None:
        line = _line(predicted, i, "twin", "twin")
        marks.append(line if flown is None or piece is None else _broken(line, flown.states[:, i], piece))
    ends = None if flown is None else _ends(marks, flown.states[:, i])
    return Panel(title, marks, "time (s)", labelled(state.name, state.unit), y_range=ends)


def _line(run: Trajectory, i: int, role: str, name: str) -> Line:
    return Line(run.t - run.t[0], run.states[:, i], role, name)


def _broken(line: Line, flown: Floats, piece: int) -> Line:
    """A free run as it was followed: it ends after each piece, and begins again at the reading there.

    Args:
        line: its states (m,); more than were flown where the test was stopped before its end.
        flown: readings (n + 1,).
        piece: steps; n or more where it is whole.
    """
    x, y = np.asarray(line.x), np.asarray(line.y)
    # Behind the last reading there is none to begin again at.
    again = np.arange(piece, min(len(y), len(flown)) - 1, piece)
    behind = np.repeat(again + 1, 2)
    gaps = np.stack([np.full(len(again), np.nan), flown[again]], axis=1).ravel()
    return replace(line, x=np.insert(x, behind, np.repeat(x[again], 2)), y=np.insert(y, behind, gaps))


def _target(signals: Signals, i: int, target: Floats) -> Mark:
    if target.ndim == 1:
        return Level(float(target[i]), "target", "target")
    return Line(signals.dt * np.arange(len(target)), target[:, i], "target", "target")


def _ends(marks: Sequence[Mark], flown: Floats) -> tuple[float, float] | None:
    """Limits that show the flight; a twin that diverges must not flatten it."""
    low, high = float(flown.min()), float(flown.max())
    room = max(high - low, 1e-9)
    least, most = low - room, high + room
    for mark in marks:
        values = (mark.at,) if isinstance(mark, Level) else ()
        least, most = min((least, *values)), max((most, *values))
    wanted = [
        np.asarray(getattr(mark, key)) for mark in marks for key in ("y", "low", "high") if hasattr(mark, key)
    ]
    every = np.concatenate([flown, *wanted])
    every = np.clip(every[np.isfinite(every)], least, most)
    levels = [mark.at for mark in marks if isinstance(mark, Level)]
    low, high = min(float(every.min()), *levels, low), max(float(every.max()), *levels, high)
    margin = 0.06 * max(high - low, 1e-9)
    return low - margin, high + margin
