"""Joints that share their masses: equations of several accelerations, learnt as they are written and solved together.

The acceleration of one joint stands in the equation of another, times what depends on the pose: y_i (1 + Σ a φ) +
Σ_j y_j (Σ b φ) = N_i. Each equation is linear in its constants once accelerations are taken from what readings show of
them (`driving`), and has few terms where the explicit one has many. Solved together they give every acceleration, from
which the constants are fitted again.

Spong, Robot modeling and control, for equations of motion; Gauss's elimination for their solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.search.description import shorter
from twinloop.identification.search.implicit import (
    NEAREST,
    NOISE_ROUNDS,
    bounded,
    driving,
    whitened,
)
from twinloop.identification.search.problem import Columns, Problem
from twinloop.identification.search.structure import Sum, prices, search, total
from twinloop.identification.search.walks import Walks
from twinloop.identification.terms.joints import forces, masses, solution
from twinloop.identification.terms.libraries import angles
from twinloop.signals import Signals

FIRST = 2000
"""Number of the first unit of work within a search's own, of which others have lower ones."""
FEWEST, MOST = 2, 4
"""Joints that may share their masses."""
TURNS = 2
"""How often equations are searched, the second time with the accelerations that the first ones give."""
LIKELY = 5
"""Subsets of a short walk, the best ones, that tell whether joints may share a mass."""
STARTS = 3
"""Walks among the terms of each equation."""
STEPS = 12
"""Steps of Gauss and Newton, joint by joint."""
LEAST = 100
"""Moves of a search among next to no terms."""
WORTH = 20.0
"""What equations must gain together, in units of χ², beside their price: as much as a rung of the ladder."""
RIDGE = 1e-12
"""Added to the columns' unit lengths."""

_Pairs = Sequence[tuple[int, int]]
"""Joints with the terms that stand before their accelerations."""


@dataclass(frozen=True)
class _Equation:
    """What one acceleration is: terms with weights, and weights of terms times accelerations, by joint and term."""

    terms: dict[int, float]
    masses: dict[tuple[int, int], float]

    def of_joint(self, joint: int) -> dict[int, float]:
        """Weights of the terms times one joint's acceleration."""
        return {term: weight for (j, term), weight in self.masses.items() if j == joint}


