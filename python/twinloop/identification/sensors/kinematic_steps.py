"""What states do where nothing drives them, by their declared kinematics alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Signals


def kinematic_model(signals: Signals, dt: float, form: str = "acceleration") -> _core.Model:
    """A model whose outputs are nothing.

    Args:
        signals: of the system.
        dt: time that a step covers, s.
        form: how states move those that they give; a form of derivatives.

    Returns:
        The engine's model; states that are driven stay, those that others move go on.
    """
    outputs: list[dict[int, float]] = [{} for _ in signals.driven]
    program = Pool(signals.n_x + signals.n_u).program_of_sums(outputs)
    return _core.Model(program, form, replace(signals, dt=dt).engine)


def kinematic_step(states: Floats, signals: Signals, form: str = "acceleration") -> Floats:
    """What states become a period later by kinematics alone.

    Args:
        states: readings (n + 1, n_x).
        signals: of the system.
        form: one of derivatives: what moves others does so by its mean over the period, or by Euler as it was at the
            start or at the end.

    Returns:
        States after each of the first n readings (n, n_x).
    """
    begun = states[:-1].copy()
    if form == "acceleration":
        moving = _moving(signals)
        begun[:, moving] = 0.5 * (states[:-1, moving] + states[1:, moving])
    elif form == "semi-implicit-euler":
        driven = list(signals.driven)
        begun[:, driven] = states[1:, driven]
    model = kinematic_model(signals, signals.dt, form)
    return np.asarray(model.step(begun, np.zeros((len(begun), signals.n_u))))


def _moving(signals: Signals) -> list[int]:
    """States that move others."""
    body = signals.kinematics
    return [
        i
        for i, state in enumerate(signals.states)
        if state.derivative_of is not None or (body is not None and state.name in body.rates)
    ]
