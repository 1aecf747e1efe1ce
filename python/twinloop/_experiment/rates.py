"""Rates: of what each state is the rate, by a declared derivative or as the body rate about an angle's axis."""

from __future__ import annotations

from twinloop.signals import Signals


def rates_of(signals: Signals) -> dict[str, str]:
    """Of what each state is the rate, by name: its declared derivative, or a body rate about the angle's axis.

    From integrals to derivatives, in whatever order the states are declared: what a rate is of may be a rate itself.

    Args:
        signals: of the system.
    """
    declared = {
        state.name: state.derivative_of for state in signals.states if state.derivative_of is not None
    }
    body = signals.kinematics
    left = declared if body is None else {**dict(zip(body.rates, body.angles, strict=True)), **declared}
    ordered: dict[str, str] = {}
    while left:
        # Rates of what is no rate itself, or is in order already; all, should an angle derive from its own body rate.
        ordered |= {rate: of for rate, of in left.items() if of not in left} or left
        left = {rate: of for rate, of in left.items() if rate not in ordered}
    return ordered