def with_joints(problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> list[Sum]:
    """The best sums with those of joints replaced by equations that are solved together, where these are shorter.

    Args and returns as `with_quotients`.
    """
    joints = [i for i, found in enumerate(known) if found.chain.integrated and len(found.chain.states) > 1]
    turning = sorted(angles(signals))
    free = signals.kinematics is None and not any(_told(problem, known[i]) for i in joints)
    if not (free and turning and FEWEST <= len(joints) <= MOST):
        return list(known)
    finder = _Joints(problem, signals, [known[i] for i in joints], walks)
    found = finder.found()
    best = list(known)
    if found is not None and shorter(total(found) + WORTH, finder.judged(found)):
        for i, sum_ in zip(joints, found, strict=True):
            best[i] = sum_
    return best


def _told(problem: Problem, found: Sum) -> bool:
    """Whether a user has stated priors on a chain's terms."""
    return bounded(problem, found) or found.chain.states[0] in problem.priors.fixed


class _Joints:
    """The search for the equations of some joints."""

    def __init__(self, problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> None:
        self.problem, self.pool, self.known = problem, problem.pool, list(known)
        self.walks, self.least = walks, walks.with_moves(LEAST)
        self.forces = problem.usable(forces(self.pool, signals))
        self.masses = problem.usable(masses(self.pool, signals))
        self.over, self.under = problem.values(self.forces), problem.values(self.masses)

    def found(self) -> list[Sum] | None:
        """Sums of one node each; None where no acceleration stands in another's equation.

        What one turn has found gives the accelerations of the next one.
        """
        best: list[Sum] | None = None
        for turn in range(TURNS):
            sums = self._turn(self.known if best is None else best, self.walks.part(FIRST + turn))
            if sums is None:
                break
            if best is None or shorter(total(sums), total(best)):
                best = sums
        return best

    def judged(self, found: Sequence[Sum]) -> float:
        """Description length of the known sums, each under the noise of a found one if it is shorter there."""
        length = 0.0
        for number, (known, new) in enumerate(zip(self.known, found, strict=True), FIRST + TURNS + MOST):
            (again,) = search(self.problem, [new.chain], list(known.weights), [None], self.least.part(number))
            length += min(known.description_length, again.description_length)
        return length

    def _turn(self, known: Sequence[Sum], walks: Walks) -> list[Sum] | None:
        accelerations = [driving(self.problem, sum_) for sum_ in known]
        pairs = [
            [
                (j, term)
                for j in range(len(self.known))
                for term in self.masses
                if (j, term) != (i, self.pool.one)
            ]
            for i in range(len(self.known))
        ]
        costs = [self._costs(sum_, of_joint) for sum_, of_joint in zip(self.known, pairs, strict=True)]
        columns = [self._columns(of_joint, accelerations) for of_joint in pairs]
        if not self._looks(known, columns, costs, pairs, walks.part(NOISE_ROUNDS + 1)):
            return None
        grams = whitened(self.problem, known, columns, costs, walks)
        several = replace(walks.part(NOISE_ROUNDS), starts=STARTS)
        subsets = [list(walked[0][0]) for walked in several.among(grams, costs, self.problem.workers)]
        parts = [
            _thinned(gram, subset, cost) for gram, subset, cost in zip(grams, subsets, costs, strict=True)
        ]
        subsets, weights = [subset for subset, _ in parts], [np.array(own) for _, own in parts]
        if not any(self._couples(i, subset, pairs[i]) for i, subset in enumerate(subsets)):
            return None
        equations = self._descended(subsets, weights, pairs)
        if equations is None:
            return None
        return self._sums(equations, [float(c[s].sum()) for c, s in zip(costs, subsets, strict=True)])

    def _looks(
        self,
        known: Sequence[Sum],
        columns: Sequence[Columns],
        costs: Sequence[Floats],
        pairs: Sequence[_Pairs],
        walks: Walks,
    ) -> bool:
        """Whether one short walk under the noise that is known comes upon a shared mass: without, no more is spent."""
        grams = [
            self.problem.regression(found.chain, own).gram(
                found.chain.sensors, found.chain.motion, self.problem.workers
            )
            for found, own in zip(known, columns, strict=True)
        ]
        short = walks.with_moves(walks.moves // 2)
        return any(
            self._couples(i, subset, pairs[i])
            for i, walked in enumerate(short.among(grams, costs, self.problem.workers))
            for subset, _ in walked[:LIKELY]
        )

    def _couples(self, joint: int, subset: Sequence[int], pairs: _Pairs) -> bool:
        """Whether another joint's acceleration is among some columns of a joint's equation."""
        places = (place - len(self.forces) for place in subset)
        return any(pairs[place][0] != joint for place in places if place >= 0)

    def _descended(
        self, subsets: Sequence[Sequence[int]], weights: list[Floats], pairs: Sequence[_Pairs]
    ) -> list[_Equation] | None:
        """The equations with those constants under which the least is left, by steps of Gauss and Newton.

        What a small force does to its own joint's acceleration is the inverse of the masses times that force.
        """
        best: tuple[float, list[_Equation]] | None = None
        for _ in range(STEPS):
            equations = [self._equation(*own) for own in zip(subsets, weights, pairs, strict=True)]
            solved = self._solved(equations)
            if solved is None:
                break
            chi_squared = 0.0
            for i, (sum_, (acceleration, answer)) in enumerate(zip(self.known, solved, strict=True)):
                columns = self._columns(pairs[i], [own for own, _ in solved])[:, :, list(subsets[i])]
                gram = self.problem.regression(
                    sum_.chain, answer[:, :, np.newaxis] * columns, acceleration[:, :, np.newaxis]
                ).gram(sum_.chain.sensors, sum_.chain.motion, self.problem.workers)
                chi_squared += gram.total
                step = gram.solve(list(range(gram.features)), RIDGE)
                weights[i] = weights[i] if step is None else weights[i] + step[0]
            if best is None or chi_squared < best[0]:
                best = chi_squared, equations
        return None if best is None else best[1]

    def _costs(self, found: Sum, pairs: _Pairs) -> Floats:
        terms = [*self.forces, *(term for _, term in pairs)]
        return prices(self.pool, terms, self.problem.readings(found.chain), len(self.problem.runs))

    def _columns(self, pairs: _Pairs, accelerations: Sequence[Floats]) -> Columns:
        place = {term: i for i, term in enumerate(self.masses)}
        coupled = [-accelerations[j] * self.under[:, :, place[term]] for j, term in pairs]
        return np.concatenate([self.over, np.stack(coupled, axis=2)], axis=2)

    def _equation(self, subset: Sequence[int], weights: Floats, pairs: _Pairs) -> _Equation:
        count = len(self.forces)
        terms = {self.forces[j]: w for j, w in zip(subset, weights.tolist(), strict=True) if j < count}
        coupled = {pairs[j - count]: w for j, w in zip(subset, weights.tolist(), strict=True) if j >= count}
        return _Equation(terms, coupled)

    def _solved(self, equations: Sequence[_Equation]) -> list[tuple[Floats, Floats]] | None:
        """Accelerations that equations give, and how each answers to its own force (3, rows); None near no mass."""
        over = {term: self.over[:, :, i] for i, term in enumerate(self.forces)}
        under = {term: self.under[:, :, i] for i, term in enumerate(self.masses)}
        count = len(equations)
        zero = np.zeros(self.over.shape[:2])
        matrix = [[zero + float(i == j) for j in range(count)] for i in range(count)]
        right = [zero for _ in range(count)]
        for i, equation in enumerate(equations):
            right[i] = sum((w * over[term] for term, w in equation.terms.items()), zero)
            for (j, term), w in equation.masses.items():
                matrix[i][j] = matrix[i][j] + w * under[term]
            matrix[i] += [zero + float(i == j) for j in range(count)]
        for k in range(count):
            size = np.abs(matrix[k][k])
            if not size.min() > NEAREST * size.max() or not np.isfinite(size).all():
                return None
            for i in (i for i in range(count) if i != k):
                share = matrix[i][k] / matrix[k][k]
                matrix[i] = [a - share * b for a, b in zip(matrix[i], matrix[k], strict=True)]
                right[i] = right[i] - share * right[k]
        return [(right[k] / matrix[k][k], matrix[k][count + k] / matrix[k][k]) for k in range(count)]

    def _sums(self, equations: Sequence[_Equation], costs: Sequence[float]) -> list[Sum] | None:
        """Sums of the nodes of accelerations, each at the price of its own equation's terms."""
        count = len(equations)
        matrix = [[equation.of_joint(j) for j in range(count)] for equation in equations]
        nodes = solution(self.pool, matrix, [equation.terms for equation in equations])
        found = []
        for number, (node, sum_, cost) in enumerate(
            zip(nodes, self.known, costs, strict=True), FIRST + TURNS
        ):
            readings = self.problem.readings(sum_.chain)
            if node is None or not self.problem.usable([node[0]]):
                return None
            self.pool.found[node[0]] = 0.5 * (cost - float(log(max(2, readings))))
            self.pool.rungs[node[0]] = 0
            (best,) = search(
                self.problem, [sum_.chain], [node[0]], [None], replace(self.least.part(number), largest=1)
            )
            found.append(best)
        return found


def _thinned(gram: _core.Gram, subset: Sequence[int], costs: Floats) -> tuple[list[int], list[float]]:
    """A subset without features that do not pay, and the weights of the others."""
    kept = list(subset)
    while True:
        solved = gram.solve(kept)
        if solved is None:
            kept = kept[:-1]
            continue
        if len(kept) < 2:
            return kept, solved[0].tolist()
        tried = []
        for out in kept:
            fewer = gram.solve([j for j in kept if j != out])
            if fewer is not None:
                tried.append((fewer[2] - float(costs[out]), out))
        if not tried or not min(tried)[0] < solved[2]:
            return kept, solved[0].tolist()
        kept.remove(min(tried)[1])
