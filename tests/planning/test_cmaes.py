"""CMA-ES and its eigenvectors, beside the package `cmaes` and SciPy."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from twinloop import _core
from twinloop._ground.streams import Unit

cmaes = pytest.importorskip("cmaes")


def search(mean, step=0.3, population=32, number=0):
    return _core.CmaEs(mean, step, population, Unit(3).part(number).named("gains"))


def theirs(mean, step=0.3, population=32, seed=0):
    return cmaes.CMA(mean=np.array(mean), sigma=step, population_size=population, seed=seed)


def ellipsoid(x):
    return float((np.logspace(0.0, 4.0, len(x)) * np.square(x)).sum())


def rosenbrock(x):
    return float((100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2).sum())


def valley(x):
    """Flat along a line that no axis is."""
    return abs(float(x.sum())) + 1e-3 * float(np.abs(x).max())


FUNCTIONS = {"ellipsoid": ellipsoid, "rosenbrock": rosenbrock, "valley": valley}


# Eigenvectors


@given(
    st.integers(1, 12).flatmap(
        lambda n: st.lists(st.floats(-5.0, 5.0), min_size=n * n, max_size=n * n).map(
            lambda entries: np.reshape(entries, (n, n))
        )
    )
)
def test_eigenvalues_and_vectors_are_those_of_lapack(entries):
    matrix = 0.5 * (entries + entries.T)
    values, vectors = _core.eigen(matrix)
    size = max(1.0, float(np.abs(matrix).max())) * len(matrix)
    np.testing.assert_allclose(values, scipy.linalg.eigh(matrix, eigvals_only=True), atol=1e-14 * size)
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(len(matrix)), atol=1e-13)
    np.testing.assert_allclose(vectors.T * values @ vectors, matrix, atol=1e-13 * size)


def test_a_matrix_that_is_not_square_is_refused():
    with pytest.raises(ValueError, match="square"):
        _core.eigen(np.ones((2, 3)))


# Beside the package


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize(("dimension", "population"), [(2, 6), (9, 32), (15, 32), (4, 5)])
def test_of_the_same_points_it_learns_what_the_package_learns(name, dimension, population):
    mean, value = np.linspace(-1.0, 0.7, dimension), FUNCTIONS[name]
    ours, known = search(mean, population=population), theirs(mean, population=population)
    for _ in range(40):
        points = np.stack([known.ask() for _ in range(population)])
        values = [value(x) for x in points]
        known.tell(list(zip(points, values, strict=True)))
        ours = ours.tell(points, values)
        scale = float(np.abs(known._C).max())
        np.testing.assert_allclose(ours.mean, known.mean, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(ours.step, known._sigma, rtol=1e-10)
        np.testing.assert_allclose(ours.covariance, known._C, rtol=0.0, atol=1e-10 * scale)


def evaluations(ask_and_tell, value, enough):
    """Points that a search judges until one of them is good enough."""
    for number in range(1, 500):
        values = ask_and_tell(value)
        if min(values) < enough:
            return number
    return 500


def by_ours(number):
    state = [search(np.full(6, 0.5), number=number, population=12)]

    def turn(value):
        points = state[0].ask()
        values = [value(x) for x in points]
        state[0] = state[0].tell(points, values)
        return values

    return turn


def by_theirs(number):
    known = theirs(np.full(6, 0.5), population=12, seed=number)

    def turn(value):
        points = [known.ask() for _ in range(12)]
        values = [value(x) for x in points]
        known.tell(list(zip(points, values, strict=True)))
        return values

    return turn


@pytest.mark.parametrize("value", [ellipsoid, rosenbrock])
def test_it_takes_as_many_generations_as_the_package(value):
    ours, known = (
        np.median([evaluations(way(number), value, 1e-6) for number in range(15)])
        for way in (by_ours, by_theirs)
    )
    assert 0.8 * known <= ours <= 1.2 * known


# Laws


@settings(max_examples=20)
@given(st.integers(0, 1000), st.floats(-50.0, 50.0))
def test_where_the_origin_is_does_not_matter(number, shift):
    here, there = (
        search([0.5, -0.3, 1.0], number=number),
        search(np.array([0.5, -0.3, 1.0]) + shift, number=number),
    )
    for _ in range(15):
        points = here.ask()
        np.testing.assert_allclose(there.ask() - shift, points, atol=1e-9)
        values = [rosenbrock(x) for x in points]
        here, there = here.tell(points, values), there.tell(points + shift, values)


def test_a_search_is_a_value():
    first = search([0.5, 0.5])
    points = first.ask()
    second = first.tell(points, [rosenbrock(x) for x in points])
    assert (first.generation, second.generation) == (0, 1)
    assert first.ask().tobytes() == points.tobytes()
    assert first.mean.tobytes() == np.array([0.5, 0.5]).tobytes()


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="step above 0"):
        search([0.5], step=0.0)
    with pytest.raises(ValueError, match="32 points of 2 numbers"):
        search([0.5, 0.5]).tell(np.zeros((3, 2)), np.zeros(3))
    with pytest.raises(ValueError, match="columns"):
        search([0.5, 0.5]).tell(np.zeros((32, 3)), np.zeros(32))
    with pytest.raises(ValueError, match="purpose"):
        _core.CmaEs([0.5], 0.1, 8, (0, "luck", [0]))
