"""Identification: from recorded runs to a model of readable equations and a committee of plausible ones.

The steps, each of them an option: the noise is estimated; terms are selected up a ladder of libraries, then evolved;
lags and delays of the actuators are searched by description length; constants are tuned on predictions; the whole is
repeated on states that the model has smoothed.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.errors import engine_input
from twinloop.identification.actuation import groups, search_actuators, total
from twinloop.identification.chains import Chain, chains
from twinloop.identification.evolution import evolve
from twinloop.identification.formulas import parsed_term
from twinloop.identification.libraries import rungs
from twinloop.identification.pool import Pool
from twinloop.identification.records import Actuator, Run, direct, stages
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.structure import Problem, Sum, Weights, first_noise, search
from twinloop.models import Noise
from twinloop.signals import Signals

LAGS_AGAIN = 4
"""Runs up to which lags and delays are searched anew; from then on they are only tuned."""
PRUNINGS = 3
"""How often terms that tuning has shown to be nothing are dropped."""
TWINS = 4.0
"""Description length within which two laws are equally good."""
OUTLIER = 6.0
"""Whitened prediction errors beyond this many standard deviations are no noise."""


@dataclass(eq=False)
class Identified:
    """What was learnt from runs.

    Args:
        model: the best one.
        members: of the committee, the best first.
        pool: of all expressions.
        sums: the terms that drive each chain.
        chains: with the noise of sensors and motion.
        actuators: lag, delay and rest of each command.
        left: χ² of the whitened prediction errors of the best model.
        readings: that counted.
        ignored: readings that were taken for outliers.
        energy: description length.
        remarks: what a person should know.
    """

    model: _core.Model
    members: list[_core.Model]
    pool: Pool
    sums: list[Sum]
    chains: list[Chain]
    actuators: list[Actuator]
    left: float
    readings: int
    ignored: int
    energy: float
    remarks: list[str] = field(default_factory=list)

    @property
    def terms(self) -> int:
        """Number of terms of the best model."""
        return sum(len(found.weights) for found in self.sums)

    @property
    def misfit(self) -> float:
        """χ² for each reading; 1 where only noise is left."""
        return self.left / max(1, self.readings)

    def noise(self, signals: Signals) -> Noise:
        """Of the sensors, and of what moves the states from one period to the next."""
        moves = np.zeros(signals.n_x)
        for chain in self.chains:
            period = signals.dt if chain.integrated else 1.0
            moves[chain.states[0]] = np.sqrt(chain.motion[0] * period)
        gusts = [
            (chain.states, chain.integrated, float(np.sqrt(chain.motion[1])), chain.motion[2])
            for chain in self.chains
            if chain.motion[1] > 0.0
        ]
        return Noise(self.sensors(signals.n_x), moves, tuple(gusts), signals.dt)

    def sensors(self, n_x: int) -> Floats:
        """Standard deviation of each state's sensor (n_x,)."""
        sds = np.zeros(n_x)
        for chain in self.chains:
            sds[list(chain.states)] = np.sqrt(chain.sensors)
        return sds


