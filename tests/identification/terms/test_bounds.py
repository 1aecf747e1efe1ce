"""Least squares within bounds, beside SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from twinloop import _core
from twinloop.identification.terms.bounds import bounded_solution

QUIET = (0.0, 0.0, 1.0)


def inner_products(seed, features=4, steps=30):
    """Of one increment a period that random features drive."""
    draw = np.random.default_rng(seed)
    values = draw.normal(size=(steps, features)) + draw.normal(size=(steps, 1))
    states = np.cumsum(np.vstack([np.zeros(1), values @ draw.normal(size=(features, 1))]), axis=0)
    states += 0.3 * draw.normal(size=states.shape)
    record = (states, np.ones_like(states), values, values, values)
    return _core.Regression(1, 1.0, "increment", [record]).gram([1.0], QUIET)


@given(st.integers(0, 2**32 - 1), st.data())
def test_it_is_the_least_that_bounds_allow(seed, data):
    gram = inner_products(seed)
    free, covariance, least = gram.solve(range(4))
    low, high = np.full(4, -np.inf), np.full(4, np.inf)
    for i in data.draw(st.sets(st.integers(0, 3))):
        low[i], high[i] = sorted(data.draw(st.tuples(*[st.floats(-3.0, 3.0)] * 2)))
        high[i] += 1e-3
    limits = {i: (float(a), float(b)) for i, (a, b) in enumerate(zip(low, high, strict=True)) if a > -np.inf}
    weights, left = bounded_solution(gram.solve(range(4)), range(4), limits)
    assert all(a <= weights[i] <= b for i, (a, b) in limits.items())
    # χ² is what the free fit leaves, and a paraboloid about it.
    root = np.linalg.cholesky(np.linalg.inv(covariance)).T
    expected = lsq_linear(root, root @ free, (low, high), method="bvls", tol=1e-14)
    assert left == pytest.approx(least + 2.0 * expected.cost, rel=1e-6, abs=1e-9)
    off = root @ (weights - expected.x)
    assert np.abs(off).max() < 1e-4 * (1.0 + np.sqrt(expected.cost))


def test_it_is_that_too_where_sweeps_over_the_bounds_would_not_end():
    gram = inner_products(3526)
    free, covariance, least = gram.solve(range(4))
    root = np.linalg.cholesky(np.linalg.inv(covariance)).T
    low, high = np.array([0.0, 0.0, 0.0, -np.inf]), np.array([1e-3, 1e-3, 1e-3, np.inf])
    expected = lsq_linear(root, root @ free, (low, high), method="trf", tol=1e-14)
    weights, left = bounded_solution(gram.solve(range(4)), range(4), dict.fromkeys(range(3), (0.0, 1e-3)))
    assert left == pytest.approx(least + 2.0 * expected.cost, rel=1e-9)
    np.testing.assert_allclose(weights, expected.x, atol=1e-9)


def test_bounds_that_do_not_bind_change_no_bit():
    gram = inner_products(3)
    free, _, left = gram.solve([0, 2])
    weights, other = bounded_solution(
        gram.solve([0, 2]), [0, 2], {0: (-1e3, 1e3), 2: (-1e3, 1e3), 3: (5.0, 6.0)}
    )
    assert weights.tobytes() == free.tobytes() and other == left
