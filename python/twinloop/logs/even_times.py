"""Even times: a log whose times jitter around the period, brought onto it; and a part of a log."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput
from twinloop.logs.samples import Samples, Window, interpolated, mean_held, refuse_gaps
from twinloop.remarks import note
from twinloop.unmeasured import logged, names_of

if TYPE_CHECKING:
    from twinloop.logs.files import Log

ROUNDING = 1e-9
"""Share of a period by which even times may be off it."""
EARLY = 0.05
"""Periods by which the last row may come early: states go on until its time as the last two rows say."""
BETWEEN = 2.5
"""Periods by which two readings may be apart: one is missing, and both come at their own time."""


def part_of(log: Log, window: Window) -> Log:
    """The rows of a log from one time to another.

    Args:
        log: with increasing times.
        window: seconds after its first row.

    Raises:
        InvalidInput: fewer than three rows are left.
    """
    if window == Window():
        return log
    if log.t.ndim != 1 or log.t.dtype.kind not in "iuf":
        raise InvalidInput(
            f"Log {log.called}, t: expected times to take a part by, found {log.t.dtype}; check it."
        )
    since = log.t - log.t[:1]
    start, stop = (
        edge if edge is not None else end
        for edge, end in zip((window.start, window.stop), (0.0, np.inf), strict=True)
    )
    rows = np.flatnonzero((since >= start - 1e-9) & (since <= stop + 1e-9))
    if len(rows) < 3 or len(rows) != rows[-1] - rows[0] + 1:
        raise InvalidInput(
            f"Log {log.called}: expected at least three rows, one after the other, {start:.6g} s"
            f"{f' to {stop:.6g} s' if np.isfinite(stop) else ' or more'} after its first one, found {len(rows)};"
            f" its last one is {float(since[-1]) if len(since) else 0.0:.6g} s after it: name another part."
        )
    first, last = int(rows[0]), int(rows[-1])
    lines = None if log.lines is None else log.lines[first : last + 1]
    return replace(
        log,
        t=log.t[first : last + 1],
        states=log.states[first : last + 1],
        commands=log.commands[first:last],
        lines=lines,
    )


def evenly(log: Log) -> Log:
    """A log on the period of its signals, from its first row on.

    States are interpolated between the two rows beside each time, and commands, which are held from row to row, are
    averaged over each period. What the loop's jitter did is then noise of readings and commands.

    Args:
        log: of real numbers, with increasing times; missing readings are left out.

    Raises:
        InvalidInput: times that do not increase, or readings more than two and a half periods apart.
    """
    dt, t = log.signals.dt, log.t
    if len(t) < 3 or not (np.isfinite(t).all() and (np.diff(t) > 0.0).all()):
        raise InvalidInput(
            f"Log {log.called}: expected at least three rows at increasing times, found others; sort them, and leave"
            " out those that repeat a time."
        )
    if not np.isfinite(log.commands).all():
        raise InvalidInput(
            f"Log {log.called}: expected a command in each row but the last, found some missing; fill them with what"
            " was sent."
        )
    off = float(np.abs(np.diff(t) / dt - 1.0).max())
    if off < ROUNDING:
        return log
    count = int((t[-1] - t[0]) / dt + EARLY)
    times = np.asarray(t[0] + dt * np.arange(count + 1), dtype=np.float64)
    states = [
        interpolated(_known(log, state.name, column, times), state, times)
        for state, column in zip(
            logged(log.signals, names_of(log.states, log.signals)), log.states.T, strict=True
        )
    ]
    sent = np.vstack([log.commands, log.commands[-1:]])
    commands = [
        mean_held(Samples(name, t, column), times)
        for name, column in zip(log.signals.command_names, sent.T, strict=True)
    ]
    said = note(
        "evenly",
        f"Its times, up to {100.0 * off:.2g} % off the period, were brought onto it: readings between rows, commands as"
        " their mean over each period.",
    )
    return replace(
        log, t=times - t[0], states=np.stack(states, axis=1), commands=np.stack(commands, axis=1), lines=None,
        remarks=(*log.remarks, said),
    )  # fmt: skip


def _known(log: Log, name: str, column: Floats, times: Floats) -> Samples:
    """The readings of a state that are there."""
    there = np.isfinite(column)
    if there.sum() < 2:
        raise InvalidInput(
            f"Log {log.called}: expected readings of {name}, found {int(there.sum())}; log it."
        )
    samples = Samples(name, log.t[there], column[there])
    edges = float(times[0]), min(float(times[-1]), float(log.t[-1]))
    if samples.times[0] > edges[0] or samples.times[-1] < edges[1]:
        raise InvalidInput(
            f"Log {log.called}: expected readings of {name} from its first row to its last one, found them from"
            f" {samples.times[0]:.6g} to {samples.times[-1]:.6g} s; take that part."
        )
    refuse_gaps(log.called, samples, *edges, log.signals.dt, BETWEEN)
    return samples
