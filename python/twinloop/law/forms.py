"""Forms: what the outputs of a law mean."""

from __future__ import annotations

from twinloop.signals import Signals

FORMS = ("absolute", "increment", "acceleration", "explicit-euler", "semi-implicit-euler")
"""The next state; what a period adds; derivatives, integrated finely; the same in one step of Euler a period."""
EULER = FORMS[3:]
"""Forms of one step of Euler a period, in which a state is advanced by its derivative at the start or at the end."""
DERIVATIVES = FORMS[2:]
"""Forms whose outputs are the derivatives of the states that no others give."""


def driven_states(signals: Signals, form: str) -> tuple[int, ...]:
    """The states that a program's outputs drive under a form, in the order of the outputs."""
    return signals.driven if form in DERIVATIVES else tuple(range(signals.n_x))
