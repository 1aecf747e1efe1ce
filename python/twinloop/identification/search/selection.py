"""Selection: which terms drive each chain, up a ladder of candidates, with the noise estimated from below and above."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from twinloop import _core
from twinloop.elementary import log
from twinloop.identification.identified import Identified
from twinloop.identification.inputs.hidden import filled
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.description import shorter, shortest
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import Sum, search
from twinloop.identification.sensors.chains import Chain, chains
from twinloop.identification.sensors.noise import calm, declared_noise, first_noise, given_noise, unexplained
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.directions import directions, terms_of, unequal
from twinloop.identification.terms.evolution import evolve
from twinloop.identification.terms.formulas import parsed_term
from twinloop.identification.terms.libraries import rungs
from twinloop.identification.terms.pool import Pool
from twinloop.identification.terms.priors import told
from twinloop.signals import Signals
from twinloop.streams import Purpose, Unit

CALMER = 20.0
"""What terms must gain, in units of χ², that take the place of what disturbs."""


class Selection:
    """Candidates, rung by rung, and the searches among them; each search draws from the next stream.

    `driven` are the chains that outputs drive, `given` those that other states do, with the noise to begin with.

    Args:
        runs: recorded.
        signals: of the system.
        options: of the identification.
        pool: of all expressions.
        known: what was learnt from fewer runs; its terms are candidates again.
        unit: of work; each search is a part of it.
        workers: how the work is carried out.
        watch: called with the name of each step.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        signals: Signals,
        options: IdentificationOptions,
        pool: Pool,
        known: Identified | None,
        unit: Unit,
        workers: _core.Workers,
        watch: Callable[[str], None] = lambda step: None,
    ) -> None:
        self.signals = signals
        self.options = options
        self.pool = pool
        self.known = known
        self.unit = unit
        self.workers = workers
        self.watch = watch
        self.scales = np.array([state.scale for state in signals.states])
        every = chains(signals, options.form, guessed_noise(runs, self.scales))
        self.driven = [declared_noise(chain, signals) for chain in every if chain.output is not None]
        self.given = [given_noise(chain, signals) for chain in every if chain.output is None]
        self.ladder = self._ladder()
        self.told = told(options, pool, signals)
        self._admit_bounded()
        self._searches = 0

    def of_part(self, run: Run, unit: Unit) -> Selection:
        """A brief one on part of a run, where nothing is known."""
        options = self.options.brief()
        return Selection([run], self.signals, options, self.pool, None, unit, self.workers)

    def alone(self, problem: Problem) -> list[Sum]:
        """The best sums where nothing is known."""
        nothing: list[Sum | None] = [None] * len(self.driven)
        return self.climb(problem, self.from_both_sides(problem, self.ladder[0], nothing)[0])

    def from_both_sides(
        self, problem: Problem, terms: Sequence[int], known: Sequence[Sum | None]
    ) -> tuple[list[Sum], list[Sum]]:
        """The shorter description of each chain with the noise estimated from below or from above, and that from above.

        From below, little noise makes many terms of few runs and stays little; from above, the strongest terms come
        first and the noise falls as far as they explain it.
        """
        options = self.options
        usable = problem.usable(terms)
        below = [first_noise(problem, chain, usable, options.gusts) for chain in self.driven]
        low = self.search(problem, terms, known, below, options.moves, 2)
        if not options.noise_from_above:
            return low, low
        above = [unexplained(problem, chain, options.gusts) for chain in self.driven]
        none: list[Sum | None] = [None] * len(self.driven)
        high = self.search(problem, terms, none, above, options.moves, 2)
        return [shortest(both, lambda found: found.energy) for both in zip(low, high, strict=True)], high

    def climb(self, problem: Problem, known: Sequence[Sum], brief: bool = False) -> list[Sum]:
        """The best sums of all rungs and of evolved terms, where some are known; `brief`: of the first rung only.

        Directions of commands that are read off the known sums stand on the first rung from then on.
        """
        options, best = self.options, list(known)
        if options.libraries:
            if options.directions and not brief:
                self._admit_directions(problem, best)
            for number, terms in enumerate(self.ladder[:1] if brief else self.ladder):
                starts = options.starts if number == 0 and not brief else max(1, options.starts // 2)
                driven = [found.chain for found in best]
                best = self.search(
                    problem, terms, best, driven, options.moves, starts, fixed_noise=number > 0
                )
        if options.generations and not (brief and options.libraries):
            self.watch("evolution")
            seeds = (
                list(self.ladder[0]) if not options.libraries else [self.pool.one, *range(self.pool.inputs)]
            )
            seeds += [node for found in best for node in found.weights]
            for _ in range(options.restarts):
                best = evolve(
                    problem, best, seeds,
                    operators=options.operators, generations=options.generations,
                    population=options.population, longest=options.longest, moves=options.moves // 4,
                    largest=options.largest, unit=self._next(),
                )  # fmt: skip
        return best

    def search(
        self,
        problem: Problem,
        terms: Sequence[int],
        known: Sequence[Sum | None],
        driven: Sequence[Chain],
        moves: int,
        starts: int,
        *,
        fixed_noise: bool = False,
        unit: Unit | None = None,
        purpose: Purpose = "subsets",
    ) -> list[Sum]:
        """One search among some terms, as `structure.search`; the next one of this selection, or a unit of its own."""
        return search(
            problem, driven, terms, known,
            moves=moves, starts=starts, largest=self.options.largest,
            unit=self._next() if unit is None else unit, purpose=purpose, fixed_noise=fixed_noise,
        )  # fmt: skip

    def undisturbed(self, problem: Problem, known: Sequence[Sum]) -> list[Sum]:
        """The best sums where what disturbs is explained by terms as well, with noise that is estimated behind them.

        Under a disturbance that explains all that is left no further term gains anything. So terms are searched as if
        nothing disturbed, too: first those that are known, for it may be that only their noise was mistaken.
        """
        best, moves = list(known), self.options.moves // 2
        own = list(dict.fromkeys(node for found in known for node in found.weights))
        for terms, tried in ((own, moves // 10), (self.ladder[-1], moves)):
            driven = [calm(problem, found.chain) for found in best]
            if all(quiet is found.chain for quiet, found in zip(driven, best, strict=True)):
                break
            calmer = self.search(problem, terms, best, driven, tried, 1)
            best = [
                new if shorter(new.energy + CALMER, old.energy) else old
                for old, new in zip(best, calmer, strict=True)
            ]
        return best

    def admit_hidden(self) -> None:
        """Terms of a hidden state stand on the first rung, and so do those that were known of it."""
        self._admit(
            [*filled(self.pool), *(node for node in self._known_terms() if self.pool.is_hidden(node))]
        )

    def _admit_directions(self, problem: Problem, sums: Sequence[Sum]) -> None:
        """Terms of directions stand on the first rung; none that would evade the bounds of a plain one."""
        bounded = {node for limits in self.told.bounds.values() for node in limits}
        found, admitted = directions(problem, sums, self.signals), []
        for direction in found:
            # A direction is one of those found, and a share that is not that of all others a constant.
            choice = float(log(len(found) + 1)) + self.pool.further * unequal(direction)
            for term, plain in terms_of(self.pool, direction, self.signals).items():
                if bounded.isdisjoint(plain):
                    self.pool.found.setdefault(term, self.pool.length(plain[0]) + choice)
                    admitted.append(term)
        self._admit(admitted)

    def _admit(self, terms: Sequence[int]) -> None:
        """Terms stand on the first rung."""
        for term in terms:
            self.pool.rungs.setdefault(term, 0)
        self.ladder = [list(dict.fromkeys([*rung, *terms])) for rung in self.ladder]

    def _next(self) -> Unit:
        self._searches += 1
        return self.unit.part(self._searches)

    def _ladder(self) -> list[list[int]]:
        """Candidates, rung by rung."""
        options = self.options
        ladder = rungs(self.pool, self.signals, options.libraries, options.most_terms)
        base = ladder or [[self.pool.one, *range(self.pool.inputs)]]
        seeds = [parsed_term(formula, self.pool, self.signals) for formula in options.seed_terms]
        self.pool.rungs.update(dict.fromkeys(seeds, 0))
        # What was known is never out of reach, whatever rung it came from.
        found = [node for node in self._known_terms() if not self.pool.is_hidden(node)]
        return [list(dict.fromkeys([*terms, *seeds, *found])) for terms in base]

    def _known_terms(self) -> list[int]:
        return [] if self.known is None else [node for found in self.known.sums for node in found.weights]

    def _admit_bounded(self) -> None:
        """A bounded term that no rung has stands on the first one."""
        bounded = dict.fromkeys(node for limits in self.told.bounds.values() for node in limits)
        strangers = [node for node in bounded if node not in self.ladder[-1]]
        self.pool.rungs.update(dict.fromkeys(strangers, 0))
        self.ladder = [[*terms, *strangers] for terms in self.ladder]
