"""Joints that share their masses: equations of several accelerations, learnt as they are written and solved together.

The acceleration of one joint stands in the equation of another, times what depends on the pose: y_i (1 + Σ a φ) +
Σ_j y_j (Σ b φ) = N_i. Each equation is linear in its constants once accelerations are taken from what readings show of
them (`driving`), and has few terms where the explicit one has many. Solved together they give every acceleration, from
which the constants are fitted again.

Spong, Robot modeling and control, for equations of motion; Gauss's elimination for their solution.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.identification.description import shorter, shortest
from twinloop.identification.search.coupled import RIDGE, Chosen, CoupledTerms, Equation, MassTerm, thinned
from twinloop.identification.search.implicit import NOISE_ROUNDS, bounded, driving, whitened
from twinloop.identification.search.problem import Columns, Problem
from twinloop.identification.search.structure import RUNG, Sum, prices, search, total
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
LEAST = 100
"""Moves of a search among next to no terms."""
WORTH = RUNG
"""What equations must gain together, in units of χ², beside their price: as much as a rung of the ladder."""
OWN = 3
"""Terms at most that the mass of a joint itself depends on."""


@dataclass(frozen=True)
class _Posed:
    """What the equation of one joint is chosen from.

    Args:
        gram: inner products of its columns.
        chain: with the noise that a search among them has left.
        columns: forces, then terms times accelerations (3, rows, p).
        costs: of the columns (p,), infinite where one may not be chosen.
        masses: the term of each column behind the forces.
    """

    gram: _core.Gram
    chain: Chain
    columns: Columns
    costs: Floats
    masses: Sequence[MassTerm]


def with_joints(problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> list[Sum]:
    """The best sums with those of joints replaced by equations that are solved together, where these are shorter.

    Args and returns as `with_quotients`.
    """
    joints = [i for i, found in enumerate(known) if found.chain.integrated and len(found.chain.states) > 1]
    turning = sorted(angles(signals))
    free = signals.kinematics is None and not any(_has_priors(problem, known[i]) for i in joints)
    if not (free and turning and FEWEST <= len(joints) <= MOST):
        return list(known)
    finder = _Joints(problem, signals, [known[i] for i in joints], walks)
    found = finder.found()
    best = list(known)
    if found is not None and shorter(total(found) + WORTH, finder.judged(found)):
        for i, sum_ in zip(joints, found, strict=True):
            best[i] = sum_
    return best


def _has_priors(problem: Problem, found: Sum) -> bool:
    """Whether a user has stated priors on a chain's terms."""
    return bounded(problem, found) or found.chain.states[0] in problem.priors.fixed


