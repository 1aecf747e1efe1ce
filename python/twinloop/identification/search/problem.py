"""The problem of one identification: readings of all runs, and what terms make of the inputs within each period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.records import Stages, stages
from twinloop.identification.search.poles import room
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.attitude import along_the_body, turned
from twinloop.signals import Bounds

if TYPE_CHECKING:
    from twinloop.identification.context import Context
    from twinloop.identification.hypothesis import Hypothesis

Columns = Floats
"""Values at the start, the middle and the end of each period (3, rows, p)."""


class Problem:
    """The regressions that a hypothesis poses: readings of its runs, and what its law sees within each period.

    Args:
        context: of the identification.
        hypothesis: whose pool the terms are of.
        inputs: the same for another hypothesis of the same runs and actuation, if they are there already.
        bare: the problem of the same hypothesis without hidden states, whose terms have the same values here.
    """

    def __init__(
        self,
        context: Context,
        hypothesis: Hypothesis,
        inputs: Stages | None = None,
        bare: Problem | None = None,
    ) -> None:
        signals = context.signals
        self.pool, self.runs = hypothesis.pool, hypothesis.runs
        self.stages = stages(self.runs, signals, hypothesis.actuation) if inputs is None else inputs
        self.dt, self.workers = signals.dt, context.workers
        self.priors = hypothesis.candidates.priors
        self.as_integrated = context.as_integrated
        self.room = room(signals, self.stages.start[:, : signals.n_x])
        """Bounds of each input within which a denominator must not vanish."""
        self._values: dict[int, Floats] = dict(bare._values) if bare else {}
        self._varied: dict[int, float] = dict(bare._varied) if bare else {}
        self._feedthrough: dict[tuple[int, int], Floats] = dict(bare._feedthrough) if bare else {}
        self._usable: set[int] = set(bare._usable) if bare else set()
        self._signals = signals
        self._along_the_body = along_the_body(signals)
        self._turned: dict[int, bool] = dict(bare._turned) if bare else {}

    def usable(self, terms: Sequence[int]) -> list[int]:
        """Terms whose values are finite on all rows, with the values; those of a hidden state only where one is."""
        new = [term for term in terms if term not in self._values]
        inputs = self.stages.start.shape[1]
        new = [term for term in new if self.pool.reach(term) <= inputs]
        if new:
            stages = [
                self.pool.values(new, s) for s in (self.stages.start, self.stages.middle, self.stages.end)
            ]
            for i, term in enumerate(new):
                self._values[term] = np.array([stage[:, i] for stage in stages])
                if np.abs(self._values[term]).max() < 1e100:
                    self._usable.add(term)
        return [term for term in terms if term in self._usable]

    def as_written(self, chain: Chain, terms: Sequence[int]) -> dict[int, float]:
        """Lengths in nats of terms that are short for other chains, and for this one as long as they are written.

        Along the axes of a rigid body these are thrusts and velocities that its pose turns.
        """
        if self._along_the_body.isdisjoint(chain.states):
            return {}
        if new := [term for term in terms if term not in self._turned]:
            among = turned(self.pool, self._signals, new)
            self._turned.update((term, term in among) for term in new)
        return {term: self.pool.written(term) for term in terms if self._turned[term]}

    def values(self, terms: Sequence[int]) -> Columns:
        """Of terms that were found usable, at the start, the middle and the end of each period (3, rows, terms)."""
        return (
            np.stack([self._values[term] for term in terms], axis=-1)
            if terms
            else np.empty((3, len(self.stages.start), 0))
        )

    def varied(self, terms: Sequence[int]) -> Floats:
        """Variance of terms that were found usable, in the middle of periods (terms,)."""
        for term in terms:
            if term not in self._varied:
                self._varied[term] = float(self._values[term][1].var())
        return np.array([self._varied[term] for term in terms])

    def regression(self, chain: Chain, columns: Columns, taken: Columns | None = None) -> _core.Regression:
        """Of one chain on features, once what is known is taken out of its readings.

        Args:
            chain: of states.
            columns: the features, such as `values` of terms (3, rows, p).
            taken: features that are taken to be in the law as they are (3, rows, q); None: the priors alone.
        """
        states = list(chain.states)

        def on(columns: Columns, readings: Sequence[Floats]) -> _core.Regression:
            start, middle, end = np.ascontiguousarray(columns)
            records = [
                (measured, run.weights[:, states], start[rows], middle[rows], end[rows])
                for measured, run, rows in zip(readings, self.runs, self.stages.runs, strict=True)
            ]
            return _core.Regression(len(states), self.dt, chain.form, records)

        readings = [run.states[:, states] for run in self.runs]
        if known := self.usable(self.priors.fixed.get(states[0], ())):
            readings = on(self.values(known), readings).residuals(np.ones(len(known)))
        if taken is not None:
            readings = on(taken, readings).residuals(np.ones(taken.shape[2]))
        return on(columns, readings)

    def gram(self, chain: Chain, columns: Columns, taken: Columns | None = None) -> _core.Gram:
        """Inner products of features and what they are to explain, whitened by a chain's noise.

        Args as those of `regression`.
        """
        return self.regression(chain, columns, taken).gram(chain.sensors, chain.motion, self.workers)

    def feedthrough(self, chain: Chain, terms: Sequence[int]) -> Floats:
        """Share of a reading's noise that each term has in the prediction of the same reading.

        Args:
            chain: whose first state is read; it is the integral of the terms.
            terms: that were found usable.

        Returns:
            Half a period times each term's derivative by that state at the end of every period (rows, terms).
        """
        state, end = chain.states[0], self.stages.end
        new = [term for term in terms if (state, term) not in self._feedthrough]
        if new:
            # Of a state that never left 0 any step will do.
            step = 1e-3 * (float(np.abs(end[:, state]).max()) or 1.0)
            above, below = (end.copy() for _ in range(2))
            above[:, state] += step
            below[:, state] -= step
            slopes = (self.pool.values(new, above) - self.pool.values(new, below)) / (2.0 * step)
            for term, slope in zip(new, slopes.T, strict=True):
                self._feedthrough[state, term] = 0.5 * self.dt * np.where(np.isfinite(slope), slope, 0.0)
        return np.stack([self._feedthrough[state, term] for term in terms], axis=1)

    def limits(self, chain: Chain, terms: Sequence[int]) -> dict[int, Bounds]:
        """Bounds of a chain's coefficients, by place among terms."""
        bounds = self.priors.bounds.get(chain.states[0], {})
        return {place: bounds[term] for place, term in enumerate(terms) if term in bounds}

    def integration(self, chain: Chain) -> float:
        """Variance, a period, of what integrating terms leaves of what moves a chain's first state."""
        integrated = chain.form == "acceleration" or self.as_integrated
        return float(self.stages.integration[chain.states[0]]) if integrated else 0.0

    def readings(self, chain: Chain) -> int:
        """Readings of a chain that count."""
        return int(sum(run.weights[:, list(chain.states)].sum() for run in self.runs))
