"""Innovations: what readings say for a fitted model, by the errors of its own observer's predictions.

A regression sees a law through readings, or through states that another model has smoothed: its description lengths
compare where those are the same. An observer sees the law through what it believes of the states, so its innovations
(Ljung 1999, chapter 7) compare any two models of the same readings, and tell noise from what is as steep as friction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.side_by_side import side_by_side
from twinloop.identification.context import Context
from twinloop.identification.description import shortest
from twinloop.identification.evidence import CORRELATED
from twinloop.identification.fit.predictions import predictions
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.structure import priced
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import floor_of

STEPS = (30.0, 5.0, 1.5)
"""Factors by which variances and times are tried in turn, coarse to fine."""
FORGOTTEN = 4.0
"""Times that a correlated disturbance is forgotten within the longest record, as in the engine's likelihood."""
MOVE = 0.1
"""What a move of the noise must gain."""


class Described:
    """How briefly a fitted hypothesis describes the readings, each driven chain under its most likely noise.

    Args:
        context: of the identification.
        hypothesis: with a fit; nothing is known of one that is not stable.

    Attributes:
        hypothesis: with its length, of all readings, with terms and correlated disturbances paid for: −2 log of their
            likelihood, up to what is the same for all hypotheses of the same readings.
        chains: those that outputs drive, each under its most likely noise; none where the model diverges.
        gained: by how much the description is shorter than under the noise that the hypothesis had.
    """

    def __init__(self, context: Context, hypothesis: Hypothesis) -> None:
        self.hypothesis, self.gained = hypothesis, 0.0
        self.chains: list[Chain] = []
        fit, length = hypothesis.fit, 0.0
        if fit is None or not fit.stable:
            return
        problem = Problem(context, hypothesis)
        likelihoods = [
            _Likelihood(context, hypothesis, i, problem.integration(found.chain))
            for i, found in enumerate(hypothesis.sums)
        ]
        noises = side_by_side(
            lambda one: shortest([one.climbed(begun) for begun in one.begun], lambda pair: pair[1]),
            likelihoods,
            context.workers.threads,
        )
        for found, likelihood, (likely, least) in zip(hypothesis.sums, likelihoods, noises, strict=True):
            self.chains.append(likely)
            length += least + priced(
                hypothesis.pool, list(found.weights), likelihood.readings, len(hypothesis.runs)
            )
            self.gained += likelihood(found.chain) - least
        self.hypothesis = replace(hypothesis, fit=replace(fit, length=length))

    @property
    def under_noise(self) -> Hypothesis:
        """The hypothesis under the most likely noise, its model to be tuned with it."""
        pairs = zip(self.hypothesis.sums, self.chains, strict=True)
        return replace(self.hypothesis, sums=tuple(replace(sum_, chain=chain) for sum_, chain in pairs))


class _Likelihood:
    """−2 log of the likelihood of one driven chain's innovations, with what a correlated disturbance must gain.

    Args:
        context: of the identification.
        hypothesis: with a stable fit.
        i: number of the chain.
        integration: variance, a period, of what integrating leaves of what moves the chain: less disturbance is not
            told from that.
    """

    def __init__(self, context: Context, hypothesis: Hypothesis, i: int, integration: float) -> None:
        self.context, self.hypothesis, self.i = context, hypothesis, i
        dt, chain = context.signals.dt, hypothesis.sums[i].chain
        white = max(1e-3 * float(chain.sensors[0]), integration) / (dt if chain.integrated else 1.0)
        quiet = chain.with_noise(chain.sensors, (white, 0.0, chain.motion.correlation_time))
        self.begun = [quiet, chain] if chain.motion.correlated else [quiet]
        """Noise that the likeliest is climbed to from: hardly any, and what there is."""
        self.states = list(chain.states)
        self.counted = [run.weights[:, self.states] for run in hypothesis.runs]
        """Weights of the chain's readings, of each run."""
        self.readings = int(sum(weights.sum() for weights in self.counted))
        sensors, motion = floor_of(chain, dt, integration)
        longest = dt * max(len(weights) for weights in self.counted) / FORGOTTEN
        most = np.array([*[np.inf] * (len(sensors) + 2), longest])
        self.bounds = np.concatenate([sensors, motion]), most
        """Least and greatest numbers of the chain's noise that are believed: its sensors', then what disturbs it."""
        records = []
        for run, weights in zip(hypothesis.runs, self.counted, strict=True):
            nothing = np.zeros((len(weights) - 1, 1))
            records.append((run.states[:, self.states], weights, nothing, nothing, nothing))
        self._known: dict[bytes, float] = {}
        """Lengths of the noise that was looked at, which climbing comes back to."""
        self.readings_alone = _core.Regression(len(self.states), dt, chain.form, records)
        """The readings alone: of a likelihood they know the determinant, which is that of the kinematics."""

    def __call__(self, chain: Chain) -> float:
        """The length under the noise of a chain, which has the states and the form of this one."""
        key = np.concatenate([chain.sensors, chain.motion]).tobytes()
        if (known := self._known.get(key)) is not None:
            return known
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
        return self._known.setdefault(
            key, squares + determinant + disturbance * (chain.motion.correlated > 0.0)
        )

    def climbed(self, chain: Chain) -> tuple[Chain, float]:
        """The most likely noise that is reached from a chain's by changing one number at a time.

        It stays above what is believed, and a disturbance lasts no longer than records show.

        Returns:
            The chain, and its length.
        """
        sensors, (low, high) = len(self.states), self.bounds

        def along(chain: Chain, length: float, number: int, step: float) -> tuple[Chain, float]:
            """One number of the noise, first of its sensors, changed by a factor for as long as that gains."""
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

        best, length = chain, self(chain)
        numbers = range(sensors + (3 if chain.motion.correlated else 1))
        for step in STEPS:
            while True:
                before = length
                for number in numbers:
                    best, length = along(best, length, number, step)
                if not length < before:
                    break
        return best, length
