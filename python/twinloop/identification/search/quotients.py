"""Quotients: sums of plain terms and of terms over one denominator, that a law pays for once.

What may be above and below the line comes from an implicit regression. The denominator's constants are then refined by
steps of Gauss and Newton, of which each is a regression as well (Sanathanan and Koerner 1963), and a search among plain
terms and those over it says by description length what it is worth. Where it is worth its price it is offered to all
other chains, which need not pay for it again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from twinloop._ground.elementary import log
from twinloop.identification.description import shorter, shortest
from twinloop.identification.search.implicit import Quotient, bounded, implicit, matters, price_below
from twinloop.identification.search.newton import refined
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.saturation import inverses, saturations
from twinloop.identification.search.structure import RUNG, Sum, search
from twinloop.identification.search.walks import Walks
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.denominators import (
    FIRST_RUNG,
    HIGHEST,
    Denominator,
    above_it,
    denominators,
    over,
    plain,
    power_in,
    power_of,
    quotient,
    states_in,
)
from twinloop.signals import Signals

FIRST = 1000
"""Number of the first unit of work within a search's own, which has lower ones for itself."""
ALONE = 5000
"""Number of the first unit of work that looks for states alone below the line."""
ROUNDS = 2
"""Denominators of one sum at most."""
WORTH = RUNG
"""What a new denominator must gain, in units of χ², beside its price."""
TURNS = 2
"""How often the terms over a denominator are chosen, and its constants refined behind them."""
OWN = 10
"""Share of the moves, inverted, that a search among a few terms takes."""
CHOICE = float(log(2.0))
"""Nats of the choice whether a term is over a denominator that is there."""


def with_quotients(
    problem: Problem, signals: Signals, known: Sequence[Sum], terms: Sequence[int], walks: Walks
) -> list[Sum]:
    """The best sums with quotients among their terms, where these make descriptions shorter.

    Args:
        problem: of all chains; new expressions are entered in its pool.
        signals: of the system.
        known: the best sum of each chain so far, with its noise.
        terms: of the ladder, which quotients must be shorter than.
        walks: over subsets of terms.

    Returns:
        A sum for each chain, the very one that was known where no quotient is worth its price.
    """
    finder = _Finder(problem, signals, terms, walks)
    best = finder.shared(known)
    for number in range(ROUNDS):
        candidates = [
            [*first, *second, *third]
            for first, second, third in zip(
                implicit(problem, signals, best, walks.part(FIRST + 2 * number)),
                saturations(problem, signals, best, walks.part(FIRST + 2 * number + 1)),
                inverses(problem, signals, best, walks.part(ALONE + number)),
                strict=True,
            )
        ]
        found = finder.best_of(best, candidates)
        if all(new is old for new, old in zip(found, best, strict=True)):
            break
        best = finder.shared(found)
    finder.price(best)
    return best


