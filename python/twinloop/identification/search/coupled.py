"""Coupled equations: what they are made of, what they give when they are solved together, and their best constants.

The equation of joint i is y_i (1 + Σ a φ) + Σ_j y_j (Σ b φ) = Σ c ψ, where y are accelerations, φ terms of masses, and
ψ terms of forces. Gauss's elimination solves several of them; steps of Gauss and Newton fit their constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.search.implicit import NEAREST
from twinloop.identification.search.problem import Columns, Problem
from twinloop.identification.search.structure import prices
from twinloop.identification.sensors.chains import Chain

STEPS = 12
"""Steps of Gauss and Newton, joint by joint."""
RIDGE = 1e-12
"""Added to the columns' unit lengths."""


class MassTerm(NamedTuple):
    """A term that stands before an acceleration.

    Args:
        joint: whose acceleration it is.
        term: its node.
    """

    joint: int
    term: int


@dataclass(frozen=True)
class Chosen:
    """The columns of a joint's equation.

    Args:
        columns: their numbers: forces, then terms times accelerations.
        weights: of each.
    """

    columns: list[int]
    weights: list[float]


@dataclass(frozen=True)
class Equation:
    """The equation of one joint.

    Args:
        forces: weights of its terms.
        masses: weights of terms times accelerations, beside its own acceleration.
    """

    forces: dict[int, float]
    masses: dict[MassTerm, float]

    def of_joint(self, joint: int) -> dict[int, float]:
        """Weights of the terms times one joint's acceleration."""
        return {mass.term: weight for mass, weight in self.masses.items() if mass.joint == joint}


class Solved(NamedTuple):
    """What equations give for one joint.

    Args:
        acceleration: at the start, the middle and the end of each period (3, rows).
        answer: its derivative by a force on the joint itself, of the same shape.
    """

    acceleration: Floats
    answer: Floats


