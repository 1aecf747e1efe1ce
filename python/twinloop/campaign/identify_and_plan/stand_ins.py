"""Stand-ins: lags and delays in a law that does not explain the flights are no actuators.

A lag filters a command, and what the law lacks is often a late response too: a load behind a spring, a pressure, an
airspeed. There the lag makes the law better, and says nothing of the actuator.
"""

from __future__ import annotations

from collections.abc import Iterator

from twinloop.law.actuation import Actuation, Actuator, in_periods
from twinloop.remarks import Remark, note
from twinloop.signals import Signals


def claimed(actuation: Actuation, signals: Signals, explained: bool) -> tuple[Actuator, ...]:
    """Actuators that were identified, one a command: those of the law, or direct ones.

    Args:
        actuation: of the law.
        signals: of the system.
        explained: whether the law explains the flights.
    """
    return actuation.actuators if explained else Actuation.direct(signals).actuators


def stand_ins(actuation: Actuation, signals: Signals, explained: bool) -> Iterator[Remark]:
    """Which lags and delays of a law are not identified as those of actuators.

    Args:
        actuation: of the law.
        signals: of the system.
        explained: whether the law explains the flights.
    """
    late = [
        f"{command.name} ({_late(actuator)})"
        for command, actuator in zip(signals.commands, actuation.actuators, strict=True)
        if not actuator.direct
    ]
    if late and not explained:
        yield note(
            "stand-in",
            f"The law filters or delays {', '.join(late)}, but no law explains the flights so far: what looks like a"
            " slow actuator may be a state that is not logged. No actuator was identified.",
        )


def _late(actuator: Actuator) -> str:
    """The lag and the delay in words."""
    parts = [f"lag {actuator.lag:.3g} s"] if actuator.lag else []
    if actuator.delay:
        parts.append(f"delay {in_periods(actuator.delay)}")
    if actuator.ramp:
        parts.append("a limited rate")
    return ", ".join(parts)
