"""Joints that share their masses: equations of several accelerations, learnt as they are written and solved together.

The acceleration of one joint stands in the equation of another, times what depends on the pose: y_i (1 + Σ a φ) +
Σ_j y_j (Σ b φ) = N_i. Each equation is linear in its constants once accelerations are taken from what readings show of
them (`driving`), and has few terms where the explicit one has many. Solved together they give every acceleration, from
which the constants are fitted again.

Spong, Robot modeling and control, for equations of motion; Gauss's elimination for their solution.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.description import shorter, shortest
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
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.friction import frictions_in
from twinloop.identification.terms.joints import forces, masses, solution
from twinloop.identification.terms.libraries import angles
from twinloop.signals import Signals

FIRST = 2000
"""Number of the first unit of work within a search's own, of which others have lower ones."""
FEWEST, MOST = 2, 4
"""Joints that may share their masses."""
TURNS = 4
"""How often equations are searched at most, each time with the accelerations that the last ones give."""
LIKELY = 5
"""Subsets of a short walk, the best ones, that tell whether joints may share a mass."""
SLACK = 30.0
"""By how much, in units of χ², an equation with a shared mass may be longer at first than what is known."""
STARTS = 3
"""Walks among the terms of each equation."""
SHORTER = 3
"""How many times shorter walks are that try one more term of a joint's own mass: there are many such terms."""
STEPS = 12
"""Steps of Gauss and Newton, joint by joint."""
LEAST = 100
"""Moves of a search among next to no terms."""
WORTH = 20.0
"""What equations must gain together, in units of χ², beside their price: as much as a rung of the ladder."""
RIDGE = 1e-12
"""Added to the columns' unit lengths."""
OWN = 3
"""Terms at most that the mass of a joint itself depends on."""

_Pairs = Sequence[tuple[int, int]]
"""Joints with the terms that stand before their accelerations."""
_Part = tuple[list[int], list[float]]
"""Columns of an equation, and their weights."""