@dataclass(frozen=True, eq=False)
class CoupledTerms:
    """The terms of which equations of joints are made.

    Args:
        problem: in which they are usable.
        forces: terms that drive joints.
        masses: terms that may stand before accelerations.
    """

    problem: Problem
    forces: list[int]
    masses: list[int]

    @cached_property
    def of_forces(self) -> Columns:
        """Values of the forces (3, rows, forces)."""
        return self.problem.values(self.forces)

    @cached_property
    def of_masses(self) -> dict[int, Floats]:
        """Values of each term of a mass (3, rows)."""
        values = self.problem.values(self.masses)
        return {term: values[:, :, i] for i, term in enumerate(self.masses)}

    def columns(self, masses: Sequence[MassTerm], accelerations: Sequence[Floats]) -> Columns:
        """Columns of an equation: forces, then terms times accelerations (3, rows, p)."""
        coupled = [-accelerations[joint] * self.of_masses[term] for joint, term in masses]
        return np.concatenate([self.of_forces, np.stack(coupled, axis=2)], axis=2)

    def chosen_masses(self, columns: Sequence[int], masses: Sequence[MassTerm]) -> list[MassTerm]:
        """Those of the terms before accelerations that are among some columns."""
        return [masses[place - len(self.forces)] for place in columns if place >= len(self.forces)]

    def share_a_mass(self, joint: int, columns: Sequence[int], masses: Sequence[MassTerm]) -> bool:
        """Whether another joint's acceleration is among some columns of a joint's equation."""
        return any(mass.joint != joint for mass in self.chosen_masses(columns, masses))

    def costs(self, chain: Chain, masses: Sequence[MassTerm]) -> Floats:
        """Prices of the columns of an equation (p,), in units of χ²."""
        terms = [*self.forces, *(mass.term for mass in masses)]
        return prices(self.problem.pool, terms, self.problem.readings(chain), len(self.problem.runs))

    def with_own_mass_of(
        self, allowed: Sequence[int], joint: int, costs: Floats, masses: Sequence[MassTerm]
    ) -> Floats:
        """Prices under which a joint's own mass depends on some terms only."""
        limited = costs.copy()
        for place, mass in enumerate(masses, len(self.forces)):
            if mass.joint == joint and mass.term not in allowed:
                limited[place] = np.inf
        return limited

    def equation(self, columns: Sequence[int], weights: Floats, masses: Sequence[MassTerm]) -> Equation:
        """The equation of some columns with weights."""
        count, weighted = len(self.forces), list(zip(columns, weights.tolist(), strict=True))
        return Equation(
            {self.forces[place]: weight for place, weight in weighted if place < count},
            {masses[place - count]: weight for place, weight in weighted if place >= count},
        )

    def residual_length(
        self, joint: int, chain: Chain, columns: Columns, masses: Sequence[MassTerm], chosen: Chosen
    ) -> float:
        """What is left of readings by an acceleration that its equation is solved for, others as they are known.

        Args:
            joint: whose equation it is.
            chain: of the joint, with its noise.
            columns: of the equation (3, rows, p).
            masses: terms of its columns behind the forces.
            chosen: which of the columns are in it.

        Returns:
            In units of χ²; infinite where the joint has next to no mass.
        """
        over, mass = np.zeros(columns.shape[:2]), np.ones(columns.shape[:2])
        for place, weight in zip(chosen.columns, chosen.weights, strict=True):
            before = self.chosen_masses([place], masses)
            if before and before[0].joint == joint:
                mass = mass + weight * self.of_masses[before[0].term]
            else:
                over = over + weight * columns[:, :, place]
        if not mass.min() > NEAREST * mass.max():
            return float("inf")
        explained = (over / mass)[:, :, np.newaxis]
        return self.problem.gram(chain, explained, explained).total

    def fitted(
        self, chains: Sequence[Chain], parts: Sequence[Chosen], masses: Sequence[Sequence[MassTerm]]
    ) -> list[Equation] | None:
        """The equations with those constants under which the least is left, by steps of Gauss and Newton.

        What a small force does to its own joint's acceleration is the inverse of the masses times that force.

        Args:
            chains: of the joints, with their noise.
            parts: columns of each joint's equation, and weights to begin with.
            masses: terms of each joint's columns behind the forces.

        Returns:
            None where they have no solution.
        """
        weights = [np.array(part.weights) for part in parts]
        best: tuple[float, list[Equation]] | None = None
        for _ in range(STEPS):
            equations = [
                self.equation(part.columns, own, terms)
                for part, own, terms in zip(parts, weights, masses, strict=True)
            ]
            solved = self.solved(equations)
            if solved is None:
                break
            chi_squared = 0.0
            for i, (chain, (acceleration, answer)) in enumerate(zip(chains, solved, strict=True)):
                columns = self.columns(masses[i], [own.acceleration for own in solved])
                gram = self.problem.gram(
                    chain,
                    answer[:, :, np.newaxis] * columns[:, :, parts[i].columns],
                    acceleration[:, :, np.newaxis],
                )
                chi_squared += gram.total
                step = gram.least_squares(list(range(gram.features)), RIDGE)
                weights[i] = weights[i] if step is None else weights[i] + step[0]
            if best is None or chi_squared < best[0]:
                best = chi_squared, equations
        return None if best is None else best[1]

    def solved(self, equations: Sequence[Equation]) -> list[Solved] | None:
        """What equations give for each joint, by Gauss's elimination; None near no mass."""
        over = {term: self.of_forces[:, :, i] for i, term in enumerate(self.forces)}
        count = len(equations)
        zero = np.zeros(self.of_forces.shape[:2])
        matrix = [[zero + float(i == j) for j in range(count)] for i in range(count)]
        right = [zero for _ in range(count)]
        for i, equation in enumerate(equations):
            right[i] = sum((weight * over[term] for term, weight in equation.forces.items()), zero)
            for (j, term), weight in equation.masses.items():
                matrix[i][j] = matrix[i][j] + weight * self.of_masses[term]
            matrix[i] += [zero + float(i == j) for j in range(count)]
        for k in range(count):
            size = np.abs(matrix[k][k])
            if not size.min() > NEAREST * size.max() or not np.isfinite(size).all():
                return None
            for i in (i for i in range(count) if i != k):
                share = matrix[i][k] / matrix[k][k]
                matrix[i] = [a - share * b for a, b in zip(matrix[i], matrix[k], strict=True)]
                right[i] = right[i] - share * right[k]
        return [Solved(right[k] / matrix[k][k], matrix[k][count + k] / matrix[k][k]) for k in range(count)]


def thinned(gram: _core.Gram, subset: Sequence[int], costs: Floats) -> Chosen:
    """A subset without features that do not pay, and the weights of the others.

    Args:
        gram: inner products of all features.
        subset: of them.
        costs: of all features, in units of χ².
    """
    kept = list(subset)
    while True:
        solved = gram.least_squares(kept)
        if solved is None:
            kept = kept[:-1]
            continue
        if len(kept) < 2:
            return Chosen(kept, solved[0].tolist())
        tried = []
        for out in kept:
            fewer = gram.least_squares([j for j in kept if j != out])
            if fewer is not None:
                tried.append((fewer[1] - float(costs[out]), out))
        if not tried or not min(tried)[0] < solved[1]:
            return Chosen(kept, solved[0].tolist())
        kept.remove(min(tried)[1])
