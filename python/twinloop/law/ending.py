"""Ending: a law of which what a state does ends at some value of it, and grows no more beyond.

A wing stalls, a tyre slides and a spring is soft beyond some point, of which flights that stayed before it tell
nothing. No member of a committee shows it then: all of them go on as they were.
"""

from __future__ import annotations

from collections.abc import Collection

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.law.reports import reports_of, with_reports
from twinloop.signals import Signals


def ending(model: _core.Model, signals: Signals, bounds: Floats, states: Collection[int]) -> _core.Model:
    """The same law, for which some states are never beyond bounds; how they move on from there is its own.

    Args:
        model: of these signals.
        signals: of the system.
        bounds: smallest and largest value of each state that the law is told (2, n_x).
        states: by place, those that end.
    """
    program = model.program.effective()
    low, high = bounds.tolist()
    # Inputs are the first registers, states the first of them.
    first = [instruction for i in states for instruction in (("min", i, i, high[i]), ("max", i, i, low[i]))]
    found = _core.Model(
        _core.Program(program.inputs, program.outputs, program.registers, [[*first, *program.instructions]]),
        model.form,
        signals.engine,
        model.actuators or None,
        model.hidden,
        model.offsets,
    )
    found = found.with_levels(model.levels) if model.levels else found
    return with_reports(found, reports_of(model, signals.n_x))


def endings(model: _core.Model, signals: Signals, bounds: Floats) -> list[_core.Model]:
    """The laws of which one state ends, and the one of which all do; not those that wrap, which have no ends.

    Args:
        model: of these signals.
        signals: of the system.
        bounds: smallest and largest value of each state (2, n_x).
    """
    states = [i for i, state in enumerate(signals.states) if state.period is None]
    ends = [[i] for i in states] + ([states] if len(states) > 1 else [])
    return [ending(model, signals, bounds, some) for some in ends]