@dataclass(frozen=True)
class _Posed:
    """What equations are chosen from, of each joint.

    Args:
        grams: inner products of its columns.
        chains: with the noise that a search among them has left.
        columns: forces, then terms times accelerations (3, rows, p).
        costs: of the columns (p,).
        pairs: joint and term of each column behind the forces.
    """

    grams: Sequence[_core.Gram]
    chains: Sequence[Chain]
    columns: Sequence[Columns]
    costs: Sequence[Floats]
    pairs: Sequence[_Pairs]


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
        self.walks, self.least, self.states = walks, walks.with_moves(LEAST), signals.n_x
        self.numbers = itertools.count(FIRST + TURNS)
        rubbing = frictions_in(self.pool, (node for sum_ in known for node in sum_.weights))
        self.forces = problem.usable(list(dict.fromkeys([*forces(self.pool, signals), *rubbing])))
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
            if best is not None and not shorter(total(sums), total(best)):
                break
            best = sums
        return best

    def judged(self, found: Sequence[Sum]) -> float:
        """Description length of the known sums, each under the noise of a found one if it is shorter there."""
        length = 0.0
        for known, new in zip(self.known, found, strict=True):
            walks = self.least.part(next(self.numbers))
            (again,) = search(self.problem, [new.chain], list(known.weights), [None], walks)
            length += min(known.description_length, again.description_length)
        return length

    def _turn(self, known: Sequence[Sum], walks: Walks) -> list[Sum] | None:
        posed = self._posed(known, walks)
        if posed is None:
            return None
        parts = self._chosen(posed, posed.costs, walks, 0)
        if not any(self._couples(i, subset, posed.pairs[i]) for i, (subset, _) in enumerate(parts)):
            return None
        found = self._together(posed, parts)
        if found is not None and shorter(total(found), total(known)):
            return found
        # Every joint may have come upon the equation of the same one, for it tells all accelerations in it.
        beside = (self._beside(posed, parts, keeper, walks) for keeper in range(len(parts)))
        tried = (found, *(self._together(posed, each) for each in beside))
        several = [sums for sums in tried if sums is not None]
        return shortest(several, total) if several else None

    def _posed(self, known: Sequence[Sum], walks: Walks) -> _Posed | None:
        """What equations are chosen from; None where a short walk comes upon no shared mass that may pay."""
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
        shared = [self._restricted(i, own, pairs[i], ()) for i, own in enumerate(costs)]
        if not self._looks(known, columns, shared, pairs, walks.part(NOISE_ROUNDS + 1)):
            return None
        grams, chains = whitened(self.problem, known, columns, shared, walks)
        return _Posed(grams, chains, columns, costs, pairs)

    def _together(self, posed: _Posed, parts: Sequence[_Part]) -> list[Sum] | None:
        """Sums of equations that are solved together; None where they have no solution."""
        subsets, weights = [subset for subset, _ in parts], [np.array(own) for _, own in parts]
        equations = self._descended(subsets, weights, posed.pairs)
        if equations is None:
            return None
        return self._sums(equations, [float(c[s].sum()) for c, s in zip(posed.costs, subsets, strict=True)])

    def _beside(self, posed: _Posed, parts: Sequence[_Part], keeper: int, walks: Walks) -> list[_Part]:
        """The equation of one joint with those of the others chosen again, without the commands that move that one."""
        moving = self._commands([self.forces[j] for j in parts[keeper][0] if j < len(self.forces)])
        out = [bool(self._commands([force]) & moving) for force in self.forces]
        costs = []
        for joint, own in enumerate(posed.costs):
            limited = own.copy()
            if joint != keeper:
                limited[: len(self.forces)][out] = np.inf
            costs.append(limited)
        chosen = self._chosen(posed, costs, walks, keeper + 1)
        return [parts[joint] if joint == keeper else part for joint, part in enumerate(chosen)]

    def _commands(self, nodes: Sequence[int]) -> set[int]:
        """The commands that some nodes are computed from."""
        return set(range(self.states, self.pool.inputs)) & set(self.pool.needed(nodes))

    def _chosen(self, posed: _Posed, costs: Sequence[Floats], walks: Walks, number: int) -> list[_Part]:
        """The columns of each joint's equation and their weights, by what the equation leaves of its acceleration.

        What its own mass depends on enters one term at a time: several of them together are next to nothing on flights
        in which poses vary little, and such a mass times the acceleration is explained by no force at all.

        Args:
            posed: what is chosen from.
            costs: of the columns of each joint, infinite where one may not be chosen.
            walks: of the turn.
            number: of the choice in the turn, by which its walks are told from those of others.
        """
        several, joints = replace(walks, starts=STARTS), range(len(costs))
        own: list[tuple[int, ...]] = [()] * len(costs)
        best: list[tuple[float, _Part]] = [(np.inf, ([], []))] * len(costs)
        part = NOISE_ROUNDS + 2 + number * (OWN + 1) * len(self.masses)
        offered: list[int | None] = [None]
        for round_ in range(OWN + 1):
            before = list(own)
            for term in offered:
                allowed = [terms if term is None else (*terms, term) for terms in before]
                limited = [self._restricted(i, costs[i], posed.pairs[i], allowed[i]) for i in joints]
                tried = several if term is None else several.with_moves(several.moves // SHORTER)
                walked = tried.part(part).among(posed.grams, limited, self.problem.workers)
                part += 1
                for i, subsets in enumerate(walked):
                    found = _thinned(posed.grams[i], list(subsets[0][0]), costs[i])
                    length = self._left(posed, i, *found) + float(costs[i][found[0]].sum())
                    if shorter(length, best[i][0]):
                        best[i], own[i] = (length, found), allowed[i]
            if round_ and own == before:
                break
            if round_ == 0:
                offered = [*self._poses_shared(posed, [found for _, found in best])]
        return [found for _, found in best]

    def _poses_shared(self, posed: _Posed, parts: Sequence[_Part]) -> list[int]:
        """Terms of those angles on which the masses between joints depend; their own masses depend on no others."""
        count = len(self.forces)
        between = [
            posed.pairs[i][place - count][1]
            for i, (subset, _) in enumerate(parts)
            for place in subset
            if place >= count and posed.pairs[i][place - count][0] != i
        ]
        inputs = set(self.pool.needed(between)) & set(range(self.states))
        return [
            term
            for term in self.masses
            if term != self.pool.one and set(self.pool.needed([term])) & set(range(self.states)) <= inputs
        ]

    def _restricted(self, joint: int, costs: Floats, pairs: _Pairs, allowed: Sequence[int]) -> Floats:
        """Prices under which a joint's own mass depends on some terms only."""
        count, out = len(self.forces), costs.copy()
        for place, (j, term) in enumerate(pairs, count):
            if j == joint and term not in allowed:
                out[place] = np.inf
        return out

    def _left(self, posed: _Posed, joint: int, subset: Sequence[int], weights: Sequence[float]) -> float:
        """What is left of readings by an acceleration that its equation is solved for, others as they are known."""
        columns, chain, pairs = posed.columns[joint], posed.chains[joint], posed.pairs[joint]
        place = {term: i for i, term in enumerate(self.masses)}
        over, mass = np.zeros(columns.shape[:2]), np.ones(columns.shape[:2])
        for j, weight in zip(subset, weights, strict=True):
            of, term = pairs[j - len(self.forces)] if j >= len(self.forces) else (-1, 0)
            if of == joint:
                mass = mass + weight * self.under[:, :, place[term]]
            else:
                over = over + weight * columns[:, :, j]
        if not mass.min() > NEAREST * mass.max():
            return float("inf")
        explained = (over / mass)[:, :, np.newaxis]
        regression = self.problem.regression(chain, explained, explained)
        return regression.gram(chain.sensors, chain.motion, self.problem.workers).total

    def _looks(
        self,
        known: Sequence[Sum],
        columns: Sequence[Columns],
        costs: Sequence[Floats],
        pairs: Sequence[_Pairs],
        walks: Walks,
    ) -> bool:
        """Whether a short walk under the noise that is known comes upon a shared mass that may pay.

        Without, no more is spent.
        """
        grams = [
            self.problem.regression(found.chain, own).gram(
                found.chain.sensors, found.chain.motion, self.problem.workers
            )
            for found, own in zip(known, columns, strict=True)
        ]
        short = walks.with_moves(walks.moves // 2)
        # A law of joints that was nearly right describes much with few terms beside it, and is to be found again.
        again = any(self._divides(found) for found in known)
        return any(
            self._couples(i, subset, pairs[i]) and (again or length < self._apart(known[i]) + SLACK)
            for i, walked in enumerate(short.among(grams, costs, self.problem.workers))
            for subset, length in walked[:LIKELY]
        )

    def _divides(self, known: Sum) -> bool:
        """Whether there is a quotient in a sum, as there is where it was solved from equations of joints."""
        return any(self.pool[node].operation == "/" for node in self.pool.needed(known.weights))

    def _apart(self, known: Sum) -> float:
        """Description length of an acceleration by its known sum, under the noise that is known."""
        chain, terms = known.chain, self.problem.usable(list(known.weights))
        regression = self.problem.regression(chain, self.problem.values(terms))
        gram = regression.gram(chain.sensors, chain.motion, self.problem.workers)
        solved = gram.solve(list(range(len(terms))), RIDGE)
        costs = prices(self.pool, terms, self.problem.readings(chain), len(self.problem.runs))
        return np.inf if solved is None else solved[2] + float(costs.sum())

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
        for node, sum_, cost in zip(nodes, self.known, costs, strict=True):
            readings = self.problem.readings(sum_.chain)
            if node is None or not self.problem.usable([node[0]]):
                return None
            self.pool.found[node[0]] = 0.5 * (cost - float(log(max(2, readings))))
            self.pool.rungs[node[0]] = 0
            walks = replace(self.least.part(next(self.numbers)), largest=1)
            (best,) = search(self.problem, [sum_.chain], [node[0]], [None], walks)
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