def renewed(problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> list[Sum]:
    """The same sums with denominators refined on a problem's states, where that makes descriptions shorter.

    Args and returns as those of `with_quotients`.
    """
    finder = _Finder(problem, signals, (), walks)
    best = finder.shared([finder.renewed(found) for found in known])
    finder.price(best)
    return best


class _Finder:
    """Searches among terms over denominators; each draws from the next part of the unit."""

    def __init__(self, problem: Problem, signals: Signals, terms: Sequence[int], walks: Walks) -> None:
        self.problem, self.pool, self.signals, self.terms = problem, problem.pool, signals, terms
        self.walks, self.few = walks, walks.with_moves(walks.moves // OWN)
        self._searches = FIRST + 2 * ROUNDS

    def best_of(self, known: Sequence[Sum], candidates: Sequence[Sequence[Quotient]]) -> list[Sum]:
        """For each chain what is known, or the best sum over one of its candidates if that is shorter."""
        best = list(known)
        for i, quotients in enumerate(candidates):
            for candidate in quotients:
                found = self._with(known[i], candidate)
                if found is None:
                    continue
                found = self._lengthened(known[i], found)
                if not shorter(found.description_length, best[i].description_length):
                    continue
                rival = self._rival(known[i], found.chain)
                to_beat = rival.description_length
                if not shorter(found.description_length + WORTH, to_beat):
                    to_beat += self._saved(found, i, known, candidates)
                if shorter(found.description_length + WORTH, to_beat):
                    best[i] = found
                elif shorter(rival.description_length, best[i].description_length):
                    best[i] = rival
        return best

    def _lengthened(self, known: Sum, found: Sum) -> Sum:
        """A sum over a denominator of one power of a state, or the one over the next power too, if that is shorter.

        Plain terms stand in for it where the runs were, and run away elsewhere: so it has to do without those.
        """
        best = found
        for own in self._all([found]):
            single = power_in(self.pool, *own.nodes) if len(own.parts) == 1 else None
            if single is None:
                continue
            state, power = single
            split = self._split(best, own)
            without = tuple(term for term in split.plain if state not in self.pool.leaves(term))
            if power == HIGHEST or not split.above or without == split.plain:
                continue
            longer = Denominator((*own.parts, (power_of(self.pool, state, power + 1), 0.0)))
            again = self._with(known, Quotient(without, split.above, longer))
            if again is not None and shorter(again.description_length, best.description_length):
                best = again
        return best

    def _saved(
        self, found: Sum, place: int, known: Sequence[Sum], candidates: Sequence[Sequence[Quotient]]
    ) -> float:
        """By how much other chains that ask for alike denominators get shorter over those of a sum, in units of χ².

        What one equation pays for a denominator may be too much for it alone: what one substance loses another gains.
        """
        total = 0.0
        for denominator in self._all([found]):
            states = states_in(self.pool, denominator)
            for j, (other, own) in enumerate(zip(known, candidates, strict=True)):
                if j == place or all(states_in(self.pool, each.denominator) != states for each in own):
                    continue
                over_it = self._searched(other.chain, denominator, other)
                total += max(0.0, other.description_length - over_it.description_length)
        return total

    def shared(self, known: Sequence[Sum]) -> list[Sum]:
        """The same, or sums over a denominator that another chain has paid for."""
        best = list(known)
        for denominator in self._all(known):
            for i, found in enumerate(best):
                others = [other for j, other in enumerate(best) if j != i]
                own = bool(self._split(found, denominator).above) or bounded(self.problem, found)
                if own or denominator not in self._all(others):
                    continue
                alike = [each for each in self._all([found]) if each.nodes == denominator.nodes]
                tried = [self._carried(found, each, denominator, 0.0) for each in alike]
                tried.append(self._searched(found.chain, denominator, found))
                best[i] = shortest([found, *tried], lambda sum_: sum_.description_length)
        return best

    def renewed(self, known: Sum) -> Sum:
        """A sum with its denominators refined."""
        for own in self._all([known]):
            if not own.one or not self._split(known, own).above:
                continue  # it has no constants, or what was refined before it has taken its terms
            there = refined(self.problem, known.chain, self._split(known, own))
            new = self._carried(known, own, there, self._share(own, [known]))
            known = new if shorter(new.description_length, known.description_length) else known
        return known

    def _rival(self, known: Sum, chain: Chain) -> Sum:
        """What terms of the ladder make of a chain under the noise of a quotient, or what is known if it is shorter.

        Noise that was taken for too large hides in a disturbance what terms explain as well, whichever they are.
        """
        terms = [*self.terms, *known.weights]
        tried = [self._search(chain, terms, None, {}, self.walks)]
        tried.append(self._search(chain, list(known.weights), None, {}, self.few))
        return shortest([known, *tried], lambda found: found.description_length)

    def _carried(self, known: Sum, own: Denominator, there: Denominator, share: float) -> Sum:
        """A sum whose terms over one denominator are over another; each pays a share of that, nats."""
        lengths, terms = {}, []
        for term in known.weights:
            parts = quotient(self.pool, term)
            if parts is not None and parts[1] == own:
                term = over(self.pool, parts[0], there)
                lengths[term] = self.pool.length(parts[0]) + CHOICE + share
                self.pool.rungs.setdefault(term, FIRST_RUNG)
            terms.append(term)
        return self._search(known.chain, terms, None, lengths, self.few)

    def price(self, sums: Sequence[Sum]) -> None:
        """From now on each term over a denominator costs its share of that; what was only tried stands on no rung."""
        used = {term for found in sums for term in found.weights}
        for denominator in self._all(sums):
            share = self._share(denominator, sums)
            for term in used:
                parts = quotient(self.pool, term)
                if parts is not None and parts[1] == denominator:
                    self.pool.found[term] = self.pool.length(parts[0]) + CHOICE + share
        for term in [t for t in self.pool.rungs if t not in used and quotient(self.pool, t) is not None]:
            if term not in self.pool.found:
                del self.pool.rungs[term]

    def _share(self, denominator: Denominator, sums: Sequence[Sum]) -> float:
        """What a denominator costs each term over it, nats, where all of them pay the same."""
        over_it = {
            term: found.chain
            for found in sums
            for term in found.weights
            if (parts := quotient(self.pool, term)) is not None and parts[1] == denominator
        }
        chain = next(iter(over_it.values()))
        return 0.5 * price_below(self.pool, denominator, self.problem.readings(chain), 1) / len(over_it)

    # Steps

    def _with(self, known: Sum, candidate: Quotient) -> Sum | None:
        """The best sum of plain terms and terms over a candidate's denominator, with what that costs."""
        denominator = refined(self.problem, known.chain, candidate)
        best: Sum | None = None
        for _ in range(TURNS):
            if not matters(self.problem, denominator):
                break
            # What is known may stand in for the quotient: at first it is left out.
            own = [t for t in known.weights if best is not None or quotient(self.pool, t) is not None]
            found = self._searched(known.chain if best is None else best.chain, denominator, best, own)
            split = self._split(found, denominator)
            if not split.above:
                break
            denominator = refined(self.problem, found.chain, split)
            ratios = self._over([*split.plain, *split.above], denominator)
            terms = [*split.plain, *split.above, *ratios]
            again = self._search(found.chain, terms, None, ratios, self.few)
            again = self._paid(again, denominator)
            if not matters(self.problem, denominator) or (
                best and not shorter(again.description_length, best.description_length)
            ):
                break
            best = again
            if not shorter(best.description_length, known.description_length + WORTH):
                break  # as long as that it will hardly become the shorter one
        return best

    def _searched(
        self, chain: Chain, denominator: Denominator, known: Sum | None, extra: Sequence[int] = ()
    ) -> Sum:
        """The best sum among plain terms, those over a denominator, and some more; nothing is paid for that."""
        own = [] if known is None else [p[0] for t in known.weights if (p := quotient(self.pool, t))]
        ratios = self._over([*above_it(self.pool, self.signals, denominator), *own], denominator)
        terms = [*plain(self.pool, self.signals), *ratios, *extra]
        return self._search(chain, terms, known, ratios, self.walks)

    def _search(
        self, chain: Chain, terms: Sequence[int], known: Sum | None, ratios: dict[int, float], walks: Walks
    ) -> Sum:
        self._searches += 1
        walks = walks.part(self._searches)
        (found,) = search(self.problem, [chain], terms, [known], walks, favoured=[ratios])
        return found

    def _over(self, terms: Sequence[int], denominator: Denominator) -> dict[int, float]:
        """Terms over a denominator, with their description lengths where that is paid for."""
        ratios = {over(self.pool, term, denominator): self.pool.length(term) + CHOICE for term in terms}
        for node in ratios:
            self.pool.rungs.setdefault(node, FIRST_RUNG)
        return ratios

    def _paid(self, found: Sum, denominator: Denominator) -> Sum:
        """A sum with the price of a denominator in its description, if it uses that."""
        used = bool(self._split(found, denominator).above)
        return replace(
            found, description_length=found.description_length + self._cost(denominator, found.chain) * used
        )

    def _cost(self, denominator: Denominator, chain: Chain) -> float:
        return price_below(self.pool, denominator, self.problem.readings(chain), len(self.problem.runs))

    def _split(self, found: Sum, denominator: Denominator) -> Quotient:
        """A sum's terms over a denominator, without that, and all others."""
        wanted = Denominator(tuple(sorted(denominator.parts)), denominator.one)
        beside, over_it = [], []
        for term in found.weights:
            parts = quotient(self.pool, term)
            if parts is not None and parts[1] == wanted:
                over_it.append(parts[0])
            else:
                beside.append(term)
        return Quotient(tuple(beside), tuple(over_it), denominator)

    def _all(self, sums: Sequence[Sum]) -> list[Denominator]:
        return denominators(self.pool, (term for found in sums for term in found.weights))
