"""Innovations: what readings say for a fitted model, by the errors of its own observer's predictions.

A regression sees a law through readings, or through states that another model has smoothed: its description lengths
compare where those are the same. An observer sees the law through what it believes of the states, so its innovations
(Ljung 1999, chapter 7) compare any two models of the same readings, and tell noise from what is as steep as friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.errors import engine_input
from twinloop.identification.context import Context
from twinloop.identification.evidence import CORRELATED
from twinloop.identification.fit.predictions import predictions
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.description import shortest
from twinloop.identification.search.selection import posed
from twinloop.identification.search.structure import priced
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import floor_of

STEPS = (30.0, 5.0, 1.5)
"""Factors by which variances and times are tried in turn, coarse to fine."""
FORGOTTEN = 4.0
"""Times that a correlated disturbance is forgotten within the longest record, as in the engine's likelihood."""
MOVE = 0.1
"""What a move of the noise must gain."""


@dataclass(frozen=True, eq=False)
class Described:
    """What the innovations of a fitted hypothesis say for it.

    Args:
        hypothesis: with its length, of all readings, with terms and correlated disturbances paid for.
        chains: those that outputs drive, each under its most likely noise; none where the model diverges.
        gained: by how much the description is shorter than under the noise that the hypothesis had.
    """

    hypothesis: Hypothesis
    chains: tuple[Chain, ...] = ()
    gained: float = 0.0

    @property
    def under_noise(self) -> Hypothesis:
        """The hypothesis under the most likely noise, its model to be tuned with it."""
        pairs = zip(self.hypothesis.sums, self.chains, strict=True)
        return replace(self.hypothesis, sums=tuple(replace(sum_, chain=chain) for sum_, chain in pairs))


def described(context: Context, hypothesis: Hypothesis) -> Described:
    """How briefly a fitted hypothesis describes the readings, each driven chain under its most likely noise.

    Args:
        context: of the identification.
        hypothesis: with a fit; nothing is known of one that is not stable.

    Returns:
        Lengths of −2 log likelihood, up to what is the same for all hypotheses of the same readings.
    """
    fit = hypothesis.fit
    if fit is None or not fit.stable:
        return Described(hypothesis)
    chains, length, before = [], 0.0, 0.0
    problem = posed(context, hypothesis)
    for i, found in enumerate(hypothesis.sums):
        chain = found.chain
        likelihood = _Likelihood(context, hypothesis, i, problem.integration(chain))
        period = context.signals.dt if chain.integrated else 1.0
        white = max(1e-3 * float(chain.sensors[0]), likelihood.integration) / period
        quiet = chain.with_noise(chain.sensors, (white, 0.0, chain.motion.correlation_time))
        begun = [quiet, chain] if chain.motion.correlated else [quiet]
        likely, least = shortest([likelihood.climbed(one) for one in begun], lambda pair: pair[1])
        chains.append(likely)
        length += least + priced(
            hypothesis.pool, list(found.weights), likelihood.readings, len(hypothesis.runs)
        )
        before += likelihood(chain) - least
    return Described(replace(hypothesis, fit=replace(fit, length=length)), tuple(chains), before)


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """−2 log of the likelihood of one driven chain's innovations, with what a correlated disturbance must gain.

    Args:
        context: of the identification.
        hypothesis: with a stable fit.
        i: number of the chain.
        integration: variance, a period, of what integrating leaves of what moves the chain: less disturbance is not
            told from that.
    """

    context: Context
    hypothesis: Hypothesis
    i: int
    integration: float

    @property
    def states(self) -> list[int]:
        """Of the chain."""
        return list(self.hypothesis.sums[self.i].chain.states)

    @cached_property
    def counted(self) -> Sequence[Floats]:
        """Weights of the chain's readings, of each run."""
        return [run.weights[:, self.states] for run in self.hypothesis.runs]

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Least and greatest numbers of the chain's noise that are believed: its sensors', then what disturbs it."""
        sensors, motion = floor_of(
            self.hypothesis.sums[self.i].chain, self.context.signals.dt, self.integration
        )
        longest = self.context.signals.dt * max(len(weights) for weights in self.counted) / FORGOTTEN
        return np.concatenate([sensors, motion]), np.array([*[np.inf] * (len(sensors) + 2), longest])

    @property
    def readings(self) -> int:
        """That count."""
        return int(sum(weights.sum() for weights in self.counted))

    @cached_property
    def readings_alone(self) -> _core.Regression:
        """The readings alone: of a likelihood they know the determinant, which is that of the kinematics."""
        states, chain = self.states, self.hypothesis.sums[self.i].chain
        records = []
        for run, weights in zip(self.hypothesis.runs, self.counted, strict=True):
            nothing = np.zeros((len(weights) - 1, 1))
            records.append((run.states[:, states], weights, nothing, nothing, nothing))
        with engine_input():
            return _core.Regression(len(states), self.context.signals.dt, chain.form, records)

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
        determinant = self.readings_alone.log_determinant(chain.sensors, chain.motion)
        disturbance = CORRELATED * self.context.options.price_disturbances
        return squares + determinant + disturbance * (chain.motion.correlated > 0.0)

    def climbed(self, chain: Chain) -> tuple[Chain, float]:
        """The most likely noise that is reached from a chain's by changing one number at a time."""
        best, length = chain, self(chain)
        numbers = range(len(self.states) + (3 if chain.motion.correlated else 1))
        for step in STEPS:
            while True:
                before = length
                for number in numbers:
                    best, length = self._along(best, length, number, step)
                if not length < before:
                    break
        return best, length

    def _along(self, chain: Chain, length: float, number: int, step: float) -> tuple[Chain, float]:
        """A chain with one number of its noise, first of its sensors, changed by a factor for as long as that gains.

        It stays above what is believed, and a disturbance lasts no longer than records show.

        Returns:
            The chain, and its length.
        """
        sensors, (low, high) = len(self.states), self.bounds
        for factor in (1.0 / step, step):
            best, least, numbers = chain, length, np.concatenate([chain.sensors, chain.motion])
            while True:
                numbers[number] *= factor
                if not low[number] <= numbers[number] <= high[number]:
                    break
                white, correlated, time = numbers[sensors:].tolist()
                variant = chain.with_noise(numbers[:sensors].copy(), (white, correlated, time))
                other = self(variant)
                if not other < least - MOVE:
                    break
                best, least = variant, other
            if least < length:
                return best, least
        return chain, length
