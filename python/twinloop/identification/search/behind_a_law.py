"""Whether a sensor is late once a law moves the states: what damps a rate within a period looks like an offset, too.

A search for offsets takes disturbances for all that drives a state, held over each period. Under a law the drive
changes within it: of a rate that is damped with a time constant T the trapezoid of its readings errs as if it were
early by dt²/(12 T). So an offset has to describe the readings more briefly behind a linear law as well, for which
nothing has to be selected.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.context import Context
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.search.noise import RIDGE
from twinloop.identification.search.problem import Problem
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import floor_of
from twinloop.identification.sensors.offsets import PRICE, moved

ROUNDS = 3
"""Times that weights and noise are estimated in turn."""


def that_hold(context: Context, hypothesis: Hypothesis, offsets: Floats) -> Floats:
    """The offsets that shorten the description of the readings behind a linear law by more than they cost.

    Args:
        context: of the identification.
        hypothesis: with chains, before it has terms.
        offsets: that were found where nothing but disturbances drives the states (n_x,), s.

    Returns:
        The same with 0 for those that do not; those of states that no output drives stay, for no law moves them (n_x,).
    """
    held = offsets
    for size in dict.fromkeys(offsets[offsets != 0.0].tolist()):
        late = set(np.flatnonzero(offsets == size).tolist())
        touched = [chain for chain in (*hypothesis.driven, *hypothesis.given) if late & set(chain.states)]
        if any(chain.output is None for chain in touched):
            continue
        without = np.where(offsets == size, 0.0, held)
        lengths = []
        for tried in (held, without):
            runs = tuple(moved(context.runs, context.signals, tried))
            problem = Problem(context, replace(hypothesis, runs=runs))
            lengths.append(sum(_length(problem, chain) for chain in touched))
        if not lengths[0] < lengths[1] - PRICE:
            held = without
    return held


def _length(problem: Problem, chain: Chain) -> float:
    """−2 log of the likelihood of a chain's readings behind a linear law with the most likely noise."""
    terms = problem.usable([problem.pool.one, *range(problem.pool.inputs)])
    regression = problem.regression(chain, problem.values(terms))
    low, slow = floor_of(chain, problem.dt, problem.integration(chain))
    sensors, length = np.maximum(chain.rough, low), np.inf
    motion = (max(float(chain.rough[0]) / problem.dt, slow.white), slow.correlated, 10.0 * problem.dt)
    for _ in range(ROUNDS):
        gram = regression.gram(sensors, motion, problem.workers)
        solved = gram.least_squares(list(range(len(terms))), RIDGE)
        if solved is None:
            break
        ((sensors, motion, length),) = _core.most_likely_noises(
            [(regression, solved[0], sensors, motion, low, slow)], problem.workers
        )
    return float(length)