class _Joints:
    """The search for the equations of some joints."""

    def __init__(self, problem: Problem, signals: Signals, known: Sequence[Sum], walks: Walks) -> None:
        self.problem, self.pool, self.known = problem, problem.pool, list(known)
        self.walks, self.least, self.states = walks, walks.with_moves(LEAST), signals.n_x
        self.numbers = itertools.count(FIRST + TURNS)
        rubbing = frictions_in(self.pool, (node for sum_ in known for node in sum_.weights))
        self.terms = CoupledTerms(
            problem,
            problem.usable(list(dict.fromkeys([*forces(self.pool, signals), *rubbing]))),
            problem.usable(masses(self.pool, signals)),
        )

    def found(self) -> list[Sum] | None:
        """Sums of one node each; None where no acceleration stands in another's equation.

        What one turn has found gives the accelerations of the next one.
        """
        best: list[Sum] | None = None
        for turn in range(TURNS):
            sums = self._turn(self.known if best is None else best, self.walks.part(FIRST + turn))
            if sums is None or (best is not None and not shorter(total(sums), total(best))):
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
        parts = self._chosen(posed, walks, 0)
        if not any(self.terms.share_a_mass(i, parts[i].columns, own.masses) for i, own in enumerate(posed)):
            return None
        found = self._solved_together(posed, parts)
        if found is not None and shorter(total(found), total(known)):
            return found
        # Every joint may have come upon the equation of the same one, for it tells all accelerations in it.
        briefly = [
            (keeper, sums)
            for keeper in self._overlapping(parts)
            if (sums := self._around(keeper, posed, parts, walks, 0)) is not None
        ]
        if not briefly:
            return found
        keeper, brief = shortest(briefly, lambda tried: total(tried[1]))
        tried = (found, brief, self._around(keeper, posed, parts, walks, OWN))
        return shortest([sums for sums in tried if sums is not None], total)

    def _posed(self, known: Sequence[Sum], walks: Walks) -> list[_Posed] | None:
        """What equations are chosen from; None where a short walk comes upon no shared mass that may pay."""
        accelerations = [driving(self.problem, sum_) for sum_ in known]
        every = [MassTerm(joint, term) for joint in range(len(known)) for term in self.terms.masses]
        posed = []
        for joint, sum_ in enumerate(known):
            masses = [mass for mass in every if mass != (joint, self.pool.one)]
            columns = self.terms.columns(masses, accelerations)
            gram = self.problem.gram(sum_.chain, columns)
            posed.append(_Posed(gram, sum_.chain, columns, self.terms.costs(sum_.chain, masses), masses))
        constant = [self.terms.with_own_mass_of((), i, own.costs, own.masses) for i, own in enumerate(posed)]
        if not self._may_share_a_mass(known, posed, constant, walks.part(NOISE_ROUNDS + 1)):
            return None
        grams, chains = whitened(self.problem, known, [own.columns for own in posed], constant, walks)
        under_noise = zip(posed, grams, chains, strict=True)
        return [replace(own, gram=gram, chain=chain) for own, gram, chain in under_noise]

    def _solved_together(self, posed: Sequence[_Posed], parts: Sequence[Chosen]) -> list[Sum] | None:
        """Sums of equations that are solved together; None where they have no solution."""
        equations = self.terms.fitted(
            [sum_.chain for sum_ in self.known], parts, [own.masses for own in posed]
        )
        if equations is None:
            return None
        costs = [float(own.costs[part.columns].sum()) for own, part in zip(posed, parts, strict=True)]
        return self._sums(equations, costs)

    def _overlapping(self, parts: Sequence[Chosen]) -> list[int]:
        """Joints whose equation has commands that another one has, too."""
        moving = [self._moving(part) for part in parts]
        return [
            i for i, own in enumerate(moving) if any(own & each for each in (*moving[:i], *moving[i + 1 :]))
        ]

    def _around(
        self, keeper: int, posed: Sequence[_Posed], parts: Sequence[Chosen], walks: Walks, own: int
    ) -> list[Sum] | None:
        """The equation of one joint with those of the others chosen again, without the commands that move that one.

        Args:
            keeper: whose equation stays.
            posed: what is chosen from.
            parts: what was chosen before.
            walks: of the turn.
            own: terms at most that the mass of a joint itself depends on.
        """
        every, moving = self.terms.forces, self._moving(parts[keeper])
        out = [bool(self._commands([force]) & moving) for force in every]
        limited = []
        for each in posed:
            costs = each.costs.copy()
            costs[: len(every)][out] = np.inf
            limited.append(replace(each, costs=costs))
        limited[keeper] = posed[keeper]
        chosen = self._chosen(limited, walks, keeper + 1, own, {keeper: parts[keeper]})
        return self._solved_together(posed, chosen)

    def _moving(self, part: Chosen) -> set[int]:
        """The commands among the forces of an equation."""
        return self._commands([self.terms.forces[j] for j in part.columns if j < len(self.terms.forces)])

    def _commands(self, nodes: Sequence[int]) -> set[int]:
        """The commands that some nodes are computed from."""
        return set(range(self.states, self.pool.inputs)) & set(self.pool.needed(nodes))

    def _chosen(
        self,
        posed: Sequence[_Posed],
        walks: Walks,
        number: int,
        own: int = OWN,
        kept: Mapping[int, Chosen] = MappingProxyType({}),
    ) -> list[Chosen]:
        """The columns of each joint's equation and their weights, by what the equation leaves of its acceleration.

        What its own mass depends on enters one term at a time: several of them together are next to nothing on flights
        in which poses vary little, and such a mass times the acceleration is explained by no force at all.

        Args:
            posed: what is chosen from.
            walks: of the turn.
            number: of the choice in the turn, by which its walks are told from those of others.
            own: terms at most that the mass of a joint itself depends on.
            kept: equations that stay, by joint.
        """
        several = replace(walks, starts=STARTS)
        own_mass: list[tuple[int, ...]] = [()] * len(posed)
        lengths, best = [np.inf] * len(posed), [kept.get(i, Chosen([], [])) for i in range(len(posed))]
        part = NOISE_ROUNDS + 2 + number * (OWN + 1) * len(self.terms.masses)
        offered: list[int | None] = [None]
        joints = [i for i in range(len(posed)) if i not in kept]
        for round_ in range(own + 1):
            before = list(own_mass)
            for term in offered:
                allowed = [terms if term is None else (*terms, term) for terms in before]
                limited = [
                    self.terms.with_own_mass_of(allowed[i], i, posed[i].costs, posed[i].masses)
                    for i in joints
                ]
                tried = several if term is None else several.with_moves(several.moves // SHORTER)
                grams = [posed[i].gram for i in joints]
                walked = tried.part(part).among(grams, limited, self.problem.workers)
                part += 1
                for i, subsets in zip(joints, walked, strict=True):
                    at = posed[i]
                    found = thinned(at.gram, list(subsets[0][0]), at.costs)
                    length = self.terms.residual_length(i, at.chain, at.columns, at.masses, found)
                    length += float(at.costs[found.columns].sum())
                    if shorter(length, lengths[i]):
                        best[i], lengths[i], own_mass[i] = found, length, allowed[i]
            if round_ == 0:
                offered = [*self._terms_of_shared_poses(posed, best)]
                joints = [i for i in self._sharing(posed, best) if i not in kept]
            else:
                joints = [i for i in joints if own_mass[i] != before[i]]
            if not joints:
                break
        return best

    def _sharing(self, posed: Sequence[_Posed], parts: Sequence[Chosen]) -> list[int]:
        """Joints that share a mass with another one: what is moved alone has a mass that no pose changes."""
        of_others = [
            {mass.joint for mass in self.terms.chosen_masses(part.columns, own.masses)} - {joint}
            for joint, (own, part) in enumerate(zip(posed, parts, strict=True))
        ]
        return [i for i, others in enumerate(of_others) if others or any(i in each for each in of_others)]

    def _terms_of_shared_poses(self, posed: Sequence[_Posed], parts: Sequence[Chosen]) -> list[int]:
        """Terms of those angles on which the masses between joints depend; their own masses depend on no others."""
        between = [
            mass.term
            for i, part in enumerate(parts)
            for mass in self.terms.chosen_masses(part.columns, posed[i].masses)
            if mass.joint != i
        ]
        inputs = set(self.pool.needed(between)) & set(range(self.states))
        return [
            term
            for term in self.terms.masses
            if term != self.pool.one and set(self.pool.needed([term])) & set(range(self.states)) <= inputs
        ]

    def _may_share_a_mass(
        self, known: Sequence[Sum], posed: Sequence[_Posed], costs: Sequence[Floats], walks: Walks
    ) -> bool:
        """Whether a short walk under the noise that is known comes upon a shared mass that may pay.

        Without, no more is spent.
        """
        short = walks.with_moves(walks.moves // 2)
        walked = short.among([own.gram for own in posed], costs, self.problem.workers)
        # A law of joints that was nearly right describes much with few terms beside it, and is to be found again.
        nodes = (node for found in known for node in self.pool.needed(found.weights))
        again = any(self.pool[node].operation == "/" for node in nodes)
        return any(
            self.terms.share_a_mass(i, subset, posed[i].masses)
            and (again or length < self._explicit_length(known[i]) + SLACK)
            for i, subsets in enumerate(walked)
            for subset, length in subsets[:LIKELY]
        )

    def _explicit_length(self, known: Sum) -> float:
        """Description length of an acceleration by its known sum, under the noise that is known."""
        chain, terms = known.chain, self.problem.usable(list(known.weights))
        gram = self.problem.gram(chain, self.problem.values(terms))
        solved = gram.least_squares(list(range(len(terms))), RIDGE)
        costs = prices(self.pool, terms, self.problem.readings(chain), len(self.problem.runs))
        return np.inf if solved is None else solved[1] + float(costs.sum())

    def _sums(self, equations: Sequence[Equation], costs: Sequence[float]) -> list[Sum] | None:
        """Sums of the nodes of accelerations, each at the price of its own equation's terms."""
        matrix = [[equation.of_joint(j) for j in range(len(equations))] for equation in equations]
        nodes = solution(self.pool, matrix, [equation.forces for equation in equations])
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
