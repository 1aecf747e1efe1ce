"""Which terms drive each chain: a search over subsets on whitened features, up a ladder of libraries."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log, power
from twinloop._ground.side_by_side import side_by_side
from twinloop.identification.search.moderation import precisions
from twinloop.identification.search.noise import RIDGE
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.subsets import Judge, Judged
from twinloop.identification.search.walks import Subsets, Walks
from twinloop.identification.sensors.chains import Chain, Motion
from twinloop.identification.sensors.noise import floor_of
from twinloop.identification.terms.pool import Pool
from twinloop.records import Record, Recorded, with_names

Weights = dict[int, float]
"""Coefficients of a sum, by node."""
Walk = Callable[[Sequence[_core.Gram], Sequence[Floats], int], Sequence[Subsets]]
"""Annealed walks: from inner products and prices, a pair for each chain, and the number of the walks."""
OTHERS = 40
"""Subsets of a chain that are kept, the best one among them."""
NOISE_ROUNDS = 5
"""Times at most that terms are searched and the noise that they leave is estimated."""
FEW_RUNS = 5
"""Runs up to which each is taken to tell something of its own."""
RESEMBLANCE = 0.75
"""Power with which prices rise from there on; with 1, no weak term that is true would be found by flying on."""
MOST_FEEDTHROUGH = 0.25
"""Share of a reading's noise in its own prediction from which a law is taken to explain the noise with itself: nothing
that can be flown grows by half, of itself, in a period."""
FEEDTHROUGH_PRICES = (1e2, 1e3, 1e4, 1e5, 1e6)
"""What a feedthrough of 1 is made to cost, a reading, in units of χ²."""
RUNG = 20.0
"""What a richer library must gain before it is believed, in units of χ²: it holds many aliases of the law."""


class Other(NamedTuple):
    """Another subset of terms that is nearly as good.

    Args:
        terms: of it, as nodes.
        above: by what its description is longer, in units of χ².
    """

    terms: tuple[int, ...]
    above: float


@dataclass(eq=False)
class Sum(Recorded, kind="sum"):
    """A sum of terms that drives a chain.

    Args:
        weights: coefficients by node.
        description_length: of it: −2 log of the likelihood at `chain`'s noise, and the price of its terms.
        chain: with the noise under which it was found.
        others: other subsets that are nearly as good, the best first.
    """

    weights: Weights
    description_length: float
    chain: Chain
    others: list[Other] = field(default_factory=list)

    VERSION = 3
    RENAMED: ClassVar[Mapping[str, str]] = {"energy": "description_length"}

    @property
    def subsets(self) -> list[Other]:
        """Its own terms, and the others behind them."""
        return [Other(tuple(self.weights), 0.0), *self.others]

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version, in which other subsets had no names."""
        found = super().renewed(record)
        if "others" in found:
            found["others"] = with_names(found["others"], Other._fields)
        return found


def prices(
    pool: Pool,
    terms: Sequence[int],
    readings: int,
    runs: int,
    favoured: Mapping[int, float] | None = None,
    forbidden: Container[int] = (),
) -> Floats:
    """What each term costs, in units of χ²: a coefficient, and the description of its expression.

    Args:
        pool: of the terms.
        terms: to be priced.
        readings: whose number gives a coefficient's precision.
        runs: that they are of. Many resemble one another: what a law that is not quite right leaves on one it leaves on
            all, and what explains it gains with each without being any truer. So prices rise with their number.
        favoured: description lengths in nats of terms that are known from elsewhere.
        forbidden: terms that nothing can pay for.

    Returns:
        Prices (terms,).
    """
    known = favoured or {}
    lengths = [known[term] if term in known else pool.length(term) for term in terms]
    costs: Floats = log(max(readings, 2)) + 2.0 * np.array(lengths)
    return np.where(
        [term in forbidden for term in terms], np.inf, costs * power(max(1.0, runs / FEW_RUNS), RESEMBLANCE)
    )


def priced(pool: Pool, terms: Sequence[int], readings: int, runs: int) -> float:
    """What a sum of terms pays beside its misfit, in units of χ²: each of them, and the rung that they stand on."""
    return RUNG * pool.rung(terms) + float(prices(pool, terms, readings, runs).sum())


