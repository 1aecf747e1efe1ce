"""Ending: a law of which what states do ends at some values of them, and grows no more beyond.

A wing stalls, a tyre slides and a spring is soft beyond some point, of which flights that stayed before it tell
nothing. No member of a committee shows it then: all of them go on as they were.
"""

from __future__ import annotations

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.law.actuation import renewed
from twinloop.signals import Signals


def ending(model: _core.Model, signals: Signals, bounds: Floats) -> _core.Model:
    """The same law, told of no state that it is beyond bounds; how states move on from there is its own.

    Of those that wrap it is told as they are: they have no ends.

    Args:
        model: of these signals.
        signals: of the system.
        bounds: smallest and largest value of each state that the law is told (2, n_x).
    """
    program = model.program.effective()
    low, high = bounds.tolist()
    # Inputs are the first registers, states the first of them.
    first = [
        instruction
        for i, state in enumerate(signals.states)
        if state.period is None
        for instruction in (("min", i, i, high[i]), ("max", i, i, low[i]))
    ]
    cut = _core.Program(program.inputs, program.outputs, program.registers, [[*first, *program.instructions]])
    return renewed(model, signals, program=cut)
