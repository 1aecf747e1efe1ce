"""The ladder: libraries of terms that many machines' laws are made of, from the plainest up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations, combinations_with_replacement

from twinloop.identification.terms.attitude import attitude
from twinloop.identification.terms.pool import Pool
from twinloop.signals import DEGREES, Signals, State, rates

Terms = list[int]
FRICTION = 30.0
"""Steepness of dry friction at rest, in units of a speed's scale."""
LIKELIER = 1.0
"""Nats by which |x| x of a speed or a command is shorter than its square."""
PER_TIME = ("/s", "/min", "/h", "rpm")
"""Ends of units of what moves or flows."""
CUBIC_INPUTS = 13
"""States and commands, together, of which there are products of three: 455."""


def linear(pool: Pool, signals: Signals) -> Terms:
    """1, every state, every command; sine and cosine of a state that is periodic."""
    return [pool.one, *coordinates(pool, signals)]


def quadratic(pool: Pool, signals: Signals) -> Terms:
    """Products of two inputs; of a periodic state's, sine and cosine stand for it."""
    # The square of a cosine is 1 less that of its sine.
    cosines = {pool.wave("cos", i, signals.states[i].period) for i in periodic(signals)}
    pairs = combinations_with_replacement(coordinates(pool, signals), 2)
    return [pool.product(a, b) for a, b in pairs if a != b or a not in cosines]


def damping(pool: Pool, signals: Signals) -> Terms:
    """|x| x of inputs with two signs that are no angles: what slows a motion both ways, as its square does not.

    Where a speed had one sign only the readings do not tell drag from its square, which would drive the machine on as
    soon as it turns; where a command had, they do not tell a thruster that can turn round from one that cannot. So
    |x| x is taken to be the likelier of the two. Neither is as likely as the input itself, which a command that is only
    switched over does not tell from |x| x.
    """
    signed = [i for i in range(signals.n_x) if i not in angles(signals)]
    signed += [signals.n_x + j for j, u in enumerate(signals.commands) if u.bounds[0] < 0.0 < u.bounds[1]]
    moving = {i for i, state in enumerate(signals.states) if state.unit.endswith(PER_TIME)}
    likelier = rates(signals) | moving | set(range(signals.n_x, pool.inputs))
    terms: Terms = []
    for i in signed:
        terms.append(pool.product(pool.add("abs", i), i))
        if i in likelier:
            pool.found[pool.product(i, i)] = pool.length(terms[-1]) + LIKELIER
    return terms


def roots(pool: Pool, signals: Signals) -> Terms:
    """Square roots of levels, alone and times every command, and of what one level is above another, with their signs.

    What runs out of a vessel, or from one into another, is as their pressures say (Torricelli 1643).
    """
    terms: Terms = []
    for i in levels(signals):
        root = _signed_root(pool, pool.share(i, signals.states[i].scale))
        terms += [root, *(pool.product(j, root) for j in range(signals.n_x, pool.inputs))]
    for i, j in combinations(levels(signals), 2):
        if signals.states[i].unit == signals.states[j].unit:
            terms.append(_signed_root(pool, pool.share(pool.add("-", i, j), signals.states[i].scale)))
    return terms


def _signed_root(pool: Pool, node: int) -> int:
    """The root of a size, with its sign: below zero, where only noise or a wrong model leads, it still pulls back."""
    return pool.add("/", node, pool.add("sqrt", node))


def friction(pool: Pool, signals: Signals) -> Terms:
    """Dry friction of speeds, and speeds times the length of their vector."""
    terms: Terms = []
    for group in speeds(signals):
        for i in group:
            # Dry friction: a step at rest, of which tuning finds the width.
            steep = pool.add("*", i, FRICTION / signals.states[i].scale)
            terms.append(pool.add("tanh", steep))
        if len(group) > 1:
            total = pool.product(group[0], group[0])
            for i in group[1:]:
                total = pool.add("+", total, pool.product(i, i))
            length = pool.add("sqrt", total)
            terms += [pool.product(length, i) for i in group]
    return terms


