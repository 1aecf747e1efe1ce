"""Lag and delay of the actuators: hidden states that are searched on a grid by description length, then tuned."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from twinloop.arrays import Floats
from twinloop.identification.records import Actuator
from twinloop.identification.structure import Sum
from twinloop.signals import Signals

LAGS = (0.0, 0.35, 0.7, 1.4, 2.8, 5.6, 11.0)
"""Time constants that are tried, in periods."""
DELAYS = (0, 1, 2, 3)
"""Delays that are tried, in periods."""
PRICE = 12.0
"""What a hidden state must gain in description length: its number, and the choice of having one."""


def groups(signals: Signals) -> list[list[int]]:
    """Commands that are alike, by unit and bounds; they share a lag and a delay."""
    found: dict[tuple[object, ...], list[int]] = {}
    for i, command in enumerate(signals.commands):
        found.setdefault((command.unit, command.bounds, command.size), []).append(i)
    return list(found.values())


def search_actuators(
    signals: Signals,
    rests: Sequence[Floats | None],
    judge: Callable[[list[Actuator]], list[Sum]],
    longest: int,
) -> tuple[list[Actuator], list[Sum]]:
    """Tries lags and delays of each group of commands, one group after another.

    Args:
        signals: of the system.
        rests: commands whose effect may be there at the start (n_u,); None: the first command.
        judge: finds the sums under given actuators.
        longest: delay at most, periods.

    Returns:
        The actuators of the shortest description, and the sums under them.
    """
    best: list[Actuator] = [(0.0, 0, None)] * signals.n_u
    sums = judge(best)
    energy = total(sums)
    for group in groups(signals):
        for delay in (d for d in DELAYS if d <= longest):
            rising = 0
            for lag in LAGS:
                if lag == 0.0 and delay == 0:
                    continue
                score, tried, found = min(
                    (_tried(signals, best, group, lag, delay, rest, judge) for rest in rests),
                    key=lambda answer: answer[0],
                )
                if score + PRICE < energy:
                    best, sums, energy, rising = tried, found, score + PRICE, 0
                else:
                    rising += 1
                # Past the best lag the fit only gets worse.
                if rising >= 2:
                    break
    return best, sums


def _tried(
    signals: Signals,
    base: Sequence[Actuator],
    group: Sequence[int],
    lag: float,
    delay: int,
    rest: Floats | None,
    judge: Callable[[list[Actuator]], list[Sum]],
) -> tuple[float, list[Actuator], list[Sum]]:
    tried = list(base)
    for i in group:
        tried[i] = (lag * signals.dt, delay, None if rest is None else float(rest[i]))
    found = judge(tried)
    return total(found), tried, found


def total(sums: Sequence[Sum]) -> float:
    """Description length of all sums."""
    return sum(found.energy for found in sums)
