"""Coupled equations: solved together as NumPy solves them, and written from their columns."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinloop.identification.search.coupled import CoupledTerms, Equation, MassTerm

FORCES, MASSES = [0, 1, 2], [0, 5]


@pytest.fixture
def terms():
    values = {node: np.random.default_rng(node).uniform(-1.0, 1.0, (3, 20)) for node in (*FORCES, *MASSES)}
    problem = SimpleNamespace(values=lambda nodes: np.stack([values[node] for node in nodes], axis=2))
    return CoupledTerms(problem, FORCES, MASSES)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_accelerations_are_those_of_numpy_and_answer_by_the_inverse_of_the_masses(terms, count):
    stream = np.random.default_rng(count)
    equations = [
        Equation(
            {node: stream.normal() for node in FORCES},
            {MassTerm(j, term): 0.2 * stream.uniform(-1.0, 1.0) for j in range(count) for term in MASSES},
        )
        for _ in range(count)
    ]
    of_forces = {node: terms.of_forces[:, :, i] for i, node in enumerate(FORCES)}
    matrix, right = np.zeros((3, 20, count, count)) + np.eye(count), np.zeros((3, 20, count, 1))
    for i, equation in enumerate(equations):
        for (j, term), weight in equation.masses.items():
            matrix[:, :, i, j] += weight * terms.of_masses[term]
        right[:, :, i, 0] = sum(weight * of_forces[node] for node, weight in equation.forces.items())
    solved, inverse = np.linalg.solve(matrix, right), np.linalg.inv(matrix)
    for i, (acceleration, answer) in enumerate(terms.solved(equations)):
        assert np.allclose(acceleration, solved[:, :, i, 0], atol=1e-12)
        assert np.allclose(answer, inverse[:, :, i, i], atol=1e-12)


def test_without_a_mass_there_is_no_acceleration(terms):
    nothing = Equation({0: 1.0}, {MassTerm(0, 0): -1.0 / float(terms.of_masses[0][0, 0])})
    assert terms.solved([nothing]) is None


def test_columns_times_weights_are_an_equation(terms):
    masses = [MassTerm(1, 0), MassTerm(0, 5)]
    equation = terms.equation([1, 4], np.array([2.0, 3.0]), masses)
    assert equation == Equation({1: 2.0}, {MassTerm(0, 5): 3.0})
    assert equation.of_joint(0) == {5: 3.0} and equation.of_joint(1) == {}
    accelerations = [np.full((3, 20), 2.0), np.full((3, 20), 7.0)]
    columns = terms.columns(masses, accelerations)
    assert np.array_equal(columns[:, :, :3], terms.of_forces)
    assert np.array_equal(columns[:, :, 3], -7.0 * terms.of_masses[0])
    assert terms.share_a_mass(0, [0, 3], masses) and not terms.share_a_mass(0, [0, 4], masses)


def test_a_joints_own_mass_depends_on_what_is_allowed_alone(terms):
    masses = [MassTerm(0, 0), MassTerm(0, 5), MassTerm(1, 5)]
    costs = np.ones(len(FORCES) + len(masses))
    limited = terms.with_own_mass_of([5], 0, costs, masses)
    assert limited.tolist() == [1.0, 1.0, 1.0, np.inf, 1.0, 1.0]
    assert np.all(costs == 1.0)
