"""A calmer world: disturbances that last have to pay for themselves, as terms do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop.errors import engine_input
from twinloop.identification.context import Context
from twinloop.identification.evidence import CORRELATED
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.selection import posed
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.noise import floor_of


def calm(context: Context, hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """The hypothesis without the lasting disturbances that explain less than they cost, fitted again.

    What is left of a law that is right is white. A disturbance that may have any size and any memory explains a little
    of that by luck, and the noise under which the readings are most likely nearly always holds one.
    """
    if not context.options.price_disturbances or hypothesis.fit is None or not hypothesis.fit.stable:
        return
    context.watch("disturbances")
    problem = posed(context, hypothesis)

    def calmed(found: Sum) -> Sum:
        """The sum with the most likely noise that does not last; itself where noise that lasts pays."""
        chain = found.chain
        if chain.motion.correlated == 0.0:
            return found
        regression = problem.regression(chain, problem.values(problem.usable(list(found.weights))))
        weights = np.array(list(found.weights.values()))
        white = (chain.motion.white, 0.0, chain.motion.correlation_time)
        floor = floor_of(chain, problem.dt, problem.integration(chain))
        # Tuned weights are not those of the regression: each noise is compared where it is most likely.
        with engine_input():
            (_, _, lasting), (sensors, motion, still) = _core.most_likely_noises(
                [(regression, weights, chain.sensors, begun, *floor) for begun in (chain.motion, white)],
                problem.workers,
            )
        if still - lasting > CORRELATED:
            return found
        length = found.description_length + still - lasting
        return replace(found, description_length=length, chain=chain.with_noise(sensors, motion))

    sums = tuple(calmed(found) for found in hypothesis.sums)
    if any(new is not old for new, old in zip(sums, hypothesis.sums, strict=True)):
        yield fitted(context, replace(hypothesis, sums=sums, fit=None))
