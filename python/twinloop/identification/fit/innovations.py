"""Noise by innovations: what is most likely to have disturbed a model that has been tuned on its predictions.

A regression sees a law through readings. What is as steep as friction turns their noise into forces, and what these
miss looks like a disturbance. An observer sees the law through what it believes of the states, so its innovations
(Ljung 1999, chapter 7) tell the two apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop.errors import engine_input
from twinloop.identification.context import Context
from twinloop.identification.evidence import CORRELATED
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.predictions import predictions
from twinloop.identification.fit.settling import settled
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.description import shortest
from twinloop.identification.search.structure import priced
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import floor_of

STEPS = (30.0, 5.0, 1.5)
"""Factors by which variances and times are tried in turn, coarse to fine."""
FORGOTTEN = 4.0
"""Times that a correlated disturbance is forgotten within the longest record, as in the engine's likelihood."""
TURNS = 10
"""Times at most that the noise is estimated behind a law, and the law tuned with it."""
GAIN = 1.0
"""What a turn must gain, in units of χ²: less is worth no further one."""
MOVE = 0.1
"""What a move of the noise must gain."""


def by_innovations(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with noise and description lengths by its innovations, tuned with that noise.

    Args:
        context: of the identification.
        hypothesis: with a stable fit.

    Returns:
        The same terms, with the constants inside them that tuning has found, and without those that are nothing then.
    """
    best = latest = hypothesis
    for turn in range(TURNS):
        noisy = _noisy(context, latest)
        if turn and not noisy.evidence.length < best.evidence.length - GAIN:
            break
        latest = fitted(context, settled(noisy))
        if not latest.evidence.stable:
            break
        best = latest
    return best


def _noisy(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with each driven chain under its most likely noise, and what the readings say for it then."""
    assert hypothesis.fit is not None
    sums, observer = list(hypothesis.sums), list(hypothesis.fit.observer)
    for i, found in enumerate(sums):
        likelihood = _Likelihood(context, hypothesis, i)
        chain = found.chain
        period = context.signals.dt if chain.integrated else 1.0
        quiet = chain.with_noise(
            chain.sensors, (1e-3 * float(chain.sensors[0]) / period, 0.0, chain.motion.correlation_time)
        )
        begun = [quiet, chain] if chain.motion.correlated else [quiet]
        chain, length = shortest([likelihood.climbed(one) for one in begun], lambda pair: pair[1])
        # A correlated disturbance is paid for with the hypothesis, not with the sum.
        length -= CORRELATED * (chain.motion.correlated > 0.0)
        length += priced(hypothesis.pool, list(found.weights), likelihood.readings, len(hypothesis.runs))
        sums[i] = replace(found, description_length=length, chain=chain, others=[])
        observer[i] = chain
    fit = replace(hypothesis.fit, observer=tuple(observer))
    return replace(hypothesis, sums=tuple(sums), fit=fit)


class _Likelihood:
    """−2 log of the likelihood of one driven chain's innovations, with what a correlated disturbance must gain."""

    def __init__(self, context: Context, hypothesis: Hypothesis, i: int) -> None:
        self.context, self.hypothesis, self.i = context, hypothesis, i
        chain = hypothesis.sums[i].chain
        self.states, self.dt = list(chain.states), context.signals.dt
        self.counted = [run.weights[:, self.states] for run in hypothesis.runs]
        self.longest = self.dt * max(len(weights) for weights in self.counted) / FORGOTTEN
        self.readings = int(sum(weights.sum() for weights in self.counted))
        # The determinant is that of the kinematics: of readings that are 0 nothing else is left.
        nothing = [np.zeros((len(weights) - 1, 1)) for weights in self.counted]
        records = [
            (np.zeros_like(weights), weights, none, none, none)
            for weights, none in zip(self.counted, nothing, strict=True)
        ]
        with engine_input():
            self.still = _core.Regression(len(self.states), self.dt, chain.form, records)

    def __call__(self, chain: Chain) -> float:
        fit = self.hypothesis.fit
        assert fit is not None
        observer = (*fit.observer[: self.i], chain, *fit.observer[self.i + 1 :])
        errors = predictions(self.context, replace(self.hypothesis, fit=replace(fit, observer=observer)))
        if errors is None:
            return float("inf")
        squares = sum(
            float(np.square(whitened[:, self.states][weights > 0.0]).sum())
            for (whitened, _, _), weights in zip(errors, self.counted, strict=True)
        )
        determinant = float(self.still.likelihood(np.zeros(1), chain.sensors, chain.motion))
        return squares + determinant + CORRELATED * (chain.motion.correlated > 0.0)

    def climbed(self, chain: Chain) -> tuple[Chain, float]:
        """The most likely noise that is reached from a chain's by changing one number at a time."""
        best, length = chain, self(chain)
        for step in STEPS:
            moved = True
            while moved:
                moved = False
                for variant in self._beside(best, step):
                    other = self(variant)
                    if other < length - MOVE:
                        best, length, moved = variant, other, True
        return best, length

    def _beside(self, chain: Chain, step: float) -> Iterator[Chain]:
        """The chain with one number of its noise changed by a factor; never below what is believed."""
        least, slow = floor_of(chain, self.dt)
        numbers = 3 if chain.motion.correlated else 1
        for factor in (1.0 / step, step):
            for k, sensor in enumerate((chain.sensors * factor).tolist()):
                if sensor >= least[k]:
                    sensors = chain.sensors.copy()
                    sensors[k] = sensor
                    yield chain.with_noise(sensors, chain.motion)
            for k in range(numbers):
                motion = list(chain.motion)
                motion[k] *= factor
                if motion[k] >= slow[k] and (k < 2 or motion[k] <= self.longest):
                    yield chain.with_noise(chain.sensors, (motion[0], motion[1], motion[2]))
