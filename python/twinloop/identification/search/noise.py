"""The noise of a chain to begin with, from below and from above.

From below, it is what a fit of all terms leaves; from above, everything that moves is disturbance.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.side_by_side import side_by_side
from twinloop.identification.description import shortest
from twinloop.identification.search.problem import Problem
from twinloop.identification.sensors.chains import Chain, Motion
from twinloop.identification.sensors.noise import floor_of

GUSTS = (1e-3, 1e-1, 10.0)
"""Variances of a lasting disturbance that are tried first, in units of what the sensor's noise looks like as one."""
GUST = 1e-2
"""The same where terms have explained what they can."""
CALM = 1e-2
"""Variance, in a sensor's, of what disturbs in a period and is hardly seen."""
RIDGE = 1e-9
"""Added to the columns' unit lengths where all terms are fitted at once."""


def calm(problem: Problem, chain: Chain) -> Chain:
    """The chain with next to no disturbance, and its sensors' noise; itself where there is hardly any.

    Args:
        problem: of the chain.
        chain: with its noise.
    """
    _, slow = floor_of(chain, problem.dt, problem.integration(chain))
    return chain.with_noise(chain.sensors, slow) if disturbed(problem, chain, CALM) else chain


def disturbed(problem: Problem, chain: Chain, share: float) -> bool:
    """Whether what disturbs a chain in a period has more than a share of its sensors' variance."""
    period = problem.dt if chain.integrated else 1.0
    moved = chain.motion.white * period + chain.motion.correlated * period * period
    return moved > share * float(chain.sensors[0])


def lasts(problem: Problem, chain: Chain) -> bool:
    """Whether a lasting disturbance moves a chain by more than its sensors' noise would hide in a period."""
    period = problem.dt if chain.integrated else 1.0
    return chain.motion.correlated * period * period > CALM * float(chain.sensors[0])


def still(problem: Problem, chains: Iterable[Chain]) -> bool:
    """Whether hardly anything disturbs some chains: terms leave their sensors' noise alone."""
    return all(calm(problem, chain) is chain for chain in chains)


def unexplained(problem: Problem, chain: Chain, gusts: bool = True) -> Chain:
    """The noise from above: what would have to disturb the motion if no term drove the chain.

    Args:
        problem: of the chain.
        chain: with a first guess of its sensors' noise.
        gusts: whether disturbances may last.

    Returns:
        The chain with that noise.
    """
    regression = problem.regression(chain, problem.values(problem.usable([problem.pool.one])))
    low, slow = floor_of(chain, problem.dt, problem.integration(chain))
    # Where a disturbance is far too small no small change of it makes any difference: it is tried at several sizes.
    begun = [_begun(chain, low, slow, problem.dt, size) for size in (GUSTS if gusts else (0.0,))]
    found = _core.most_likely_noises(
        [(regression, [0.0], *start, low, slow) for start in begun], problem.workers
    )
    sensors, motion, _ = shortest(found, lambda answer: answer[2])
    return chain.with_noise(sensors, motion)


def first_noise(problem: Problem, chains: Sequence[Chain], terms: Sequence[int], gusts: bool) -> list[Chain]:
    """The noise that a fit of all terms leaves, corrected for its degrees of freedom.

    Args:
        problem: of the chains.
        chains: with a first guess of their sensors' noise.
        terms: of which the usable ones are fitted.
        gusts: whether disturbances may last.

    Returns:
        The chains with their noise estimated.
    """
    usable = problem.usable(terms)

    def left(chain: Chain) -> Chain:
        regression = problem.regression(chain, problem.values(usable))
        low, slow = floor_of(chain, problem.dt, problem.integration(chain))
        sensors, motion = _begun(chain, low, slow, problem.dt, GUST if gusts else 0.0)
        readings = problem.readings(chain)
        for _ in range(2):
            gram = regression.gram(sensors, motion, problem.workers)
            solved = gram.least_squares(list(range(len(usable))), RIDGE)
            if solved is None:
                break
            ((sensors, found, _),) = _core.most_likely_noises(
                [(regression, solved[0], sensors, motion, low, slow)], problem.workers
            )
            motion = Motion(*found)
            used = min(len(usable), 0.7 * readings)
            sensors = sensors * readings / (readings - used)
        return chain.with_noise(sensors, motion)

    # Chains share nothing but the values of their terms.
    return side_by_side(left, chains, problem.workers.threads)


def _begun(chain: Chain, low: Floats, slow: Motion, dt: float, gust: float) -> tuple[Floats, Motion]:
    """Where a search for the noise begins, with a gust of some size."""
    sensors = np.maximum(chain.sensors, low)
    period = dt if chain.integrated else 1.0
    first = float(sensors[0])
    white = max(1e-3 * first / period, slow.white)
    return sensors, Motion(white, gust * first / (period * period), 10.0 * dt)