def search(
    problem: Problem,
    chains: Sequence[Chain],
    terms: Sequence[int],
    known: Sequence[Sum | None],
    walks: Walks,
    *,
    favoured: Sequence[Mapping[int, float]] = (),
    forbidden: Sequence[set[int]] = (),
    fixed_noise: bool = False,
) -> list[Sum]:
    """The best sum of terms for each chain, with the noise estimated along.

    Args:
        problem: of all chains.
        chains: with the noise to begin with.
        terms: to choose from.
        known: for each chain a sum that is already known, or None; the answer is never worse.
        walks: over subsets of them; those of the rounds after the first are half as long and as many.
        favoured: for each chain, description lengths in nats of terms that are known from elsewhere.
        forbidden: for each chain, terms that it may not use.
        fixed_noise: whether the chains' noise is to be believed.

    Returns:
        A sum for each chain.
    """
    usable = usable_among(problem, terms, known)
    columns = problem.values(usable)
    searched = _posed(problem, chains, usable, known, favoured, forbidden)
    unsettled = [(one, problem.regression(one.chain, columns)) for one in searched]
    for round_ in range(NOISE_ROUNDS):
        grams = side_by_side(
            lambda pair: pair[1].gram(pair[0].chain.sensors, pair[0].chain.motion, problem.workers),
            unsettled,
            problem.workers.threads,
        )
        for (one, _), gram in zip(unsettled, grams, strict=True):
            one.gram = gram
        _choose(problem, usable, [one for one, _ in unsettled], _walk_of(walks, round_, problem))
        if fixed_noise:
            break
        before = [one.chain for one, _ in unsettled]
        noises = _core.most_likely_noises(
            [one.left(regression, problem) for one, regression in unsettled], problem.workers
        )
        for (one, _), (sensors, motion, _) in zip(unsettled, noises, strict=True):
            # Corrected for the degrees of freedom that were used.
            readings, used = problem.readings(one.chain), len(one.subsets[0].features)
            one.chain = one.chain.with_noise(sensors * readings / max(1.0, readings - used), motion)
        # Chains share nothing but their features: one whose noise has settled waits for no other.
        pairs = zip(unsettled, before, strict=True)
        unsettled = [pair for pair, chain in pairs if _differ(pair[0].chain, chain, problem)]
        if not unsettled:
            break
    return [_sum(problem, usable, one) for one in searched]


def search_known(
    problem: Problem,
    chains: Sequence[Chain],
    usable: Sequence[int],
    known: Sequence[Sum | None],
    walks: Walks,
    grams: Sequence[_core.Gram],
) -> list[Sum]:
    """The same with noise that is believed, where inner products are known already.

    Args as those of `search`, and:
        usable: terms to choose from, all usable and those of known sums among them.
        grams: for each chain, inner products of those terms under its noise.
    """
    searched = _posed(problem, chains, usable, known)
    for one, gram in zip(searched, grams, strict=True):
        one.gram = gram
    _choose(problem, usable, searched, _walk_of(walks, 0, problem))
    return [_sum(problem, usable, one) for one in searched]


def weighed(problem: Problem, chain: Chain, usable: Sequence[int]) -> Weights | None:
    """Weights of terms that were found usable, all of which explain a chain together; None where they are collinear."""
    gram = problem.gram(chain, problem.values(usable))
    solved = gram.least_squares(list(range(len(usable))), RIDGE)
    return None if solved is None else dict(zip(usable, solved[0].tolist(), strict=True))


def usable_among(problem: Problem, terms: Sequence[int], known: Sequence[Sum | None]) -> list[int]:
    """What is to be chosen from: terms, and those of known sums, as far as they are usable."""
    return problem.usable(list(dict.fromkeys([*terms, *(t for s in known if s for t in s.weights)])))


@dataclass(eq=False)
class _Searched:
    """What is searched for one chain, and what has been found.

    Args:
        chain: with the noise that the last round has left.
        known: a sum to do no worse than, or None.
        costs: of the terms, in units of χ².
        prior: precisions of their coefficients.
        subsets: of the last round, the best first.

    Attributes:
        gram: inner products under the noise of the round, without the prior.
    """

    chain: Chain
    known: Sum | None
    costs: Floats
    prior: Floats
    subsets: list[Judged] = field(default_factory=list)
    gram: _core.Gram = field(init=False)

    def left(
        self, regression: _core.Regression, problem: Problem
    ) -> tuple[_core.Regression, Floats, Floats, Motion, Floats, Motion]:
        """The noise under which what its best subset leaves is most likely, as a problem for the engine."""
        chain = self.chain
        coefficients = self.subsets[0].spread(len(self.costs))
        floor = floor_of(chain, problem.dt, problem.integration(chain))
        return regression, coefficients, chain.sensors, chain.motion, *floor


def _posed(
    problem: Problem,
    chains: Sequence[Chain],
    usable: Sequence[int],
    known: Sequence[Sum | None],
    favoured: Sequence[Mapping[int, float]] = (),
    forbidden: Sequence[Container[int]] = (),
) -> list[_Searched]:
    """What is searched for each chain, among terms that are usable."""
    lengths = {term: problem.pool.length(term) for term in usable}
    return [
        _Searched(
            chain,
            other,
            prices(
                problem.pool,
                usable,
                problem.readings(chain),
                len(problem.runs),
                {**lengths, **problem.as_written(chain, usable), **elsewhere},
                out,
            ),
            precisions(problem, chain, usable),
        )
        for chain, other, elsewhere, out in zip(
            chains, known, favoured or [{}] * len(chains), forbidden or [set()] * len(chains), strict=True
        )
    ]


