"""Moderation: a normal prior on coefficients, by which no term moves a chain by much more than the chain is moved.

Readings of few flights leave room for terms that are large and nearly cancel there, such as those of an angle and of
its sine. On the next flight they cancel no more. A term that has to be large can be: it pays, and readings outweigh it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.search.problem import Problem
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import unexplained

TIMES = 3.0
"""Standard deviation of what a term moves, in units of all that moves its chain."""


def precisions(problem: Problem, chain: Chain, terms: Sequence[int]) -> Floats:
    """Inverse variances of coefficients (terms,), by which what each term moves varies `TIMES` as much as all of it.

    The mean of a term does not count: where forces balance, it is as large as what it balances.

    Args:
        problem: of the chain.
        chain: that the terms move, with how much it is moved.
        terms: that were found usable.
    """
    varied = problem.values(terms)[1].var(axis=0) if terms else np.zeros(0)
    return np.asarray(varied / (TIMES * TIMES * chain.moved))


def with_moved(problem: Problem, chain: Chain) -> Chain:
    """The chain with the variance of all that moves it: what would have to disturb it if there were no term."""
    motion, period = unexplained(problem, chain).motion, problem.dt if chain.integrated else 1.0
    return replace(chain, moved=motion.correlated + motion.white / period)
