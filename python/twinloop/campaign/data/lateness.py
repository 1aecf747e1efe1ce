"""Lateness: by how much a state's readings come after those of what moves it, as one log shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import enumerated
from twinloop._ground.times import shown_time
from twinloop.campaign.data.integrated import cuts, without_line
from twinloop.campaign.data.turning import turning
from twinloop.remarks import Remark, note
from twinloop.signals import Signals

MOST = 10
"""Periods up to which one is looked for on either side of 0."""
STEPS = 20
"""Shifts that are tried in a period."""
LEAST = 0.2
"""Periods below which one is not named: an integral over coarse periods errs as much."""
EULER = (0.45, 0.55)
"""Periods by which a simulator's Euler steps look early or late."""
CLEAR = 0.25
"""Share of the squared deviation that a shift leaves at most if the log shows it clearly."""
PIECE = 50
"""Rows of the pieces into which a run is cut: within one the bias of a rate adds a line, and that is taken out."""
LEARNT = 1.5
"""Periods of an offset up to which the preset `default` is left to learn it: it tries those of up to one first."""


class _Moved(NamedTuple):
    """States with the readings that move them, which all come from sensors of their own.

    Args:
        states: their names.
        rates: names of what moves them.
        values: readings of the states (n + 1, m).
        readings: of the rates (n + 1, k).
        derivative: of the states, by values and rates at the same times.
    """

    states: Sequence[str]
    rates: Sequence[str]
    values: Floats
    readings: Floats
    derivative: Callable[[Floats, Floats], Floats]


def late(states: Floats, signals: Signals) -> Iterator[Remark]:
    """Notes on states whose readings come later or earlier than those of what moves them.

    Args:
        states: readings of a run (n + 1, n_x), with periodic ones that go on by the short way.
        signals: of the system.
    """
    for moved in _moved(states, signals):
        shift = lateness(moved.values, moved.readings, signals.dt, moved.derivative)
        if shift is None:
            continue
        periods = abs(shift) / signals.dt
        several = len(moved.states) > 1
        cure = (
            "The preset default learns this (option offsets)."
            if periods < LEARNT
            else f"Shift {'their columns' if several else 'its column'} by {periods:.0f} rows; the preset"
            " default learns what is left (option offsets)."
        )
        yield note(
            "late",
            f"{enumerated(moved.states)} {'are' if several else 'is'} read about"
            f" {shown_time(abs(shift), 2)} {'later' if shift > 0.0 else 'earlier'} than"
            f" {enumerated(moved.rates)}, which move{' them' if several else 's it'}. {cure}",
        )


def _moved(states: Floats, signals: Signals) -> Iterator[_Moved]:
    def columns(names: Sequence[str]) -> Floats:
        return states[:, [signals.state_names.index(name) for name in names]]

    for rate in signals.states:
        if rate.derivative_of is not None:
            state, own = [rate.derivative_of], [rate.name]
            yield _Moved(state, own, columns(state), columns(own), lambda _, rates: rates)
    body = signals.kinematics
    if body is not None:
        yield _Moved(body.angles, body.rates, columns(body.angles), columns(body.rates), turning)


def lateness(
    values: Floats,
    readings: Floats,
    dt: float,
    derivative: Callable[[Floats, Floats], Floats] = lambda _, rates: rates,
) -> float | None:
    """By how much later than what moves them states were read, s; None if it does not show clearly, or is none.

    Args:
        values: readings of the states (n + 1, m).
        readings: of their rates (n + 1, k), between which these are taken to be straight.
        dt: period, s.
        derivative: of the states (rows, m), by values (rows, m) and rates (rows, k) at the same times.
    """
    most = min(MOST, len(values) // 6)
    if most < 1:
        return None
    shifts = np.arange(-most * STEPS, most * STEPS + 1) / STEPS
    rows = np.arange(most, len(values) - most)
    seen = values[rows]
    left = np.array([_deviation(seen, dt * derivative(seen, _between(readings, rows - s))) for s in shifts])
    at = int(np.argmin(left))
    if not 0 < at < len(shifts) - 1 or left[at] > CLEAR * left[most * STEPS]:
        return None
    before, least, after = left[at - 1 : at + 2].tolist()
    found = float(shifts[at]) + 0.5 * (before - after) / (before - 2.0 * least + after) / STEPS
    as_euler = EULER[0] < abs(found) < EULER[1]
    return None if abs(found) < LEAST or as_euler else found * dt


def _between(readings: Floats, places: Floats) -> Floats:
    """Readings at places between their rows (rows, k)."""
    first = np.minimum(np.floor(places).astype(int), len(readings) - 2)
    between: Floats = readings[first] + (places - first)[:, None] * (readings[first + 1] - readings[first])
    return between


def _deviation(values: Floats, changes: Floats) -> float:
    """Sum of squares between states and the integral of what they change in a period, less a line in each piece."""
    said = np.cumsum(0.5 * (changes[1:] + changes[:-1]), axis=0)
    off = values[1:] - said
    parts = cuts(len(off), len(off) // PIECE)
    return sum(float(np.square(without_line(column)).sum()) for part in parts for column in off[part].T)