def _walk_of(walks: Walks, round_: int, problem: Problem) -> Walk:
    """The walks of a round; those of each number draw from a stream of their own."""
    share = 1 if round_ == 0 else 2
    shorter = replace(walks, moves=walks.moves // share, starts=max(1, walks.starts // share))

    def walk(grams: Sequence[_core.Gram], costs: Sequence[Floats], number: int) -> Sequence[Subsets]:
        return shorter.part(number * NOISE_ROUNDS + round_).among(grams, costs, problem.workers)

    return walk


def _sum(problem: Problem, usable: Sequence[int], searched: _Searched) -> Sum:
    """The best subset of a chain as a sum under its noise, with the others beside it."""
    best, *behind = searched.subsets
    others = [
        Other(tuple(usable[j] for j in other.features), max(0.0, other.length - best.length))
        for other in behind[: OTHERS - 1]
    ]
    chain = searched.chain
    regression = problem.regression(chain, problem.values([usable[j] for j in best.features]))
    score = regression.likelihood(best.weights, chain.sensors, chain.motion)
    score += float((searched.prior * np.square(best.spread(len(usable)))).sum())
    rung = RUNG * problem.pool.rung(usable[j] for j in best.features)
    length = rung + score + float(searched.costs[list(best.features)].sum())
    weights = {usable[j]: float(w) for j, w in zip(best.features, best.weights, strict=True)}
    return Sum(weights, length, chain, others)


def _choose(problem: Problem, usable: Sequence[int], searched: Sequence[_Searched], walk: Walk) -> None:
    """Gives each chain what walks find and what was known, the best first; none predicts a reading by its own noise.

    Where a share J of a reading's noise is in the prediction of the same reading, the law leaves (1 − J) of that noise:
    it explains the noise with itself. Runs under one and the same controller offer such laws, for their commands are
    sums of readings, and what tells the sum of all readings from that of all but the last is the last. Where one is
    found, walks are repeated in which J costs something, and more until they find laws without.
    """
    place = {term: i for i, term in enumerate(usable)}

    def best(one: _Searched, gram: _core.Gram, walked: Subsets) -> list[Judged]:
        """What the walks of a chain have found, and what was known of it, the best first."""
        subsets = [tuple(subset) for subset, _ in walked]
        if one.known is not None and all(term in place for term in one.known.weights):
            subsets.append(tuple(sorted(place[term] for term in one.known.weights)))
        return sorted(
            Judge(gram, one.costs, problem.limits(one.chain, usable))(subsets),
            key=lambda found: (
                found.length + RUNG * problem.pool.rung(usable[j] for j in found.features),
                found.features,
            ),
        )

    grams = [one.gram.with_prior(one.prior) for one in searched]
    walks = walk(grams, [one.costs for one in searched], 0)
    for one, gram, walked in zip(searched, grams, walks, strict=True):
        one.subsets = best(one, gram, walked)
    for i, (one, gram) in enumerate(zip(searched, grams, strict=True)):
        chain = one.chain
        if (
            chain.form != "acceleration"
            or _feedthrough(problem, chain, usable, one.subsets[0]) <= MOST_FEEDTHROUGH
        ):
            continue
        rows = problem.feedthrough(chain, usable)
        for attempt, price in enumerate(FEEDTHROUGH_PRICES):
            dear = gram.with_rows(np.sqrt(price) * np.column_stack([rows, np.zeros(len(rows))]))
            (walked,) = walk([dear], [one.costs], 1 + i * len(FEEDTHROUGH_PRICES) + attempt)
            # Where the noise was taken for much too small every term pays, and only the price itself keeps J down.
            found = [
                law
                for of in (gram, dear)
                for law in best(one, of, walked)
                if _feedthrough(problem, chain, usable, law) <= MOST_FEEDTHROUGH
            ]
            if found:
                one.subsets = found
                break


def _feedthrough(problem: Problem, chain: Chain, usable: Sequence[int], judged: Judged) -> float:
    """Share of a reading's noise that is in a law's prediction of the same reading."""
    if not judged.features:
        return 0.0
    shares = problem.feedthrough(chain, [usable[j] for j in judged.features]).mean(axis=0)
    return float((shares * judged.weights).sum())


def _differ(new: Chain, old: Chain, problem: Problem) -> bool:
    """Whether a chain's noise is so much another one that its terms may be."""
    _, slow = floor_of(old, problem.dt, problem.integration(old))
    moved = (abs(log((new.motion[i] + slow[i]) / (old.motion[i] + slow[i]))) > 1.0 for i in range(2))
    return bool(np.any(np.abs(log(new.sensors / old.sensors)) > 0.3)) or any(moved)


def total(sums: Sequence[Sum]) -> float:
    """Description length of all sums."""
    return sum(found.description_length for found in sums)
