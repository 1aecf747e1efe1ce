"""What models and tests are judged by, against the definitions of the specification's section 3."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import twinloop as tl
from twinloop import objectives

distances = hnp.arrays(
    np.float64,
    st.tuples(st.integers(1, 12), st.integers(1, 5)),
    elements=st.one_of(st.floats(0.0, 10.0), st.just(math.inf), st.just(3.0)),
)


@given(distances, st.sampled_from([0.5, 3.0, 100.0]))
def test_discrimination_is_the_inverse_of_the_capped_variance_over_models(found, cap):
    expected = 1.0 / (np.minimum(found, cap).var(axis=0) + 1e-9)
    np.testing.assert_allclose(objectives.discrimination(found, cap), expected, rtol=1e-6)


@given(distances, st.sampled_from([0.5, 3.0, 100.0]))
def test_instability_is_the_variance_over_mutants_and_cap_squared_for_those_at_the_cap(found, cap):
    expected = []
    for column in found.T:
        below = column[column < cap]
        spread = ((below - below.mean()) ** 2).sum() if below.size else 0.0
        expected.append((spread + cap**2 * (column.size - below.size)) / column.size)
    np.testing.assert_allclose(objectives.instability(found, cap), expected, rtol=1e-9, atol=1e-12)


def test_one_diverging_model_does_not_make_a_test_discriminating_without_end():
    diverged, capped = [[0.5], [0.6], [math.inf]], [[0.5], [0.6], [3.0]]
    assert objectives.discrimination(diverged, 3.0)[0] == objectives.discrimination(capped, 3.0)[0]


def test_a_test_whose_mutants_all_diverge_is_not_stable():
    found = objectives.instability([[math.inf, 1.0]] * 4, 3.0)
    assert found.tolist() == [9.0, 0.0]


def test_the_guard_keeps_agreement_finite():
    assert objectives.discrimination([[0.7]] * 5, 3.0)[0] == pytest.approx(1e9)


@pytest.mark.parametrize("cap", [0.0, -1.0, math.nan, math.inf, "three"])
@pytest.mark.parametrize("objective", [objectives.discrimination, objectives.instability])
def test_a_cap_that_is_no_distance_is_refused(objective, cap):
    with pytest.raises(tl.InvalidInput, match="expected a finite number above 0"):
        objective([[1.0], [2.0]], cap)


@pytest.mark.parametrize("objective", [objectives.discrimination, objectives.instability])
def test_distances_that_are_none_are_refused(objective):
    with pytest.raises(tl.InvalidInput, match="expected finite numbers, found nan"):
        objective([[1.0], [math.nan]], 3.0)
    with pytest.raises(tl.InvalidInput, match="expected the shape"):
        objective([1.0, 2.0], 3.0)


@pytest.mark.parametrize("objective", [objectives.discrimination, objectives.instability])
def test_distances_on_no_model_are_refused(objective):
    with pytest.raises(tl.InvalidInput, match="at least one row"):
        objective(np.zeros((0, 5)), 3.0)


def test_the_frozen_error_is_that_of_a_model_that_never_moves():
    states = np.random.default_rng(0).normal(size=(8, 3))
    run = tl.Trajectory(np.arange(8) * 0.1, states, np.zeros((7, 1)))
    assert objectives.frozen_error(run) == pytest.approx(np.mean((states[1:] - states[0]) ** 2))
    with pytest.raises(tl.InvalidInput, match="at least one step"):
        objectives.frozen_error(tl.Trajectory([0.0], states[:1], np.zeros((0, 1))))


def test_the_normalised_error_of_standing_still_is_one():
    assert objectives.normalised_error(0.4, 0.4) == 1.0
    assert objectives.normalised_error(0.1, 0.4) == 0.25
    assert objectives.normalised_error(0.0, 0.0) == 1.0
    assert objectives.normalised_error(0.1, 0.0) == math.inf


def test_selected_tests_need_a_trajectory_each(first_test, quadrotor):
    run = quadrotor.run(first_test)
    assert len(objectives.selected_tests([first_test, first_test], [run, run])) == 2
    for tests, runs in (([], []), ([first_test], []), ([first_test], [run, run])):
        with pytest.raises(tl.InvalidInput, match="expected a trajectory for each"):
            objectives.selected_tests(tests, runs)


def test_the_true_dynamics_would_have_no_error(first_test, quadrotor):
    """The recorded run, replayed by the loop that made it, ends where it ended."""
    run = quadrotor.run(first_test)
    assert np.mean((quadrotor.dynamics.step(run.states[:-1], run.commands) - run.states[1:]) ** 2) == 0.0
