"""Moderation: a normal prior on coefficients, by which no term moves a chain by much more than the chain is moved.

Readings of few flights leave room for terms that are large and nearly cancel there, such as those of an angle and of
its sine. On the next flight they cancel no more. A term that has to be large can be: it pays, and readings outweigh it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.identification.records import Run
from twinloop.identification.search.problem import Problem
from twinloop.identification.sensors.chains import Chain

TIMES = 3.0
"""Standard deviation of what a term moves, in units of all that moves its chain."""

OF_ALL = 0.95
"""Share of all changes that is compared with: so few readings jump that this quantile is none of theirs."""
BEYOND = 3.0
"""A change more than so many times as large as that share of all changes is a reading that jumped."""


def precisions(problem: Problem, chain: Chain, terms: Sequence[int]) -> Floats:
    """Inverse variances of coefficients (terms,), by which what each term moves varies `TIMES` as much as all of it.

    The mean of a term does not count: where forces balance, it is as large as what it balances.

    Args:
        problem: of the chain.
        chain: that the terms move, with how much it is moved.
        terms: that were found usable.
    """
    return problem.varied(terms) / (TIMES * TIMES * chain.moved)


def with_moved(chain: Chain, runs: Sequence[Run], dt: float) -> Chain:
    """The chain with the variance of all that moves it, as its readings change from period to period.

    Their noise is in it: where that is large, large terms are priced less. What a likelihood tells from noise would
    be too small where commands are switched to and fro.

    Args:
        chain: of states.
        runs: recorded.
        dt: period, s.
    """
    changes = np.concatenate([np.diff(run.states[:, chain.states[0]]) for run in runs])
    if not len(changes):
        return chain
    most = BEYOND * float(np.quantile(np.abs(changes), OF_ALL))
    period = dt if chain.integrated else 1.0
    varied = float((np.clip(changes, -most, most) if most > 0.0 else changes).var()) / (period * period)
    return replace(chain, moved=varied) if varied > 0.0 else chain
