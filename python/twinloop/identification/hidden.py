"""Hidden states that commands fill: searched by description length, then tuned.

A machine carries more than its sensors read: a climb that thrust has built up, heat that a current has left. Where such
a state matters it is an input like another: alone, times every input, and times what moves an output.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from twinloop.arrays import Floats
from twinloop.identification.actuation import Actuation, Hidden, groups
from twinloop.identification.pool import Pool
from twinloop.identification.problem import Problem
from twinloop.identification.structure import Sum, total
from twinloop.signals import Signals

TIMES = (0.25, 1.0, 4.0)
"""Times that are tried, in lengths of the longest run; the one in the middle first."""
PRICE = 30.0
"""What a hidden state must gain in description length: its time, its kind, and what a search may find by luck."""
EQUAL = 0.8
"""Commands that move an output at least this much as strongly as the strongest do it equally."""
LEAST = 0.1
"""Those that move it less than this do not."""
STEP = 0.01
"""Of a command, in units of its scale, by which it is found how strongly it moves an output."""


def filled(pool: Pool) -> list[int]:
    """Terms of the hidden state, on the first rung: itself, and times every input and what moves an output together."""
    hidden = pool.hidden(0)
    found = [node for node in pool.found if pool.is_hidden(node)]
    terms = [hidden, *(pool.product(i, hidden) for i in range(pool.inputs)), *found]
    pool.rungs.update(dict.fromkeys(terms, 0))
    return terms


def enter_directions(problem: Problem, sums: Sequence[Sum], signals: Signals) -> None:
    """Enters products of the hidden state and of how alike commands move an output, one with the other.

    What a hidden state does to each rotor it does to their difference; one term says so where it would take four.

    Args:
        problem: of the sums.
        sums: of the best model so far.
        signals: of the system.
    """
    pool = problem.pool
    middle = problem.stages.start.mean(axis=0)
    for group in (group for group in groups(signals) if len(group) > 1):
        places = [signals.n_x + i for i in group]
        rows = np.repeat(middle[np.newaxis], 2 * len(group), axis=0)
        for row, place in enumerate(places):
            rows[2 * row, place] += STEP
            rows[2 * row + 1, place] -= STEP
        # How each output answers, and all of them alike, as they fill the state.
        answers = [*(_answers(pool, found, rows) for found in sums), np.ones(len(group))]
        for shares in answers:
            together = _together(pool, places, shares)
            if together is not None:
                term = pool.product(pool.hidden(0), together)
                pool.found[term] = float(np.log(3.0 * (pool.inputs + 1)))


def _answers(pool: Pool, found: Sum, rows: Floats) -> Floats:
    """How strongly a sum answers to each command, from rows a step above and a step below its middle in turn."""
    values: Floats = pool.values(list(found.weights), rows) @ np.array(list(found.weights.values()))
    return values[::2] - values[1::2]


def _together(pool: Pool, places: Sequence[int], shares: Floats) -> int | None:
    """The sum of inputs by their shares, of which nearly equal ones are equal; None for less than two inputs."""
    largest = float(np.abs(shares).max())
    if not (np.isfinite(largest) and largest > 0.0):
        return None
    parts = [
        (place, 1.0 if abs(share) >= EQUAL else round(abs(share), 1), share > 0.0)
        for place, share in zip(places, (shares / largest).tolist(), strict=True)
        if abs(share) >= LEAST
    ]
    if len(parts) < 2:
        return None
    # The first one is positive: a direction and its opposite are one.
    turned = not parts[0][2]
    node: int | None = None
    for place, size, positive in parts:
        part = place if size == 1.0 else pool.add(("*", place, size))
        node = part if node is None else pool.add(("+" if positive != turned else "-", node, part))
    return node


def search_hidden(
    signals: Signals,
    base: Actuation,
    known: Sequence[Hidden],
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

    def tried(hidden: Hidden) -> tuple[float, Actuation, list[Sum]]:
        actuation = replace(base, hidden=(hidden,))
        sums = judge(actuation)
        return total(sums), actuation, sums

    kinds: list[Hidden] = [
        (tuple(group), squared, _mean(signals, group, squared, rest), TIMES[1] * longest)
        for group in groups(signals)
        for squared in (False, True)
        for rest in rests
    ]
    found = [tried(hidden) for hidden in [*kinds, *known]]
    commands, squared, level, _ = min(found, key=lambda answer: answer[0])[1].hidden[0]
    found += [tried((commands, squared, level, time * longest)) for time in (TIMES[0], TIMES[2])]
    _, actuation, sums = min(found, key=lambda answer: answer[0])
    return actuation, sums


def _mean(signals: Signals, group: Sequence[int], squared: bool, rest: Floats | None) -> float | None:
    if rest is None:
        return None
    levels = np.array([rest[i] / signals.commands[i].size for i in group])
    return float(np.mean(levels**2 if squared else levels))
