"""Masses behind gaps that explain most of what terms leave of a rate: tried on a grid, then walked to nearby."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import power
from twinloop.identification.gaps import Masses, behind_gaps
from twinloop.identification.search.noise import RIDGE, first_noise
from twinloop.identification.search.problem import Problem
from twinloop.identification.sensors.chains import Chain
from twinloop.signals import Signals

TURNS = (0.8, 0.15)
"""Times in which a mass turns on what presses: from this many periods to this share of the longest run, in steps of"""
STEP = 1.6
"""this factor."""
GAPS = tuple(0.3 * power(0.7, k) for k in range(13))
"""Halves of gaps, in units of how far what drives the mass goes."""
DAMPINGS = (0.05, 0.3)
"""Dampings, in units of the time in which the mass turns."""
TIMES = (0.2, 2.0)
"""Times in which its rate fades, in lengths of the longest run."""
PROMISING = 0.92
"""Share of what terms leave, as if no disturbance lasted, that the best mass of the grid leaves at most."""
WALKED = 0.8
"""Share that the best one that was walked to does: a gap is hit hard, and little else looks like that."""
WALKERS = 10
"""Masses of the grid from which is walked at most, the best ones that turn in different times."""
STRIDES = (1.3, 1.15, 1.07, 1.03)
"""Factors between numbers from which is walked on, one after the other, where none is better."""
STEPS = 6
"""Steps at most with each of them."""
ENDS = 4
"""Masses that were walked to that are given at most, the best ones."""
NEAR = 0.05
"""Share by which times in which masses turn, or gaps, differ at least if two are not the same."""


def masses_behind(
    problem: Problem, signals: Signals, chain: Chain, base: list[int], worth: float
) -> list[Floats]:
    """Masses that a rate drives, each with its time of turning, half gap, damping and time of fading (4,), all in s.

    Args:
        problem: of a hypothesis without hidden states that motion fills.
        signals: of the system.
        chain: whose first state is the rate.
        base: usable terms beside which what presses on a mass has to explain something.
        worth: how much at least, in units of χ².

    Returns:
        The best first; none if none explains as much.
    """
    trial = _Trial.of(problem, signals, chain, base)
    groups = trial.grid()
    tried = [(group, trial.left(group)) for group in groups]
    # From the best of all alone a walk may end beside what is there.
    begun = sorted(((left.min(), *group[:, left.argmin()]) for group, left in tried), key=lambda one: one[0])
    found, best = np.array(begun[:WALKERS])[:, 0], np.array(begun[:WALKERS])[:, 1:].T
    if not found.min() < min(PROMISING * trial.bare, trial.bare - worth):
        return []
    least, count = groups[0][0].min(), len(found)
    for stride in STRIDES:
        for _ in range(STEPS):
            around = _around(best, stride)
            around[0] = np.maximum(around[0], least)
            left = trial.left(around).reshape(-1, count)
            better, each = left.argmin(axis=0), np.arange(count)
            lower = left[better, each] < found
            if not lower.any():
                break
            best = np.where(lower, around.reshape(len(best), -1, count)[:, better, each], best)
            found = np.where(lower, left[better, each], found)
    return _apart(best, found) if found.min() < WALKED * trial.bare else []


def _apart(masses: Floats, left: Floats) -> list[Floats]:
    """The best of some masses that are not nearly the same."""
    ends: list[Floats] = []
    for one in masses.T[np.argsort(left, kind="stable")]:
        if len(ends) < ENDS and all((np.abs(one - other)[:2] > NEAR * other[:2]).any() for other in ends):
            ends.append(one)
    return ends


def _around(masses: Floats, stride: float) -> Floats:
    """Masses (4, k) with one number of each larger or smaller by a factor, or two of them (4, 12 k)."""
    directions = [[i == j for i in range(4)] for j in range(4)]
    directions += [[i in pair for i in range(4)] for pair in ((0, 1), (0, 2))]
    larger = np.where(np.array(directions), stride, 1.0)
    factors = np.vstack([larger, 1.0 / larger])
    moved: Floats = (masses[:, np.newaxis, :] * factors.T[:, :, np.newaxis]).reshape(len(masses), -1)
    return moved


@dataclass(frozen=True, eq=False)
class _Trial:
    """What is left of a rate by terms, and by what presses on a mass that it drives.

    Args:
        problem: of a hypothesis.
        chain: whose first state is the rate, with the noise that the terms leave if no disturbance lasts.
        base: the terms.
        bare: what they leave without any mass, in units of χ².
        rates: the rate in units of its scale, at the start, the middle and the end of each period (rows,).
    """

    problem: Problem
    chain: Chain
    base: list[int]
    bare: float
    rates: tuple[Floats, Floats, Floats]

    @staticmethod
    def of(problem: Problem, signals: Signals, chain: Chain, base: list[int]) -> _Trial:
        """With the noise that the terms leave."""
        [quiet] = first_noise(problem, [chain], base, gusts=False)
        solved = problem.gram(quiet, problem.values(base)).least_squares(list(range(len(base))), RIDGE)
        place, stages = chain.states[0], problem.stages
        start, middle, end = (
            each[:, place] / signals.states[place].scale for each in (stages.start, stages.middle, stages.end)
        )
        return _Trial(problem, quiet, base, np.inf if solved is None else solved[1], (start, middle, end))

    def grid(self) -> list[Floats]:
        """Masses that are tried first (4, k), in groups that turn in the same time."""
        dt, runs = self.problem.dt, self.problem.stages.runs
        longest = dt * max(rows.stop - rows.start for rows in runs)
        way = np.cumsum(dt * self.rates[1])
        gone = max(float(np.ptp(way[rows])) for rows in runs)
        turns = [TURNS[0] * dt]
        while turns[-1] * STEP < TURNS[1] * longest:
            turns.append(turns[-1] * STEP)
        others = list(itertools.product(GAPS, DAMPINGS, TIMES))
        return [
            np.array([(turn, gone * gap, turn * damping, longest * time) for gap, damping, time in others]).T
            for turn in turns
        ]

    def left(self, masses: Floats) -> Floats:
        """What the terms leave beside what presses on each of some masses (4, k), in units of χ² (k,)."""
        problem, count = self.problem, len(self.base)
        found = behind_gaps(Masses(*masses), self.rates, problem.stages.runs, problem.dt)
        pressed = np.stack([stage[:, 0] for stage in found])
        usable = np.isfinite(pressed).all(axis=(0, 1)) & (np.abs(pressed).max(axis=(0, 1)) < 1e100)
        columns = np.concatenate([problem.values(self.base), np.where(usable, pressed, 0.0)], axis=2)
        gram, left = problem.gram(self.chain, columns), np.full(masses.shape[1], np.inf)
        for i in np.flatnonzero(usable & (pressed != 0.0).any(axis=(0, 1))):
            solved = gram.least_squares([*range(count), count + int(i)], RIDGE)
            left[i] = np.inf if solved is None else solved[1]
        return left