def trigonometric(pool: Pool, signals: Signals) -> Terms:
    """Sin and cos of angles, alone and times every input."""
    terms: Terms = []
    for i in range(signals.n_x):
        if i in angles(signals):
            others = [j for j in range(pool.inputs) if j != i and j not in periodic(signals)]
            for function in ("sin", "cos"):
                wave = pool.wave(function, i, turn(signals.states[i]))
                terms += [wave, *(pool.product(j, wave) for j in others)]
    return terms


def quotients(pool: Pool, signals: Signals) -> Terms:
    """Inverses of distances and levels, and of their squares, alone and times every command and its square."""
    commands = range(signals.n_x, pool.inputs)
    above = [pool.one, *commands, *(pool.product(j, j) for j in commands)]
    below: Terms = []
    for i in distances(signals):
        # In shares of its scale: what is too small to divide by must not depend on the unit.
        share = pool.share(i, signals.states[i].scale)
        below += [share, pool.product(share, share)]
    return [pool.add("/", a, size) for size in below for a in above]


def cubic(pool: Pool, signals: Signals) -> Terms:
    """Products of three inputs; none where the list of inputs alone is too long."""
    if pool.inputs > CUBIC_INPUTS:
        return []
    triples = combinations_with_replacement(coordinates(pool, signals), 3)
    return [pool.product(*triple) for triple in triples]


RUNGS: tuple[dict[str, Callable[[Pool, Signals], Terms]], ...] = (
    {"linear": linear, "quadratic": quadratic, "damping": damping, "roots": roots, "attitude": attitude},
    {"friction": friction, "trigonometric": trigonometric, "quotients": quotients},
    {"cubic": cubic},
)
"""Libraries by name, in the order in which they are tried; those of one rung together."""
LIBRARIES = tuple(name for rung in RUNGS for name in rung)
"""Their names."""


def coordinates(pool: Pool, signals: Signals) -> Terms:
    """Every input, but sine and cosine of a periodic state, which itself jumps where it wraps."""
    terms: Terms = []
    for i in range(pool.inputs):
        period = signals.states[i].period if i in periodic(signals) else None
        waves = () if period is None else ("sin", "cos")
        terms += [pool.wave(function, i, period) for function in waves] or [i]
    return terms


def periodic(signals: Signals) -> set[int]:
    """States that wrap."""
    return {i for i, state in enumerate(signals.states) if state.period is not None}


def angles(signals: Signals) -> set[int]:
    """States that are measured in rad or degrees, or wrap."""
    units = ("rad", *DEGREES)
    return {i for i, state in enumerate(signals.states) if state.unit in units} | periodic(signals)


def turn(state: State) -> float | None:
    """A whole turn of an angle in its unit: what it wraps by, or 360 in degrees; None: 2π, in rad."""
    return 360.0 if state.period is None and state.unit in DEGREES else state.period


def speeds(signals: Signals) -> list[list[int]]:
    """Rates by their unit; where none are declared every state may be one."""
    groups: dict[str, list[int]] = {}
    for i in sorted(rates(signals) or range(signals.n_x)):
        groups.setdefault(signals.states[i].unit, []).append(i)
    return list(groups.values())


def distances(signals: Signals) -> list[int]:
    """States that are neither angles nor rates: places, levels, pressures, temperatures."""
    moving = angles(signals) | rates(signals)
    return [i for i in range(signals.n_x) if i not in moving]


def levels(signals: Signals) -> list[int]:
    """Distances of which no rate is declared."""
    moving = {state.derivative_of for state in signals.states}
    return [i for i in distances(signals) if signals.states[i].name not in moving]


def rungs(pool: Pool, signals: Signals, names: Sequence[str], most: int) -> list[Terms]:
    """Growing sets of terms: each rung has the terms of those below it.

    Args:
        pool: where the terms are entered.
        signals: they say which states are angles, rates and distances.
        names: of the libraries.
        most: a library with which a rung would have more terms than this is left out.

    Returns:
        Terms of each rung, without repetition.
    """
    ladder: list[Terms] = []
    terms: Terms = []
    for rung in RUNGS:
        below = len(terms)
        for library in (library for name, library in rung.items() if name in names):
            more = list(dict.fromkeys([*terms, *library(pool, signals)]))
            terms = terms if len(more) > most else more
        if len(terms) > below:
            ladder.append(terms)
            for term in terms:
                pool.rungs.setdefault(term, len(ladder) - 1)
    return ladder
