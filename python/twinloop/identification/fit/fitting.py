"""Fitting: constants and lags of a model of given terms are tuned on its predictions; weak terms and outliers go."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.errors import engine_input
from twinloop.identification.inputs.actuation import groups
from twinloop.identification.records import Run
from twinloop.identification.search.structure import Sum, Weights, prices, total
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.bounds import Limits, bounded_model, excludes_zero
from twinloop.identification.terms.pool import Pool
from twinloop.identification.terms.priors import Told
from twinloop.law.actuation import Actuation
from twinloop.limits import Limits as RunLimits
from twinloop.signals import Bounds, Signals
from twinloop.streams import Unit

PRUNINGS = 3
"""How often terms that tuning has shown to be nothing are dropped."""
OUTLIER = 6.0
"""Whitened prediction errors beyond this many standard deviations are no noise."""
FEW = 0.02
"""Share of readings up to which they are outliers; where more are wrong, the model is."""


@dataclass(frozen=True, eq=False)
class Tuned:
    """A model with its sums, its noise, what it leaves, and the covariance of its constants."""

    model: _core.Model
    sums: list[Sum]
    observer: list[Chain]
    left: float
    readings: int
    covariance: Floats


def described(tuned: Tuned) -> float:
    """Description length of a tuned model; infinite where it diverges on its own runs."""
    return total(tuned.sums) if np.isfinite(tuned.left) else float("inf")


class Fitting:
    """Makes models of sums, and tunes them on runs.

    Args:
        runs: recorded; replaced by copies where readings are ignored or states smoothed.
        pool: of all expressions.
        signals: of the system.
        options: of the identification.
        unit: of work; what each call draws is a part of it.
        workers: how the work is carried out.
        told: what is known of the law.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        pool: Pool,
        signals: Signals,
        options: IdentificationOptions,
        unit: Unit,
        workers: _core.Workers,
        told: Told,
    ) -> None:
        self.told = told
        self.runs = list(runs)
        self.pool = pool
        self.signals = signals
        self.form = options.form
        self.options = options
        self.run_limits = RunLimits(signals, options.divergence_factor)
        self.unit = unit
        self.workers = workers

    def tuned(self, sums: Sequence[Sum], given: Sequence[Chain], actuation: Actuation) -> Tuned:
        """The model of the sums with its constants tuned, and without terms that tuning has shown to be nothing."""
        tuned = self._fitted(sums, given, actuation)
        if not np.isfinite(tuned.left) or not self.options.tuning:
            return tuned
        errors = self._predictions(tuned.model, tuned.observer)
        if errors is not None and self._ignore_outliers([e for e, _ in errors]):
            tuned = self._fitted(tuned.sums, given, self.actuation(tuned.model))
        for _ in range(PRUNINGS if self.form != "absolute" else 0):
            kept, saved = self._without_weak(tuned)
            if saved == 0.0:
                break
            other = self._fitted(kept, given, self.actuation(tuned.model))
            if not other.left - tuned.left < saved:
                break
            tuned = other
        return tuned

    def _fitted(self, sums: Sequence[Sum], given: Sequence[Chain], actuation: Actuation) -> Tuned:
        observer = [*(found.chain for found in sums), *given]
        model = self.model(sums, actuation)
        tuned, left, readings, covariance, _ = self.tune(model, sums, observer, self.options.tuning_steps, 0)
        if not np.isfinite(left):
            # Held to its readings at every step it cannot run away; from there it may be let go.
            held = [self._held(chain) for chain in observer]
            tuned, left, readings, covariance, _ = self.tune(model, sums, held, self.options.tuning_steps, 0)
            freed = self.tune(tuned, sums, observer, self.options.tuning_steps, 0)
            if np.isfinite(freed[1]):
                tuned, left, readings, covariance, _ = freed
            else:
                observer = held
                sums = [replace(found, chain=chain) for found, chain in zip(sums, held, strict=False)]
        written = list(sums)
        if np.isfinite(left) and self.form != "absolute":
            values = tuned.constants.tolist()
            for i, places in enumerate(self._layout(sums)[1]):
                weights = (values[place] for place in places)
                written[i] = replace(sums[i], weights=dict(zip(sums[i].weights, weights, strict=True)))
        return Tuned(tuned, written, observer, left, readings, covariance)

    def _held(self, chain: Chain) -> Chain:
        """The chain with so much disturbance that its observer believes every reading."""
        period = self.signals.dt if chain.integrated else 1.0
        white = max(chain.motion[0], float(chain.sensors[0]) / period)
        return chain.with_noise(chain.sensors, (white, chain.motion[1], chain.motion[2]))

    def _layout(self, sums: Sequence[Sum]) -> tuple[list[int], list[range]]:
        """Which of a program's constants may move, and which are the weights of each output.

        Constants inside nodes come first, then, output after output, a 1 for each known node and the weights.
        """
        known = [node for nodes in self.told.fixed.values() for node in nodes]
        used = [term for found in sums for term in found.weights if term != self.pool.one]
        held = self.pool.held([*used, *known])
        kept = {self.pool.one, *self.pool.needed(known)}
        free = [place for place, node in enumerate(held) if node not in kept]
        place, weights = len(held), []
        for output, found in enumerate(sums):
            place += len(self._fixed(found))
            weights.append(range(place, place + len(found.weights)))
            free += weights[-1]
            place += len(found.weights)
            # The state itself, where the output is the next one.
            place += self.form == "absolute" and output not in found.weights
        return free, weights

    def _limits(self, sums: Sequence[Sum]) -> dict[int, Bounds]:
        """Bounds by place among a program's constants."""
        limits: dict[int, Bounds] = {}
        for found, places in zip(sums, self._layout(sums)[1], strict=True):
            bounds = self._bounds(found)
            for place, term in zip(places, found.weights, strict=True):
                if term in bounds:
                    itself = float(self.form == "absolute" and term == found.chain.states[0])
                    low, high = bounds[term]
                    limits[place] = (low + itself, high + itself)
        return limits

    def _fixed(self, found: Sum) -> Sequence[int]:
        """Nodes that are known to drive what a sum drives."""
        return self.told.fixed.get(found.chain.states[0], ())

    def _bounds(self, found: Sum) -> Limits:
        """Bounds of a sum's coefficients, by node."""
        return self.told.bounds.get(found.chain.states[0], {})

    def _without_weak(self, tuned: Tuned) -> tuple[list[Sum], float]:
        """The sums without terms whose uncertain weights do not pay for them, and what those cost."""
        if not tuned.covariance.size:
            # A small change of a constant makes it diverge: nothing is known of weights.
            return list(tuned.sums), 0.0
        free, places = self._layout(tuned.sums)
        variances = dict(zip(free, np.diag(tuned.covariance).tolist(), strict=False))
        saved, kept = 0.0, []
        for found, at in zip(tuned.sums, places, strict=True):
            must = {term for term, bounds in self._bounds(found).items() if excludes_zero(bounds)}
            readings = sum(int(run.weights[:, found.chain.states[0]].sum()) for run in self.runs)
            costs = prices(self.pool, list(found.weights), readings, len(self.runs)).tolist()
            weights: Weights = {}
            for place, cost, (term, weight) in zip(at, costs, found.weights.items(), strict=True):
                # A constant at its bound has no variance, but is no term if that bound is 0.
                pays = weight != 0.0 and weight * weight >= cost * variances[place]
                if pays or term in must or len(found.weights) == 1:
                    weights[term] = weight
                else:
                    saved += cost
            kept.append(replace(found, weights=weights or dict(found.weights)))
        return kept, float(saved)

    def model(self, sums: Sequence[Sum], actuation: Actuation) -> _core.Model:
        """The model whose outputs are sums, behind an actuation; without hidden states that no sum uses."""
        if not any(self.pool.is_hidden(term) for found in sums for term in found.weights):
            actuation = actuation.bare()
        outputs = [dict.fromkeys(self._fixed(found), 1.0) | found.weights for found in sums]
        if self.form == "absolute":
            for i, terms in enumerate(outputs):
                terms[i] = terms.get(i, 0.0) + 1.0
        program = self.pool.program_of_sums(outputs, len(actuation.hidden))
        with engine_input():
            return _core.Model(program, self.form, self.signals.engine, actuation.actuators, actuation.hidden)

    def tune(
        self,
        model: _core.Model,
        sums: Sequence[Sum],
        observer: Sequence[Chain],
        steps: int,
        draws: int,
        number: int = 0,
    ) -> tuple[_core.Model, float, int, Floats, list[_core.Model]]:
        """Constants and lags tuned on predictions; a constant that leaves its bounds is held at the nearer one.

        Args:
            model: to begin with.
            sums: that it is made of.
            observer: all chains, with their noise.
            steps: at most.
            draws: models to be drawn from what the runs leave open.
            number: of the call, which tells its draws from those of others.

        Returns:
            The tuned model, its χ², the readings that counted, the covariance of its constants and lags, the draws.
        """
        free = list(range(len(model.constants))) if self.form == "absolute" else self._layout(sums)[0]
        actuation = self.actuation(model)
        lags = [group for group in groups(self.signals) if actuation.actuators[group[0]].lag > 0.0]
        lags += [[self.signals.n_u + j] for j in range(len(actuation.hidden))]
        limits = self._limits(sums) if self.options.tuning else {}
        # Nothing moves in no steps: what is at its bound stays there, and draws of the rest know it.
        start = model.constants.tolist()
        held = {place for place, bounds in limits.items() if steps == 0 and start[place] in bounds}
        for turn in itertools.count():
            with engine_input():
                tuned, left, readings, covariance, drawn = _core.tune(
                    model,
                    self.run_limits.engine,
                    [chain.engine for chain in observer],
                    [(run.states, run.weights, run.commands) for run in self.runs],
                    free=[place for place in free if place not in held] if self.options.tuning else [],
                    lags=lags if self.options.tuning else [],
                    iterations=steps,
                    draws=draws,
                    unit=self.unit.part(number, turn).named("members") if draws else None,
                    workers=self.workers,
                )
            model, beyond = bounded_model(tuned, limits)
            if not beyond:
                break
            held |= beyond
        if covariance.size:
            for place in (place for place, number in enumerate(free) if number in held):
                covariance = np.insert(np.insert(covariance, place, 0.0, axis=0), place, 0.0, axis=1)
        return tuned, left, readings, covariance, [bounded_model(one, limits)[0] for one in drawn]

    def _predictions(
        self, model: _core.Model, observer: Sequence[Chain]
    ) -> list[tuple[Floats, Floats]] | None:
        with engine_input():
            return _core.predictions(
                model,
                self.run_limits.engine,
                [chain.engine for chain in observer],
                [(run.states, run.weights, run.commands) for run in self.runs],
                workers=self.workers,
            )

    def actuation(self, model: _core.Model) -> Actuation:
        """What stands between commands and a model, an actuator for each command even where all act at once."""
        return Actuation.of(model, self.signals)

    def smooth(self, model: _core.Model, observer: Sequence[Chain]) -> bool:
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
        if share == 0.0 or share > FEW:
            return False
        self.runs = [
            replace(run, weights=np.where(w, 0.0, run.weights))
            for run, w in zip(self.runs, wrong, strict=True)
        ]
        return True
