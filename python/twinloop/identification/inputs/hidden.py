"""Hidden states that commands fill: searched by description length, then tuned.

A machine carries more than its sensors read: a climb that thrust has built up, heat that a current has left. Where such
a state matters it is an input like another: alone, times every input, and times what moves an output.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from twinloop.arrays import Floats
from twinloop.elementary import log
from twinloop.identification.inputs.actuation import groups
from twinloop.identification.search.description import shortest
from twinloop.identification.search.structure import Sum, total
from twinloop.identification.terms.directions import Direction, together
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation, HiddenState
from twinloop.signals import Signals

TIMES = (0.25, 1.0, 4.0)
"""Times that are tried, in lengths of the longest run; the one in the middle first."""
PRICE = 30.0
"""What a hidden state must gain in description length: its time, its kind, and what a search may find by luck."""


def filled(pool: Pool) -> list[int]:
    """Terms of the hidden state, on the first rung: itself, and times every input and what moves an output together."""
    hidden = pool.hidden(0)
    found = [node for node in pool.found if pool.is_hidden(node)]
    terms = [hidden, *(pool.product(i, hidden) for i in range(pool.inputs)), *found]
    pool.rungs.update(dict.fromkeys(terms, 0))
    return terms


def enter_directions(pool: Pool, found: Sequence[Direction]) -> None:
    """Enters products of the hidden state and of directions of commands.

    What a hidden state does to each rotor it does to their difference.
    """
    for direction in found:
        term = pool.product(pool.hidden(0), together(pool, direction))
        pool.found[term] = float(log(3.0 * (pool.inputs + 1)))


def search_hidden(
    signals: Signals,
    base: Actuation,
    known: Sequence[HiddenState],
    rests: Sequence[Floats | None],
    longest: float,
    judge: Callable[[Actuation], list[Sum]],
) -> tuple[Actuation, list[Sum]]:
    """The hidden state of the shortest description.

    Args:
        signals: of the system.
        base: lags and delays, without hidden states.
        known: hidden states that were found before.
        rests: commands under which it may stay empty (n_u,); None: those of the first period.
        longest: length of the longest run, s.
        judge: finds the sums under a given actuation.

    Returns:
        The actuation with it, and the sums.
    """

    def tried(hidden: HiddenState) -> tuple[float, Actuation, list[Sum]]:
        actuation = replace(base, hidden=(hidden,))
        sums = judge(actuation)
        return total(sums), actuation, sums

    kinds: list[HiddenState] = [
        HiddenState(tuple(group), squared, _mean(signals, group, squared, rest), TIMES[1] * longest)
        for group in groups(signals)
        for squared in (False, True)
        for rest in rests
    ]
    found = [tried(hidden) for hidden in [*kinds, *known]]
    best = shortest(found, lambda answer: answer[0])[1].hidden[0]
    found += [tried(best._replace(time=time * longest)) for time in (TIMES[0], TIMES[2])]
    _, actuation, sums = shortest(found, lambda answer: answer[0])
    return actuation, sums


def _mean(signals: Signals, group: Sequence[int], squared: bool, rest: Floats | None) -> float | None:
    if rest is None:
        return None
    levels = np.array([rest[i] / signals.commands[i].size for i in group])
    return float(np.mean(levels * levels if squared else levels))
