"""Terms of joints: what moves them, what their masses depend on, and the nodes of accelerations that share masses.

Spong, Hutchinson and Vidyasagar, *Robot modeling and control*: masses of turning links depend on cosines of their
angles and of sums and differences of them; what they do to each other goes with squares of rates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, combinations_with_replacement

from twinloop.identification.terms.libraries import angles, turn
from twinloop.identification.terms.pool import Pool
from twinloop.signals import Signals

Signed = tuple[int, int]
"""A node, and 1 or -1 as its factor: a constant in its place would be one to be tuned."""
Matrix = Sequence[Sequence[Mapping[int, float]]]
"""Weights of terms, of each entry."""


def forces(pool: Pool, signals: Signals) -> list[int]:
    """What moves joints: springs, damping, commands, weight, and what turning and sliding masses do to each other."""
    poses, (rates, sliding) = _poses(pool, signals), _moving(signals)
    waves = [wave for pose in poses for wave in pose]
    commands = range(signals.n_x, pool.inputs)
    squares = [pool.product(i, j) for i, j in combinations_with_replacement(rates, 2)]
    found = [pool.one, *_places(signals), *rates, *commands, *waves]
    found += [pool.product(i, wave) for i in (*commands, *rates, *sliding) for wave in waves]
    found += [pool.product(square, other) for square in squares for other in (*waves, *sliding)]
    found += [pool.product(sine, cosine, square) for sine, cosine in poses for square in squares]
    return list(dict.fromkeys(found))


def masses(pool: Pool, signals: Signals) -> list[int]:
    """What a joint's mass depends on: its pose, and how far something has slid."""
    _, sliding = _moving(signals)
    found = [pool.one]
    for sine, cosine in _poses(pool, signals):
        found += [cosine, sine, pool.product(cosine, cosine)]
    found += [*sliding, *(pool.product(i, i) for i in sliding)]
    return list(dict.fromkeys(found))


def solution(pool: Pool, matrix: Matrix, right: Sequence[Mapping[int, float]]) -> list[Signed | None]:
    """The nodes of what solves linear equations, by Gauss's elimination without a search for pivots.

    Args:
        pool: where they are entered.
        matrix: weights of terms that are added to the unit matrix.
        right: weights of terms on each right side.

    Returns:
        A node for each unknown; None for one that is always 0.
    """
    count = len(right)
    rows: list[list[Signed | None]] = [
        [(_diagonal(pool, own), 1) if i == j else weighted(pool, own) for j, own in enumerate(row)]
        for i, row in enumerate(matrix)
    ]
    for row, terms in zip(rows, right, strict=True):
        row.append(weighted(pool, terms))
    for k in range(count):
        for i in (i for i in range(count) if i != k):
            share = _over(pool, rows[i][k], rows[k][k])
            rows[i] = [
                here if j <= k else _less(pool, here, share, there)
                for j, (here, there) in enumerate(zip(rows[i], rows[k], strict=True))
            ]
    return [_over(pool, row[-1], row[k]) for k, row in enumerate(rows)]


def weighted(pool: Pool, terms: Mapping[int, float]) -> Signed | None:
    """The node of a weighted sum; None of nothing."""
    total: int | None = None
    for term, weight in terms.items():
        constant = pool.constant(weight)
        part = constant if term == pool.one else pool.add("*", term, constant)
        total = part if total is None else pool.add("+", total, part)
    return None if total is None else (total, 1)


def _diagonal(pool: Pool, terms: Mapping[int, float]) -> int:
    """1 more than a weighted sum, written as 1 less its negative: tuning leaves the 1 as it is."""
    negative = weighted(pool, {term: -weight for term, weight in terms.items()})
    return pool.one if negative is None else pool.add("-", pool.one, negative[0])


def _less(pool: Pool, here: Signed | None, share: Signed | None, there: Signed | None) -> Signed | None:
    """What is left of one node less a share of another."""
    if share is None or there is None:
        return here
    product, sign = pool.product(share[0], there[0]), share[1] * there[1]
    if here is None:
        return product, -sign
    if here[1] == sign:
        return pool.add("-", here[0], product), sign
    return pool.add("+", here[0], product), here[1]


def _over(pool: Pool, node: Signed | None, divisor: Signed | None) -> Signed | None:
    if node is None or divisor is None or divisor[0] == pool.one:
        return node
    return pool.add("/", node[0], divisor[0]), node[1] * divisor[1]


def _moving(signals: Signals) -> tuple[list[int], list[int]]:
    """States that are declared derivatives, and states that have one and are no angles."""
    rates = [i for i, state in enumerate(signals.states) if state.derivative_of is not None]
    return rates, [i for i in _places(signals) if i not in angles(signals)]


def _places(signals: Signals) -> list[int]:
    """States that have a declared derivative."""
    of = {state.derivative_of for state in signals.states}
    return [i for i, name in enumerate(signals.state_names) if name in of]


def _poses(pool: Pool, signals: Signals) -> list[tuple[int, int]]:
    """Sine and cosine of every angle, and of the difference and the sum of every two."""
    turning = sorted(angles(signals))
    nodes = [(i, turn(signals.states[i])) for i in turning]
    for i, j in combinations(turning, 2):
        period = turn(signals.states[i])
        if period == turn(signals.states[j]):
            nodes += [(pool.add("-", i, j), period), (pool.add("+", i, j), period)]
    return [(pool.wave("sin", node, period), pool.wave("cos", node, period)) for node, period in nodes]