def guessed_noise(runs: Sequence[Run], scales: Floats) -> Floats:
    """Variance of each sensor as if all that changes faster than a parabola were noise; a first guess from above.

    Args:
        runs: recorded.
        scales: of the states (n_x,).

    Returns:
        Variances (n_x,), never below what rounding leaves.
    """
    thirds = [np.diff(run.states, n=3, axis=0) for run in runs if len(run.states) > 3]
    low = (1e-7 * scales) ** 2
    if not thirds:
        return low
    squares = np.sort(np.concatenate(thirds) ** 2, axis=0)
    # The median of a squared normal number is 0.4549; a third difference has 20 times the variance.
    guess: Floats = np.maximum(squares[len(squares) // 2] / (0.4549 * 20.0), low)
    return guess


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


@dataclass(frozen=True, eq=False)
class _Tuned:
    """A model with its sums, its noise, what it leaves, and the covariance of its constants."""

    model: _core.Model
    sums: list[Sum]
    observer: list[Chain]
    left: float
    readings: int
    covariance: Floats


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
        self.runs = list(runs)
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
        self.stream = 0

    def learn(self) -> Identified:
        options = self.options
        ladder = rungs(self.pool, self.signals, options.libraries, options.most_terms)
        base = ladder or [[self.pool.one, *range(self.pool.inputs)]]
        seeds = [parsed_term(formula, self.pool, self.signals) for formula in options.seed_terms]
        self.pool.rungs.update(dict.fromkeys(seeds, 0))
        base = [list(dict.fromkeys([*terms, *seeds])) for terms in base]
        guess = guessed_noise(self.runs, self.scales)
        all_chains = chains(self.signals, self.form, guess)
        driven = [chain for chain in all_chains if chain.output is not None]
        given = [self._given_noise(chain) for chain in all_chains if chain.output is None]
        self.watch("noise")
        actuators = direct(self.signals)
        if self.known is not None:
            actuators = self.known.actuators
        problem = self._problem(actuators)
        start = base[0]
        driven = [
            first_noise(problem, chain, problem.usable(start), self.scales, self.options.gusts)
            for chain in driven
        ]
        known: list[Sum | None] = [None] * len(driven)
        if self.known is not None:
            known = [replace(s, others=[]) for s in self.known.sums]
        if options.lags and (self.known is None or len(self.runs) <= LAGS_AGAIN):
            self.watch("actuators")
            actuators, known = self._actuators(start, driven)
            problem = self._problem(actuators)
        self.watch("terms")
        sums = self._climb(problem, driven, known, base)
        tuned = self._tuned(sums, given, actuators)
        for _ in range(options.passes - 1):
            if not self._smoothed(tuned.model, tuned.observer):
                break
            self.watch("smoothed")
            lags = self._lags_of(tuned.model)
            problem = self._problem(lags)
            known = list(tuned.sums)
            again = self._climb(problem, [s.chain for s in tuned.sums], known, base, brief=True)
            other = self._tuned(again, given, lags)
            if not np.isfinite(other.left) and np.isfinite(tuned.left):
                break
            tuned = other
        model, sums, left, readings = tuned.model, tuned.sums, tuned.left, tuned.readings
        observer = self._rescaled(tuned.observer, left, readings)
        self.watch("committee")
        members = self._committee(problem, sums, observer, given, model)
        ignored = int(sum((run.weights == 0.0).sum() for run in self.runs))
        return Identified(
            model, members, self.pool, sums, observer, self._lags_of(model), left, readings, ignored,
            total(sums), self._remarks(left, readings, sums, ignored),
        )  # fmt: skip

    # Steps

    def _problem(self, actuators: Sequence[Actuator]) -> Problem:
        inputs = stages(self.runs, self.signals, actuators)
        return Problem(self.pool, self.runs, inputs, self.signals.dt, self.workers)

    def _given_noise(self, chain: Chain) -> Chain:
        """An angle that body rates turn: what it does between readings is known but for the rates' own noise."""
        return chain.with_noise(chain.sensors, (1e-4 * float(chain.sensors[0]) / self.signals.dt, 0.0, 1.0))

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
    ) -> list[Sum]:
        return search(
            problem, driven, terms, known, self.scales,
            moves=moves, starts=starts, largest=self.options.largest, seed=self.seed, iteration=self._next(),
            fixed_noise=fixed_noise,
        )  # fmt: skip

    def _climb(
        self,
        problem: Problem,
        driven: Sequence[Chain],
        known: Sequence[Sum | None],
        ladder: Sequence[Sequence[int]],
        brief: bool = False,
    ) -> list[Sum]:
        options = self.options
        best: list[Sum | None] = list(known)
        current = list(driven)
        if options.libraries:
            for number, terms in enumerate(ladder[:1] if brief else ladder):
                starts = options.starts if number == 0 and not brief else max(1, options.starts // 2)
                sums = self._search(problem, current, terms, best, options.moves, starts, number > 0)
                best, current = list(sums), [found.chain for found in sums]
        if options.generations and not (brief and options.libraries):
            self.watch("evolution")
            seeds = list(ladder[0]) if not options.libraries else [self.pool.one, *range(self.pool.inputs)]
            seeds += [node for found in best if found for node in found.weights]
            for restart in range(options.restarts):
                grown = evolve(
                    problem, current, best, seeds, self.scales,
                    operators=options.operators, generations=options.generations,
                    population=options.population, longest=options.longest, moves=options.moves // 4,
                    largest=options.largest, seed=self.seed, iteration=self._next() + 100_000 * restart,
                )  # fmt: skip
                best, current = list(grown), [found.chain for found in grown]
        return [found for found in best if found is not None]

    def _actuators(
        self, terms: Sequence[int], driven: Sequence[Chain]
    ) -> tuple[list[Actuator], list[Sum | None]]:
        def judge(actuators: list[Actuator]) -> list[Sum]:
            problem = self._problem(actuators)
            return self._search(problem, driven, terms, [None] * len(driven), self.options.moves // 3, 2)

        actuators, sums = search_actuators(
            self.signals, [None, *self.rests], judge, self.options.longest_delay
        )
        return actuators, list(sums)

    def _tuned(self, sums: Sequence[Sum], given: Sequence[Chain], actuators: Sequence[Actuator]) -> _Tuned:
        """The model of the sums with its constants tuned, and without terms that tuning has shown to be nothing."""
        tuned = self._fitted(sums, given, actuators)
        if not np.isfinite(tuned.left) or not self.options.tuning:
            return tuned
        errors = self._predictions(tuned.model, tuned.observer)
        if errors is not None and self._ignore_outliers([e for e, _ in errors]):
            tuned = self._fitted(tuned.sums, given, self._lags_of(tuned.model))
        for _ in range(PRUNINGS if self.form != "absolute" else 0):
            kept, saved = self._without_weak(tuned)
            if saved == 0.0:
                break
            other = self._fitted(kept, given, self._lags_of(tuned.model))
            if not other.left - tuned.left < saved:
                break
            tuned = other
        return tuned

    def _fitted(self, sums: Sequence[Sum], given: Sequence[Chain], actuators: Sequence[Actuator]) -> _Tuned:
        observer = [*(found.chain for found in sums), *given]
        model = self._model(sums, actuators)
        tuned, left, readings, covariance, _ = self._tune(model, observer, self.options.tuning_steps, 0)
        constants = tuned.constants
        written = list(sums)
        if np.isfinite(left) and self.form != "absolute":
            place = self._first_weight(sums)
            for i, found in enumerate(sums):
                values = constants[place : place + len(found.weights)].tolist()
                written[i] = replace(found, weights=dict(zip(found.weights, values, strict=True)))
                place += len(found.weights)
        return _Tuned(tuned, written, observer, left, readings, covariance)

    def _first_weight(self, sums: Sequence[Sum]) -> int:
        """Where the weights begin among a program's constants: those inside nodes come before them."""
        nodes = self.pool.needed(term for found in sums for term in found.weights if term != self.pool.one)
        inner = [node for node in map(self.pool.node, nodes) if node is not None]
        return sum(isinstance(node[2], float) for node in inner)

    def _without_weak(self, tuned: _Tuned) -> tuple[list[Sum], float]:
        """The sums without terms whose uncertain weights do not pay for them, and what those cost."""
        place, saved = self._first_weight(tuned.sums), 0.0
        variances = np.diag(tuned.covariance)
        kept = []
        for found in tuned.sums:
            price = np.log(max(2, sum(int(run.weights[:, found.chain.states[0]].sum()) for run in self.runs)))
            weights: Weights = {}
            for term, weight in found.weights.items():
                cost = price + 2.0 * self.pool.length(term)
                if weight * weight >= cost * variances[place] or len(found.weights) == 1:
                    weights[term] = weight
                else:
                    saved += cost
                place += 1
            kept.append(replace(found, weights=weights or dict(found.weights)))
        return kept, float(saved)

    def _model(self, sums: Sequence[Sum], actuators: Sequence[Actuator]) -> _core.Model:
        outputs = [dict(found.weights) for found in sums]
        if self.form == "absolute":
            for i, terms in enumerate(outputs):
                terms[i] = terms.get(i, 0.0) + 1.0
        program = self.pool.program(outputs)
        with engine_input():
            return _core.Model(program, self.form, self.signals.engine, list(actuators))

    def _tune(
        self,
        model: _core.Model,
        observer: Sequence[Chain],
        steps: int,
        draws: int,
        spread: float = 1.0,
        unit: int = 0,
    ) -> tuple[_core.Model, float, int, Floats, list[_core.Model]]:
        lags = [g for g in groups(self.signals) if self._lags_of(model)[g[0]][0] > 0.0]
        with engine_input():
            return _core.tune(
                model,
                [chain.engine for chain in observer],
                [(run.states, run.weights, run.commands) for run in self.runs],
                free=list(range(len(model.constants))) if self.options.tuning else [],
                lags=lags if self.options.tuning else [],
                iterations=steps,
                draws=draws,
                spread=spread,
                seed=self.seed,
                iteration=self.iteration,
                unit=unit,
                divergence_factor=self.options.divergence_factor,
                workers=self.workers,
            )

    def _predictions(
        self, model: _core.Model, observer: Sequence[Chain]
    ) -> list[tuple[Floats, Floats]] | None:
        with engine_input():
            return _core.predictions(
                model,
                [chain.engine for chain in observer],
                [(run.states, run.weights, run.commands) for run in self.runs],
                divergence_factor=self.options.divergence_factor,
                workers=self.workers,
            )

    def _lags_of(self, model: _core.Model) -> list[Actuator]:
        return list(model.actuators) or direct(self.signals)

    def _smoothed(self, model: _core.Model, observer: Sequence[Chain]) -> bool:
        """Takes the states that the model's observer believes for those that the features are made of."""
        errors = self._predictions(model, observer)
        if errors is None:
            return False
        self.runs = [
            replace(run, smooth=np.where(np.isfinite(states), states, run.states))
            for run, (_, states) in zip(self.runs, errors, strict=True)
        ]
        return True

    def _ignore_outliers(self, errors: Sequence[Floats]) -> bool:
        """Single readings that no noise explains count no more; a model that is wrong everywhere explains none."""
        wrong = [np.abs(e) > OUTLIER for e in errors]
        share = float(np.mean(np.concatenate([w.any(axis=1) for w in wrong])))
        if share == 0.0 or share > 0.02:
            return False
        self.runs = [
            replace(run, weights=np.where(w, 0.0, run.weights))
            for run, w in zip(self.runs, wrong, strict=True)
        ]
        return True

    def _rescaled(self, observer: Sequence[Chain], left: float, readings: int) -> list[Chain]:
        """Noise that explains what is left on average, so that members are as uncertain as the runs say."""
        factor = left / max(1, readings) if np.isfinite(left) else 1.0
        factor = max(1.0, factor)
        return [
            c.with_noise(c.sensors * factor, (c.motion[0] * factor, c.motion[1] * factor, c.motion[2]))
            for c in observer
        ]

    def _committee(
        self,
        problem: Problem,
        sums: Sequence[Sum],
        observer: Sequence[Chain],
        given: Sequence[Chain],
        best: _core.Model,
    ) -> list[_core.Model]:
        """The best model, draws from what the runs leave open of it, and other structures that are nearly as good."""
        size = self.options.committee_size
        stream = np.random.Generator(
            np.random.Philox(np.random.SeedSequence([self.seed, 78, self.iteration]))
        )
        members = [best]
        _, base, readings, _, draws = self._tune(best, observer, 0, size)
        plausible = 1.5 * max(base, readings)
        grams = {}
        for attempt in range(3 * size):
            if len(members) >= size:
                break
            structures = [self._other(found, stream) for found in sums]
            if all(s is None for s in structures):
                if draws:
                    members.append(draws.pop())
                continue
            varied = []
            for i, (found, subset) in enumerate(zip(sums, structures, strict=True)):
                if subset is None:
                    varied.append(found)
                    continue
                terms = problem.usable(subset)
                if (i, subset) not in grams:
                    regression = problem.regression(found.chain, terms)
                    grams[i, subset] = regression.gram(found.chain.sensors, found.chain.motion, self.workers)
                solved = grams[i, subset].solve(list(range(len(terms))))
                if solved is None:
                    varied.append(found)
                else:
                    weights = dict(zip(terms, solved[0].tolist(), strict=True))
                    varied.append(replace(found, weights=weights))
            model = self._model(varied, self._lags_of(best))
            _, left, _, _, drawn = self._tune(model, observer, 4, 1, unit=attempt + 1)
            if np.isfinite(left) and left <= plausible and drawn:
                members.append(drawn[0])
        while len(members) < size and draws:
            members.append(draws.pop())
        return members

    def _other(self, found: Sum, stream: np.random.Generator) -> tuple[int, ...] | None:
        """A subset drawn by how likely it is; None for the best one."""
        chances = np.exp(-0.5 * np.array([0.0, *(above for _, above in found.others)]))
        pick = int(np.searchsorted(np.cumsum(chances) / chances.sum(), stream.random()))
        return None if pick == 0 else found.others[min(pick, len(found.others)) - 1][0]

    def _identities(self, found: Sum) -> list[str]:
        """The nearest other law that the runs cannot tell from this one: an identity that held on them."""
        symbols = [*self.signals.state_names, *self.signals.command_names]
        driven = self.signals.state_names[found.chain.states[0]]
        ours = set(found.weights)
        for subset, above in found.others:
            out, into = ours - set(subset), set(subset) - ours
            if above < TWINS and out and into and len(out) + len(into) <= 6:
                gone, come = (
                    ", ".join(sorted(self.pool.text(node, symbols) for node in terms))
                    for terms in (out, into)
                )
                return [f"On these runs {driven} is described as well with {come} in place of {gone}."]
        return []

    def _remarks(self, left: float, readings: int, sums: Sequence[Sum], ignored: int) -> list[str]:
        remarks = []
        if not np.isfinite(left):
            remarks.append(
                "The model diverges on the runs that it was learnt from; fly another test before you trust it."
            )
        elif left > 2.0 * readings:
            remarks.append(
                f"What is left is {left / readings:.3g} times the noise: something acts that no term describes."
            )
        still = [
            self.signals.state_names[i]
            for i in range(self.signals.n_x)
            if max(float(np.ptp(run.states[:, i])) for run in self.runs) <= 1e-9 * self.scales[i]
        ]
        if still:
            remarks.append(f"{', '.join(still)} never moved: nothing could be learnt of what drives it.")
        remarks += [remark for found in sums for remark in self._identities(found)]
        if ignored:
            remarks.append(f"{ignored} reading{'s' if ignored > 1 else ''} taken for outliers and ignored.")
        return remarks
