"""Candidates: the terms that sums are chosen from, rung by rung, with what is known of the law."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from twinloop._ground.elementary import log
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.directions import Direction, terms_of, unequal
from twinloop.identification.terms.formulas import parsed_term
from twinloop.identification.terms.libraries import rungs
from twinloop.identification.terms.pool import Pool
from twinloop.identification.terms.priors import Priors, priors_of
from twinloop.records import Recorded
from twinloop.signals import Signals

Ladder = tuple[tuple[int, ...], ...]
"""Terms of each rung; each rung has those of the rungs below it."""


@dataclass(frozen=True, eq=False)
class Candidates(Recorded, kind="candidates"):
    """Terms to choose from, as a value: who adds some makes another one, with a pool of its own.

    Args:
        pool: of all expressions.
        ladder: terms, rung by rung.
        priors: terms and bounds that a user knows.
    """

    pool: Pool
    ladder: Ladder
    priors: Priors

    @staticmethod
    def of(
        pool: Pool, signals: Signals, options: IdentificationOptions, form: str, known: Sequence[int] = ()
    ) -> Candidates:
        """Those of libraries, seeds and bounds.

        Args:
            pool: that they are entered in; nobody else's.
            signals: of the system.
            options: that name libraries and formulas.
            form: what outputs mean.
            known: terms that were found before; they are never out of reach, whatever rung they came from.
        """
        ladder: list[list[int]] = rungs(pool, signals, options.libraries, options.most_terms)
        base = ladder or [[pool.one, *range(pool.inputs)]]
        seeds = [parsed_term(formula, pool, signals) for formula in options.seed_terms]
        pool.rungs.update(dict.fromkeys(seeds, 0))
        ladder = [list(dict.fromkeys([*terms, *seeds, *known])) for terms in base]
        priors = priors_of(replace(options, form=form), pool, signals)
        # A bounded term that no rung has stands on the first one.
        bounded = dict.fromkeys(node for limits in priors.bounds.values() for node in limits)
        # The same in units of its scale would evade the bounds.
        ladder = [
            [node for node in terms if node in bounded or pool.bare(node) not in bounded] for terms in ladder
        ]
        strangers = [node for node in bounded if node not in ladder[-1]]
        pool.rungs.update(dict.fromkeys(strangers, 0))
        return Candidates(pool, tuple((*terms, *strangers) for terms in ladder), priors)

    def growing(self) -> Candidates:
        """The same with a copy of the pool, in which the caller may enter terms."""
        return replace(self, pool=self.pool.copy())

    def with_terms(self, terms: Iterable[int]) -> Candidates:
        """The same with more terms of its pool on the first rung."""
        pool, more = self.pool.copy(), tuple(terms)
        for term in more:
            pool.rungs.setdefault(term, 0)
        return replace(self, pool=pool, ladder=tuple(tuple(dict.fromkeys([*r, *more])) for r in self.ladder))

    def with_directions(
        self,
        found: Sequence[Direction],
        states: Iterable[int] = (),
        tilts: Sequence[int] = (),
        *,
        exact: bool = False,
    ) -> Candidates:
        """The same with terms of directions on the first rung; none that would evade the bounds of a plain one.

        Args:
            found: directions, one of which is chosen.
            states: that they are multiplied by, too.
            tilts: that those in which all pull the same way are multiplied by, too.
            exact: whether shares are known, as those of a mixer, and not constants that were found.
        """
        pool = self.pool.copy()
        bounded = {node for limits in self.priors.bounds.values() for node in limits}
        admitted = []
        for direction in found:
            # A direction is one of those found, and a share that is not that of all others a constant.
            constants = 0 if exact else unequal(direction)
            choice = float(log(len(found) + 1)) + pool.further * constants
            for term, plain in terms_of(pool, direction, states, tilts).items():
                if bounded.isdisjoint(plain):
                    pool.found.setdefault(term, pool.length(plain[0]) + choice)
                    admitted.append(term)
        return replace(self, pool=pool).with_terms(admitted)
