"""Identification: from recorded runs to a model of readable equations and a committee of plausible ones.

The steps, each of them an option: the noise is estimated; terms are selected up a ladder of libraries, then evolved;
offsets of sensors, lags and delays of the actuators are searched by description length; constants are tuned on
predictions; the whole is repeated on states that the model has smoothed.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.identification.actuation import Actuation
from twinloop.identification.chains import Chain, chains
from twinloop.identification.committee import committee
from twinloop.identification.evolution import evolve
from twinloop.identification.fitting import Fitting, Tuned, described
from twinloop.identification.formulas import parsed_term
from twinloop.identification.hidden import PRICE, enter_directions, filled, search_hidden
from twinloop.identification.identified import Identified
from twinloop.identification.lags import search_actuators
from twinloop.identification.libraries import rungs
from twinloop.identification.noise import BEST_SENSOR, first_noise, unexplained
from twinloop.identification.offsets import moved, search_offsets
from twinloop.identification.pool import Pool
from twinloop.identification.problem import Problem
from twinloop.identification.records import Run, guessed_noise, stages
from twinloop.identification.remarks import held_at_bounds, late_sensors, other_noise, remarks
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.structure import Sum, search, total
from twinloop.identification.told import told
from twinloop.signals import Signals

LAGS_AGAIN = 4
"""Runs up to which lags, delays and offsets are searched anew; from then on lags are only tuned and the others kept."""
HIDDEN = 900
"""Number of the stream of random numbers in which hidden states are searched."""


def identify_runs(
    runs: Sequence[Run],
    signals: Signals,
    options: IdentificationOptions,
    *,
    rests: Sequence[Floats] = (),
    seed: int = 0,
    iteration: int = 0,
    known: Identified | None = None,
    workers: _core.Workers,
    watch: Callable[[str], None] = lambda step: None,
) -> Identified:
    """Learns a model and a committee.

    Args:
        runs: at least one.
        signals: of the system.
        options: of the identification.
        rests: commands whose effect may be there at the start of a run (n_u,).
        seed: of the campaign.
        iteration: which streams of random numbers.
        known: what was learnt from fewer runs; its terms are candidates again.
        workers: how the work is carried out.
        watch: called with the name of each step.

    Returns:
        What was learnt.
    """
    learner = _Learner(runs, signals, options, rests, seed, iteration, known, workers, watch)
    return learner.learn()


class _Learner:
    """One identification; its steps share the runs, the pool and the noise."""

    def __init__(
        self,
        runs: Sequence[Run],
        signals: Signals,
        options: IdentificationOptions,
        rests: Sequence[Floats],
        seed: int,
        iteration: int,
        known: Identified | None,
        workers: _core.Workers,
        watch: Callable[[str], None],
    ) -> None:
        self.signals = signals
        self.options = options
        self.form = options.form_for(signals)
        self.rests = list(rests)
        self.seed = seed
        self.iteration = iteration
        self.workers = workers
        self.watch = watch
        self.scales = np.array([state.scale for state in signals.states])
        self.known: Identified | None
        if known is not None and known.model.form == self.form:
            # A copy: what an interrupted attempt has entered must not change the next one.
            self.pool, self.known = copy.deepcopy(known.pool), known
        else:
            self.pool, self.known = Pool(signals.n_x + signals.n_u, len(options.operators)), None
        every = chains(signals, self.form, guessed_noise(runs, self.scales))
        self.driven = [self._declared_noise(chain) for chain in every if chain.output is not None]
        self.given = [self._given_noise(chain) for chain in every if chain.output is None]
        self.ladder = self._ladder()
        self.told = told(options, self.pool, signals)
        self._admit_bounded()
        self.fitting = Fitting(
            runs, self.pool, signals, self.form, options, seed, iteration, workers, self.told
        )
        self.stream = 0

    def learn(self) -> Identified:
        self.watch("noise")
        offsets = self._offsets()
        tuned = self._best(moved(self.fitting.runs, self.signals, offsets))
        problem = self._problem(self.fitting.actuation(tuned.model))
        model, sums, left, readings = tuned.model, tuned.sums, tuned.left, tuned.readings
        observer = self._rescaled(tuned.observer, left, readings)
        self.watch("committee")
        members = committee(problem, self.fitting, sums, observer, model)
        runs = self.fitting.runs
        return Identified(
            model=model,
            members=members,
            pool=self.pool,
            sums=sums,
            chains=observer,
            actuation=self.fitting.actuation(model),
            offsets=offsets,
            left=left,
            readings=readings,
            ignored=int(sum((run.weights == 0.0).sum() for run in runs)),
            energy=total(sums),
            remarks=[
                *remarks(runs, self.pool, self.signals, sums, left, readings),
                *late_sensors(offsets, [chain.states[0] for chain in self.driven], self.signals),
                *other_noise(tuned.observer, self.signals),
                *held_at_bounds(sums, self.told.bounds, self.pool, self.signals, self.form),
            ],
        )

    # Steps

    def _best(self, runs: Sequence[Run]) -> Tuned:
        """The shorter description of runs: found anew, or from what was known of fewer of them."""
        ways = [self._anew]
        if self.known is not None and self.known.actuation.hidden:
            # What is hidden shows when terms are nearly right, and these when it shows.
            ways.append(self._renewed)
        plain, found = self.ladder, []
        for way in ways:
            self.fitting.runs, self.ladder = list(runs), plain
            tuned = self._smoothed(way())
            found.append((described(tuned), tuned, self.fitting.runs, self.ladder))
        _, tuned, self.fitting.runs, self.ladder = min(found, key=lambda answer: answer[0])
        return tuned

    def _anew(self) -> Tuned:
        """Lags, hidden states, noise and terms are searched."""
        start = self.ladder[0]
        nothing: list[Sum | None] = [None] * len(self.driven)
        actuation, known = Actuation.direct(self.signals), nothing
        again = self.known is None or len(self.fitting.runs) <= LAGS_AGAIN
        if self.known is not None:
            actuation = self.known.actuation.bare()
            known = [self._without_hidden(found) for found in self.known.sums]
        shortest, above = self._from_both_sides(self._problem(actuation), start, known)
        if self.options.lags and again:
            self.watch("actuators")
            before = actuation
            actuation, shortest = self._actuators(start, [found.chain for found in shortest])
            if actuation != before:
                # The noise was that of other actuators, and a disturbance may still stand in for terms.
                shortest, above = self._from_both_sides(self._problem(actuation), start, shortest)
        if self._may_hide():
            self.watch("hidden")
            found, sums = self._hidden(actuation, shortest, shortest)
            if found.hidden:
                actuation = found
                shortest, above = self._from_both_sides(self._problem(actuation), self.ladder[0], sums)
        return self._lasting(actuation, shortest, above)

    def _renewed(self) -> Tuned:
        """What was known, tuned on all runs."""
        assert self.known is not None
        self._admit_hidden()
        sums = [replace(found, others=[]) for found in self.known.sums]
        return self.fitting.tuned(sums, self.given, self.known.actuation)

    def _lasting(self, actuation: Actuation, shortest: list[Sum], above: list[Sum]) -> Tuned:
        """A tuned model of all rungs that lasts on its own runs, if there is one."""
        self.watch("terms")
        problem = self._problem(actuation)
        tuned = self.fitting.tuned(self._climb(problem, shortest), self.given, actuation)
        if not np.isfinite(tuned.left):
            # A short description that runs away is none: the one from above is more modest.
            other = self.fitting.tuned(self._climb(problem, above), self.given, actuation)
            tuned = other if np.isfinite(other.left) else tuned
        return tuned

    def _smoothed(self, tuned: Tuned) -> Tuned:
        """Terms are selected again on states that the model has smoothed, as long as they are described the shorter."""
        best, runs = tuned, self.fitting.runs
        for number in itertools.count(1):
            hidden = self.fitting.actuation(tuned.model).hidden
            if number >= self.options.passes * (2 if hidden else 1):
                break
            if not self.fitting.smooth(tuned.model, tuned.observer):
                break
            self.watch("smoothed")
            actuation = self.fitting.actuation(tuned.model)
            again = self._climb(self._problem(actuation), tuned.sums, brief=True)
            if number == 1 and self._may_hide():
                actuation, again = self._hidden(actuation, tuned.sums, again)
            tuned = self.fitting.tuned(again, self.given, actuation)
            # Descriptions of raw states and of smoothed ones do not compare.
            if (number == 1 and np.isfinite(tuned.left)) or described(tuned) < described(best):
                best, runs = tuned, self.fitting.runs
            if not np.isfinite(tuned.left):
                break
        self.fitting.runs = runs
        return best

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

    def _admit_hidden(self) -> None:
        """Terms of a hidden state stand on the first rung, and so do those that were known of it."""
        terms = [*filled(self.pool), *(node for node in self._known_terms() if self.pool.is_hidden(node))]
        for term in terms:
            self.pool.rungs.setdefault(term, 0)
        self.ladder = [list(dict.fromkeys([*rung, *terms])) for rung in self.ladder]

    def _without_hidden(self, found: Sum) -> Sum | None:
        weights = {node: w for node, w in found.weights.items() if not self.pool.is_hidden(node)}
        return None if found.weights and not weights else replace(found, weights=weights, others=[])

    def _problem(self, actuation: Actuation) -> Problem:
        inputs = stages(self.fitting.runs, self.signals, actuation)
        runs, dt = self.fitting.runs, self.signals.dt
        return Problem(self.pool, runs, inputs, dt, self.workers, self.told)

    def _offsets(self) -> Floats:
        """By how much later than those of the driven states each state's readings were taken from it (n_x,), s."""
        if not self.options.offsets:
            return np.zeros(self.signals.n_x)
        if self.known is not None and len(self.fitting.runs) > LAGS_AGAIN:
            return self.known.offsets
        every = [*self.driven, *self.given]
        return search_offsets(self.fitting.runs, self.signals, every, self.scales, self.workers)

    def _given_noise(self, chain: Chain) -> Chain:
        """An angle that body rates turn: what it does between readings is known but for the rates' own noise."""
        return chain.with_noise(chain.sensors, (1e-4 * float(chain.sensors[0]) / self.signals.dt, 0.0, 1.0))

    def _declared_noise(self, chain: Chain) -> Chain:
        """The chain with sensors as they are declared, as far as readings allow; the estimate begins there."""
        sensors = chain.sensors.copy()
        for i, state in enumerate(chain.states):
            noise = self.signals.states[state].noise
            if noise is not None:
                sensors[i] = np.clip(noise * noise, BEST_SENSOR**2 * chain.rough[i], chain.rough[i])
        return chain.with_noise(sensors, chain.motion)

    def _from_both_sides(
        self, problem: Problem, terms: Sequence[int], known: Sequence[Sum | None]
    ) -> tuple[list[Sum], list[Sum]]:
        """The shorter description of each chain with the noise estimated from below or from above, and that from above.

        From below, little noise makes many terms of few runs and stays little; from above, the strongest terms come
        first and the noise falls as far as they explain it.
        """
        options = self.options
        usable = problem.usable(terms)
        below = [first_noise(problem, chain, usable, self.scales, options.gusts) for chain in self.driven]
        low = self._search(problem, below, terms, known, options.moves, 2)
        if not options.noise_from_above:
            return low, low
        above = [unexplained(problem, chain, self.scales, options.gusts) for chain in self.driven]
        none: list[Sum | None] = [None] * len(self.driven)
        high = self._search(problem, above, terms, none, options.moves, 2)
        return [a if a.energy <= b.energy else b for a, b in zip(low, high, strict=True)], high

    def _next(self) -> int:
        self.stream += 1
        return self.iteration * 1000 + self.stream

    def _search(
        self,
        problem: Problem,
        driven: Sequence[Chain],
        terms: Sequence[int],
        known: Sequence[Sum | None],
        moves: int,
        starts: int,
        fixed_noise: bool = False,
        iteration: int | None = None,
    ) -> list[Sum]:
        return search(
            problem, driven, terms, known, self.scales,
            moves=moves, starts=starts, largest=self.options.largest, seed=self.seed,
            iteration=self._next() if iteration is None else iteration, fixed_noise=fixed_noise,
        )  # fmt: skip

    def _climb(self, problem: Problem, known: Sequence[Sum], brief: bool = False) -> list[Sum]:
        """The best sums of all rungs and of evolved terms, where some are known; `brief`: of the first rung only."""
        options, ladder = self.options, self.ladder
        best = list(known)
        if options.libraries:
            for number, terms in enumerate(ladder[:1] if brief else ladder):
                starts = options.starts if number == 0 and not brief else max(1, options.starts // 2)
                driven = [found.chain for found in best]
                best = self._search(problem, driven, terms, best, options.moves, starts, number > 0)
        if options.generations and not (brief and options.libraries):
            self.watch("evolution")
            seeds = list(ladder[0]) if not options.libraries else [self.pool.one, *range(self.pool.inputs)]
            seeds += [node for found in best for node in found.weights]
            for restart in range(options.restarts):
                best = evolve(
                    problem, best, seeds, self.scales,
                    operators=options.operators, generations=options.generations,
                    population=options.population, longest=options.longest, moves=options.moves // 4,
                    largest=options.largest, seed=self.seed, iteration=self._next() + 100_000 * restart,
                )  # fmt: skip
        return best

    def _may_hide(self) -> bool:
        """Whether a hidden state is looked for: in one run it is a function of time, and that may be anything."""
        return self.options.hidden and len(self.fitting.runs) > 1

    def _hidden(
        self, actuation: Actuation, start: Sequence[Sum], plain: Sequence[Sum]
    ) -> tuple[Actuation, list[Sum]]:
        """With the best hidden state where that makes the description shorter, else as it was.

        Args:
            actuation: so far.
            start: sums to begin with. Those that were found without the state stand in for it already.
            plain: the best sums behind the actuation as it is.

        Returns:
            The actuation, and the sums behind it.
        """
        enter_directions(self._problem(actuation), start, self.signals)
        driven = [found.chain for found in start]
        own = [term for found in start for term in found.weights]
        few, many = ([*filled(self.pool), *terms] for terms in (own, self.ladder[0]))
        # Streams of their own: where nothing is hidden, what follows draws as if nobody had looked.
        stream = self.iteration * 1000 + HIDDEN
        moves, starts = self.options.moves, max(1, self.options.starts // 2)

        def judge(tried: Actuation) -> list[Sum]:
            return self._search(self._problem(tried), driven, few, start, moves // 10, 1, iteration=stream)

        before = actuation.hidden or (() if self.known is None else self.known.actuation.hidden)
        longest = self.signals.dt * max(len(run.commands) for run in self.fitting.runs)
        rests: Sequence[Floats | None] = self.rests or [None]
        found, sums = search_hidden(self.signals, actuation, before, rests, longest, judge)
        # Which one shows on the terms that there are; whether there is one, when all may change.
        best = self._search(self._problem(found), driven, many, sums, moves, starts, iteration=stream + 1)
        price = 0.0 if actuation.hidden else PRICE
        if total(best) + price >= total(plain):
            return actuation, list(plain)
        self._admit_hidden()
        return found, best

    def _actuators(self, terms: Sequence[int], driven: Sequence[Chain]) -> tuple[Actuation, list[Sum]]:
        def judge(actuation: Actuation) -> list[Sum]:
            problem = self._problem(actuation)
            return self._search(problem, driven, terms, [None] * len(driven), self.options.moves // 4, 1)

        return search_actuators(self.signals, [None, *self.rests], judge, self.options.longest_delay)

    def _rescaled(self, observer: Sequence[Chain], left: float, readings: int) -> list[Chain]:
        """Noise that explains what is left on average, so that members are as uncertain as the runs say."""
        factor = left / max(1, readings) if np.isfinite(left) else 1.0
        factor = max(1.0, factor)
        return [
            c.with_noise(c.sensors * factor, (c.motion[0] * factor, c.motion[1] * factor, c.motion[2]))
            for c in observer
        ]
