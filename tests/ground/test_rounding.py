"""Rounding: found in what was rounded, in any unit, and in nothing that was not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinloop._ground.rounding import count, on_grid


def settling(seed, n, noise, scale=1.0, rests=0.0):
    """A state that goes from 20 to 35 and stays there for a share of the readings."""
    time = np.maximum(0.0, np.linspace(0.0, 1.0 / (1.0 - rests), n))
    noisy = noise * np.random.default_rng(seed).normal(size=n)
    return scale * (20.0 + 15.0 * (1.0 - np.exp(-8.0 * time)) + noisy)


@given(
    seed=st.integers(0, 10_000), n=st.sampled_from([7, 30, 500, 3000, 10_000]),
    noise=st.sampled_from([0.0, 1e-6, 1e-3, 0.05, 5.0]), scale=st.sampled_from([1e-6, 0.3, 1.0, 1e4]),
    rests=st.sampled_from([0.0, 0.5, 0.95]), held=st.integers(1, 3),
)  # fmt: skip
def test_readings_that_were_not_rounded_lie_on_no_grid(seed, n, noise, scale, rests, held):
    readings = np.repeat(settling(seed, n, noise, scale, rests), held)
    assert on_grid(readings) == 0.0 and count([readings]) == 0.0


@given(
    seed=st.integers(0, 10_000), n=st.sampled_from([200, 500, 5000]), noise=st.sampled_from([0.01, 0.05, 0.5]),
    pitch=st.sampled_from([0.01, 1.0 / 32.0, 0.1]), unit=st.sampled_from([1.0, np.pi / 180.0, 1e-6, 1e5]),
    kept=st.sampled_from(["all", "float32", "8 digits"]),
)  # fmt: skip
def test_readings_that_were_rounded_lie_on_a_grid_in_any_unit(seed, n, noise, pitch, unit, kept):
    readings = unit * (pitch * np.round(settling(seed, n, noise, rests=0.5) / pitch))
    if kept == "float32":
        readings = np.float32(readings).astype(np.float64)
    elif kept == "8 digits":
        readings = np.array([float(f"{reading:.8g}") for reading in readings])
    steps = np.diff(np.unique(np.round(readings / (unit * pitch))))
    found = on_grid(readings)
    if steps.min() == 1.0:
        assert found == pytest.approx(unit * pitch, rel=1e-3)
    else:  # the pitch itself did not occur
        assert found == 0.0 or np.isclose(found / (unit * pitch), np.round(found / (unit * pitch)))


def test_a_whole_turn_that_was_added_leaves_a_count_what_it_is():
    counts = 0.01 * np.random.default_rng(0).integers(0, 300, size=400)
    unwrapped = np.where(np.arange(400) % 2, counts + 2.0 * np.pi - 2.0 * np.pi, counts)
    assert len(np.unique(unwrapped)) > len(np.unique(counts))
    assert on_grid(unwrapped) == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("readings", "pitch"),
    [
        ([1.0], 0.0), ([1.0, 2.0], 0.0), ([0.0, 1.0, 3.0], 0.0),  # so few lie on some grid by chance
        ([0.0] * 9 + [2.0] * 9, 2.0), ([0.0, 1.0, 3.0] * 5, 1.0), (np.arange(30.0), 1.0),
        ([0.0, np.nan, 1.0] * 5, 0.0), ([3.0] * 20, 0.0), ([], 0.0),
    ],
)  # fmt: skip
def test_a_grid_is_one_that_readings_would_not_lie_on_by_chance(readings, pitch):
    assert on_grid(np.array(readings)) == pytest.approx(pitch)
