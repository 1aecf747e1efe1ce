"""Evolved features: a linear program of which every register is a feature; what read-outs use survives.

Where no library holds the law, expressions are grown from what was useful so far: products and other operations of
inputs and survivors. A found expression, up to the whole sum that drives another output, is one node and costs one
term.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from twinloop import _core
from twinloop._ground.elementary import log
from twinloop.identification.search.poles import divides
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum, search
from twinloop.identification.search.walks import Walks
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.pool import Pool
from twinloop.identification.terms.sizes import in_shares, size
from twinloop.law.expressions import UNARY
from twinloop.signals import Bounds, Signals

PRODUCTS = 0.5
"""Share of new nodes that are products: most laws of machines are made of them."""
CONSTANTS = 0.15
"""Share of new nodes that hold a constant of their own."""
GOOD = 10.0
"""Units of χ² by which a subset may be worse than the best whose nodes survive."""
LIFE = 3
"""Generations that a node survives which no good subset uses."""


def evolve(
    problem: Problem,
    known: Sequence[Sum],
    terms: Sequence[int],
    options: IdentificationOptions,
    walks: Walks,
    signals: Signals,
) -> list[Sum]:
    """Grows terms for a number of generations.

    Args:
        problem: of all chains.
        known: the best sum of each chain so far, with the noise to begin with.
        terms: the nodes to begin with.
        options: of the identification: operators, generations, population and longest.
        walks: over subsets of terms; nodes are drawn from their unit as well.
        signals: of the system, whose scales new nodes are made in.

    Returns:
        The best sum of each chain, never worse than the known one.
    """
    pool, draw = problem.pool, walks.unit.stream("terms")
    best, last = list(known), options.generations - 1
    survivors: dict[int, int] = dict.fromkeys(terms, 0)
    taken: set[int] = set()
    for generation in range(options.generations):
        candidates = _grown(pool, list(survivors), options, draw, signals, problem.room)
        wholes = [_whole(pool, found, taken) for found in best]
        # A chain may use what drives another one; its own sum would be a law that nobody has paid for, and so would
        # sums that use each other.
        favoured = [
            {node: length for j, whole in enumerate(wholes) if j != i for node, length in whole.items()}
            for i in range(len(wholes))
        ]
        usable = problem.usable([*candidates, *(node for whole in wholes for node in whole)])
        best = search(
            problem, [found.chain for found in best], usable, best, walks.part(generation),
            favoured=favoured, forbidden=[set(whole) for whole in wholes],
            fixed_noise=generation % 4 != 0 and generation != last,
        )  # fmt: skip
        survivors = _surviving(pool, survivors, best, options.population // 4)
    return best


def _grown(
    pool: Pool,
    parents: Sequence[int],
    options: IdentificationOptions,
    draw: _core.Stream,
    signals: Signals,
    room: Sequence[Bounds],
) -> list[int]:
    """Parents and new nodes, as many as are judged at once, or as can be drawn, less those infinite in the room.

    No others are drawn in place of these: what stands in for a quotient is no better.
    """
    candidates = dict.fromkeys(parents)
    tries = 0
    while len(candidates) < options.population and tries < 20 * options.population:
        tries += 1
        node = _drawn(pool, parents, options.operators, draw, signals)
        if node is not None and pool.length(node) <= options.longest:
            candidates.setdefault(node)
    known = set(pool.needed(parents))
    return [node for node in candidates if _is_finite(pool, set(pool.needed([node])) - known, signals, room)]


def _is_finite(pool: Pool, new: Collection[int], signals: Signals, room: Sequence[Bounds]) -> bool:
    """Whether none of some nodes divides by what may be 0."""
    quotients = (pool[node] for node in new if pool[node].operation == "/")
    return all(divides(pool, one.operands[1], signals.n_x, room) for one in quotients)


def _surviving(pool: Pool, survivors: Mapping[int, int], best: Sequence[Sum], unused: int) -> dict[int, int]:
    """Nodes that stay, with their ages: where a good subset uses them, and some of the others for a few generations."""
    used: set[int] = set()
    for found in best:
        used.update(found.weights)
        for other in found.others:
            if other.above < GOOD:
                used.update(other.terms)
    aged = {term: age + 1 for term, age in survivors.items() if age < LIFE and term not in used}
    kept = dict.fromkeys(sorted(used), 0) | dict(list(aged.items())[:unused])
    return dict.fromkeys(range(pool.inputs), 0) | {pool.one: 0} | kept


def _drawn(
    pool: Pool, parents: Sequence[int], operators: Sequence[str], draw: _core.Stream, signals: Signals
) -> int | None:
    """A new node of inputs and parents; None where it makes no sense.

    Products and sizes are what they are in any unit. For all else, and for constants, parents are in units of their
    sizes, two inputs of one unit in those of the first.
    """

    def pick() -> int:
        if draw.uniform() < 0.5:
            return draw.below(pool.inputs)
        return parents[draw.below(len(parents))]

    a, b = pick(), pick()
    if "*" in operators and draw.uniform() < PRODUCTS:
        return None if pool.one in (a, b) else pool.product(a, b)
    operation = operators[draw.below(len(operators))]
    if draw.uniform() < CONSTANTS:
        constant = draw.log_uniform(0.1, 10.0)
        kind = "+" if draw.uniform() < 0.5 else "*"
        a = pool.add(kind, in_shares(pool, a, signals), constant if draw.uniform() < 0.5 else -constant)
    if a == pool.one:
        return None
    if operation in UNARY:
        return pool.add(operation, a if operation == "abs" else in_shares(pool, a, signals))
    if b == pool.one or (operation in ("-", "/", "min", "max") and a == b):
        return None
    if operation == "*":
        return pool.add(operation, a, b)
    if operation == "/":
        return pool.add(operation, a, in_shares(pool, b, signals))
    if max(a, b) < signals.n_x and signals.states[a].unit == signals.states[b].unit:
        scale = size(pool, a, signals)
        return pool.add(operation, *((a, b) if scale is None else (pool.share(i, scale) for i in (a, b))))
    return pool.add(operation, in_shares(pool, a, signals), in_shares(pool, b, signals))


def _whole(pool: Pool, found: Sum, taken: set[int]) -> dict[int, float]:
    """The sum that drives another output, as one node at the price of one choice; none if it uses such a node."""
    if len(found.weights) < 2 or taken.intersection(pool.needed(found.weights)):
        return {}
    node: int | None = None
    for term, weight in found.weights.items():
        part = pool.add("*", term, weight)
        node = part if node is None else pool.add("+", node, part)
    assert node is not None
    taken.add(node)
    return {node: float(log(pool.inputs + 1))}
