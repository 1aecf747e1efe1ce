"""A law of which what states do ends, beside the same law told states that were cut by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import rk4
from strategies import program_text
from twinloop import _core
from twinloop.law.ending import ending
from twinloop.records.native import model_record

DT = 0.1
BOUNDS = np.array([[-0.4, -0.7], [0.5, 0.2]])
STATES = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))


def signals(wraps=False):
    return tl.Signals(
        [
            tl.State("angle", "rad", 1.0, periodic=wraps),
            tl.State("rate", "rad/s", 1.0, derivative_of="angle"),
        ],
        [tl.Command("torque", "N m", (-1.0, 1.0))],
        DT,
    )


def spring(known, form="acceleration", **actuation):
    """rate' = torque − 3 angle − rate · angle."""
    lines = ["r4 = r0 * 3.0", "r3 = r2 - r4", "r5 = r1 * r0", "r3 = r3 - r5"]
    return _core.Model(_core.Program.parse(program_text(3, 1, 6, [lines])), form, known.engine, **actuation)


def slope(x, u, cut):
    angle, rate = cut(x)
    return np.array([x[1], u - 3.0 * angle - rate * angle])


@given(STATES, st.floats(-1.0, 1.0))
def test_the_law_is_told_no_state_beyond_its_bounds_but_each_goes_on_from_where_it_is(state, torque):
    def cut(x):
        return np.clip(x, *BOUNDS)

    known = signals()
    found = ending(spring(known), known, BOUNDS).step([state], [[torque]])
    expected = rk4(lambda x: slope(x, torque, cut), np.array(state), DT)
    assert found[0] == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(st.floats(-0.4, 0.5), st.floats(-0.7, 0.2), st.floats(-1.0, 1.0))
def test_inside_the_bounds_it_is_the_law_itself(angle, rate, torque):
    known, wide = signals(), 2.0 * BOUNDS
    law, states, commands = spring(known), [[angle, rate]], [[torque]]
    assert np.array_equal(ending(law, known, wide).step(states, commands), law.step(states, commands))


def test_an_angle_that_wraps_does_not_end():
    known, still = signals(wraps=True), [[0.0]]

    def cut(x):
        # A law sees an angle within half a turn.
        return np.array([x[0], np.clip(x[1], *BOUNDS[:, 1])])

    found = ending(spring(known), known, BOUNDS).step([[1.5, -1.5]], still)
    assert found[0] == pytest.approx(rk4(lambda x: slope(x, 0.0, cut), np.array([1.5, -1.5]), DT), rel=1e-12)


def test_what_stands_before_and_behind_the_law_stays():
    known = signals()
    before = {
        "actuators": [(0.05, 1, 0.25, 0.0)],
        "hidden": [((0,), True, None, 0.3, (), False, 0.0, 0.0, 0.0)],
    }
    lines = ["r5 = r0 * 3.0", "r4 = r2 - r5", "r4 = r4 - r3"]
    law = _core.Model(
        _core.Program.parse(program_text(4, 1, 6, [lines])), "acceleration", known.engine, **before
    )
    law = law.with_levels([[-1.0, 0.0, 1.0]]).with_reports([(0, 2, 1, 1)], [])
    found = model_record(ending(law, known, BOUNDS))
    kept = model_record(law)
    assert {key for key in kept if found[key] != kept[key]} == {"program"}
