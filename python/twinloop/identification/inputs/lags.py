"""Lag and delay of the actuators: they are searched on a grid by description length, then tuned."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from twinloop.arrays import Floats
from twinloop.identification.inputs.actuation import groups
from twinloop.identification.search.description import shorter, shortest
from twinloop.identification.search.structure import Sum, total
from twinloop.law.actuation import Actuation, Actuator
from twinloop.signals import Signals

LAGS = (0.0, 0.35, 0.7, 1.4, 2.8, 5.6, 11.0)
"""Time constants that are tried, in periods."""
DELAYS = (0, 1, 2, 3)
"""Delays that are tried, in periods."""
PRICE = 12.0
"""What a lag or a delay must gain in description length: its number, and the choice of having one."""


def search_actuators(
    signals: Signals,
    rests: Sequence[Floats | None],
    judge: Callable[[Actuation], list[Sum]],
    longest: int,
) -> tuple[Actuation, list[Sum]]:
    """Tries lags and delays of each group of commands, one group after another.

    Args:
        signals: of the system.
        rests: commands whose effect may be there at the start (n_u,); None: the first command.
        judge: finds the sums under a given actuation.
        longest: delay at most, periods.

    Returns:
        The actuators of the shortest description, and the sums under them.
    """
    best = Actuation.direct(signals)
    sums = judge(best)
    energy = total(sums)
    for group in groups(signals):
        for delay in (d for d in DELAYS if d <= longest):
            rising = 0
            for lag in LAGS:
                if lag == 0.0 and delay == 0:
                    continue
                score, tried, found = shortest(
                    [_tried(signals, best, group, lag, delay, rest, judge) for rest in rests],
                    lambda answer: answer[0],
                )
                if shorter(score + PRICE, energy):
                    best, sums, energy, rising = tried, found, score + PRICE, 0
                else:
                    rising += 1
                # Past the best lag the fit only gets worse.
                if rising >= 2:
                    break
    return best, sums


def _tried(
    signals: Signals,
    base: Actuation,
    group: Sequence[int],
    lag: float,
    delay: int,
    rest: Floats | None,
    judge: Callable[[Actuation], list[Sum]],
) -> tuple[float, Actuation, list[Sum]]:
    actuators: list[Actuator] = list(base.actuators)
    for i in group:
        actuators[i] = Actuator(lag * signals.dt, delay, None if rest is None else float(rest[i]))
    tried = Actuation(tuple(actuators))
    found = judge(tried)
    return total(found), tried, found
