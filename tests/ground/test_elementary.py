"""Elementary functions of the engine, beside NumPy's."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from twinloop._ground.elementary import cos, exp, log, power, product, sin, tanh


@given(st.lists(st.floats(1e-300, 1e300), min_size=1, max_size=20))
def test_logarithms_and_exponentials_are_those_of_numpy_but_for_the_last_bit(values):
    np.testing.assert_allclose(log(values), np.log(values), rtol=4e-16, atol=1e-300)
    small = np.clip(log(values), -700.0, 700.0)
    np.testing.assert_allclose(exp(small), np.exp(small), rtol=4e-16)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_sines_are_those_of_numpy_but_for_the_last_bit(values):
    np.testing.assert_allclose(sin(values), np.sin(values), rtol=4e-16, atol=1e-300)
    np.testing.assert_allclose(cos(values), np.cos(values), rtol=4e-16, atol=1e-300)
    np.testing.assert_allclose(tanh(values), np.tanh(values), rtol=4e-16)


@given(st.floats(1e-3, 1e3), st.floats(-5.0, 5.0))
def test_powers_are_those_of_python_but_for_the_last_bit(x, y):
    np.testing.assert_allclose(power(x, y), x**y, rtol=4e-16)


def test_shapes_are_kept_and_a_number_stays_one():
    assert exp(np.zeros((2, 3, 4))).shape == (2, 3, 4)
    assert float(log(1.0)) == 0.0


@given(st.integers(0, 5), st.integers(0, 5), st.integers(0, 5), st.integers(0, 2**32 - 1))
def test_products_of_matrices_are_those_of_numpy_but_for_the_last_bits(n, k, m, seed):
    left, right = (
        np.random.default_rng(seed + i).normal(size=size) for i, size in enumerate(((n, k), (k, m)))
    )
    np.testing.assert_allclose(product(left, right), left @ right, rtol=1e-13, atol=1e-13)
