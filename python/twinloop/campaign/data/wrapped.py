"""Wrapped: angles that jump by a whole turn in a log, as a yaw at ±π does, although they were not declared periodic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.data.turning import turning
from twinloop.remarks import Remark, serious
from twinloop.signals import TURNS, Signals, State
from twinloop.trajectory import Trajectory, continued

FASTEST = 0.25
"""Turns within a period up to which a jump is told from a motion."""
CLOSE = 0.1
"""Turns by which a step may differ from what rates or the steps beside it say."""
BESIDE = 2
"""Steps on each side of a jump that are looked at where no rate is declared."""


def without_turns(
    recorded: Sequence[Trajectory], signals: Signals, where: Callable[[int, int], str]
) -> tuple[list[Trajectory], list[Remark]]:
    """Runs whose angles go on where they jumped by a whole turn.

    Args:
        recorded: runs; states that were declared periodic may be wrapped in them, nothing is said of those.
        signals: of the system.
        where: what to call a row, by the places of its run and of the row.

    Returns:
        The runs, and a serious remark on each state that jumps.
    """
    runs = [continued(run, signals, run.states[0]) for run in recorded]
    remarks = []
    for i, state in enumerate(signals.states):
        turn = TURNS.get(state.unit)
        if turn is None or state.periodic:
            continue
        found = [(k, row) for k, run in enumerate(runs) for row in jumps(run.states, i, signals)]
        if found:
            k, row = found[0]
            before, after = runs[k].states[row - 1 : row + 1, i]
            often = "" if len(found) == 1 else f", the first of {len(found)} times"
            remarks.append(_remark(state, f"{where(k, row)}, from {before:.4g} to {after:.4g}", often))
        for k, row in found:
            states = runs[k].states.copy()
            states[row:, i] -= np.rint((states[row, i] - states[row - 1, i]) / turn) * turn
            runs[k] = replace(runs[k], states=states)
    return runs, remarks


def jumps(states: Floats, place: int, signals: Signals) -> list[int]:
    """Rows at which a state is a whole turn away from where it would be, if it had moved as its rate says.

    Where no rate is declared, the steps beside say it: what wraps moves on as before, and stays within one turn. What
    truly turns by more than half a turn in a period does so in the steps beside, too, and leaves the turn.

    Args:
        states: (n + 1, n_x).
        place: of the state, in rad or deg.
        signals: of the system.
    """
    turn = TURNS[signals.states[place].unit]
    angle, rate = states[:, place] / turn, _rate(states, place, signals)
    steps = np.diff(angle)
    short = steps - np.rint(steps)
    found = []
    for k in np.flatnonzero((np.abs(steps) > 0.5) & (np.abs(short) < FASTEST)).tolist():
        if rate is not None:
            said = 0.5 * signals.dt * (rate[k] + rate[k + 1]) / turn
        else:
            beside = np.concatenate([short[max(0, k - BESIDE) : k], short[k + 1 : k + 1 + BESIDE]])
            around = angle[max(0, k - BESIDE) : k + 2 + BESIDE]
            calm = len(beside) and np.abs(beside).max() < FASTEST
            if not calm or np.ptp(around) > 1.0 + CLOSE:
                continue
            said = float(beside.mean())
        if abs(short[k] - said) < CLOSE:
            found.append(k + 1)
    return found


def _rate(states: Floats, place: int, signals: Signals) -> Floats | None:
    """What the declared rates say of how fast a state changes (n + 1,); None where there are none."""
    name, names = signals.state_names[place], signals.state_names
    body = signals.kinematics
    if body is not None and name in body.angles:
        angles, rates = ([names.index(each) for each in group] for group in (body.angles, body.rates))
        turned: Floats = turning(states[:, angles], states[:, rates])[:, body.angles.index(name)]
        return turned
    of = [i for i, state in enumerate(signals.states) if state.derivative_of == name]
    return states[:, of[0]] if of else None


def _remark(state: State, where: str, often: str) -> Remark:
    turn = TURNS[state.unit]
    toml, python = ("true", "True") if state.unit == "rad" else (f"{turn:.1f}",) * 2
    return serious(
        "wraps",
        f"{state.name} jumps by a whole turn {where} {state.unit}{often}: it wraps, which was not declared. Declare it,"
        f" in a campaign file by periodic = {toml} under [states.{state.name}], in Python by"
        f" State({state.name!r}, …, periodic={python}), or unwrap the log. A store that was begun keeps its signals:"
        " begin a new one, and tell or attach the same logs there.",
    )
