"""Signals: which states are learnt, how angles wrap, and what the engine is told of scales, derivatives and bodies."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import same_bits
from strategies import program_text
from twinloop import _core
from twinloop.signals import TURNS, ordered

COMMAND = tl.Command("u", "N", (-4.0, 2.0))
finite = st.floats(-50.0, 50.0)


def state(name, of=None, **changes):
    return tl.State(name, "1", 1.0, derivative_of=of, **changes)


def constant(known, *rates):
    """A model whose outputs are constants, whatever states and commands are."""
    first = known.n_x + known.n_u
    lines = []
    for register, rate in enumerate(rates, start=first):
        lines += [f"r{register} = r0 * 0.0", f"r{register} = r{register} + {rate!r}"]
    text = program_text(first, len(rates), first + len(rates), [lines])
    return _core.Model(_core.Program.parse(text), "acceleration", known.engine)


@st.composite
def chains(draw):
    """Lengths of chains of derivatives, and the order in which their states are declared."""
    lengths = draw(st.lists(st.integers(1, 3), min_size=1, max_size=3))
    names = [(chain, place) for chain, length in enumerate(lengths) for place in range(length)]
    return lengths, draw(st.permutations(names))


@given(chains())
def test_what_is_learnt_is_the_highest_derivative_of_each_chain(chained):
    lengths, order = chained
    states = [state(f"s{c}{p}", f"s{c}{p - 1}" if p else None) for c, p in order]
    known = tl.Signals(states, [COMMAND], 0.1)
    assert [order[i] for i in known.driven] == [(c, p) for c, p in order if p == lengths[c] - 1]
    assert known.state_names == tuple(f"s{c}{p}" for c, p in order) and known.n_x == len(order)


@given(chains())
def test_each_chain_moves_as_its_highest_derivative_says_in_whatever_order_it_was_declared(chained):
    lengths, order = chained
    states = [state(f"s{c}{p}", f"s{c}{p - 1}" if p else None) for c, p in order]
    known = tl.Signals(states, [COMMAND], 0.1)
    rates = [1.0 + order[i][0] for i in known.driven]
    (after,) = constant(known, *rates).step(np.zeros((1, known.n_x)), np.zeros((1, 1)))
    # From rest under a constant of the chain: t, t²/2, t³/6 from the highest derivative down.
    for i, (chain, place) in enumerate(order):
        above = lengths[chain] - place
        assert after[i] == pytest.approx((1.0 + chain) * 0.1**above / math.factorial(above), rel=1e-12)


def test_a_rigid_body_turns_the_angles_that_were_named_wherever_they_stand():
    names = ["q", "yaw", "height", "roll", "r", "pitch", "p"]
    body = tl.RigidBody(angles=("roll", "pitch", "yaw"), rates=("p", "q", "r"))
    units = {**dict.fromkeys(body.angles, "rad"), **dict.fromkeys(body.rates, "rad/s"), "height": "m"}
    known = tl.Signals([tl.State(name, units[name], 10.0) for name in names], [COMMAND], 0.1, kinematics=body)
    assert [names[i] for i in known.driven] == ["q", "height", "r", "p"]
    still = constant(known, 0.0, 0.0, 0.0, 0.0)
    for rate, angle in (("p", "roll"), ("q", "pitch"), ("r", "yaw")):
        (after,) = still.step([[0.7 if name == rate else 0.0 for name in names]], [[0.0]])
        moved = {name: value for name, value in zip(names, after, strict=True) if abs(value) > 1e-9}
        assert moved == {rate: 0.7, angle: pytest.approx(0.07, rel=1e-6)}


def test_a_model_sees_commands_in_their_scale_which_is_the_larger_bound_where_none_is_given():
    known = tl.Signals([state("x")], [COMMAND, tl.Command("v", "N", (0.0, 300.0), scale=50.0)], 0.1)
    assert [command.size for command in known.commands] == [4.0, 50.0]
    lines = ["r3 = r1 + r2"]
    model = _core.Model(_core.Program.parse(program_text(3, 1, 4, [lines])), "increment", known.engine)
    assert model.step([[0.0]], [[2.0, 25.0]]).tolist() == [[1.0]]


@pytest.mark.parametrize(
    ("periodic", "period"), [(True, 2.0 * math.pi), (False, None), (360.0, 360.0), (90, 90.0)]
)
def test_an_angle_wraps_after_a_turn_or_after_the_period_that_is_given(periodic, period):
    assert tl.State("a", "rad", 1.0, periodic=periodic).period == period


@pytest.mark.parametrize(
    ("envelope", "periodic", "kept"),
    [
        ((-180.0, 180.0), 360.0, None),
        ((0.0, 720.0), 360.0, None),
        ((-1.0, 5.0), 360.0, (-1.0, 5.0)),
        ((-180.0, 180.0), False, (-180.0, 180.0)),
    ],
)
def test_an_envelope_of_a_whole_turn_bounds_no_angle_that_wraps(envelope, periodic, kept):
    assert tl.State("a", "deg", 60.0, envelope=envelope, periodic=periodic).envelope == kept


def test_a_whole_turn_may_be_written_with_two_decimals():
    assert tl.State("a", "rad", 1.0, envelope=(-3.14, 3.14), periodic=True).envelope is None
    assert tl.State("a", "rad", 1.0, envelope=(-3.0, 3.0), periodic=True).envelope == (-3.0, 3.0)


PERIODIC = tl.Signals([state("a", periodic=360.0), state("x"), state("b", periodic=5.0)], [COMMAND], 0.1)
PERIODS = {0: 360.0, 2: 5.0}


@given(st.lists(st.tuples(st.floats(-2000.0, 2000.0), finite, finite, finite), min_size=1, max_size=8))
def test_states_as_a_model_sees_them_lie_within_half_a_period_and_whole_periods_away(rows):
    states = np.array(rows)
    before = states.copy()
    seen = PERIODIC.wrapped(states)
    assert same_bits(states, before)
    assert same_bits(seen[:, [1, 3]], states[:, [1, 3]])
    for i, period in PERIODS.items():
        turns = (states[:, i] - seen[:, i]) / period
        assert np.abs(seen[:, i]).max() <= period / 2 * (1.0 + 1e-12)
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)


@given(st.lists(st.tuples(st.integers(-900, 900), finite, st.integers(-12, 12)), min_size=1, max_size=12))
def test_readings_that_go_on_are_those_that_numpy_unwraps(rows):
    # Off the grid by a third, so that no step is exactly half a period.
    states = np.array(rows) + np.arange(len(rows))[:, np.newaxis] / 3.0
    start = np.array([10.0, 0.0, 1.0])
    found = PERIODIC.continued(states, start)
    assert same_bits(found[:, 1], states[:, 1])
    for i, period in PERIODS.items():
        expected = np.unwrap([start[i], *states[:, i]], period=period)[1:]
        np.testing.assert_allclose(found[:, i], expected, rtol=0.0, atol=1e-9)


def test_signals_without_an_angle_that_wraps_leave_readings_alone():
    plain = tl.Signals([state("x"), state("v", "x")], [COMMAND], 0.1)
    states = np.array([[400.0, 1.0], [-400.0, 2.0]])
    assert plain.continued(states, states[0]) is states
    assert same_bits(plain.wrapped(states), states) and same_bits(plain.difference(states, 1.0), states - 1.0)


@given(finite, finite)
def test_bounds_are_two_numbers_in_order(low, high):
    if low < high:
        assert ordered("Bounds", [low, high]) == (low, high)
    else:
        with pytest.raises(tl.InvalidInput, match="low < high"):
            ordered("Bounds", (low, high))


def test_the_nearest_name_is_offered_where_a_derivative_or_a_body_names_no_state():
    with pytest.raises(tl.InvalidInput, match="did you mean 'angle'"):
        tl.Signals([state("angle"), state("rate", "angel")], [COMMAND], 0.1)
    body = tl.RigidBody(angles=("roll", "pitch", "yaw"), rates=("p", "q", "r"))
    with pytest.raises(tl.InvalidInput, match="did you mean 'rolls'"):
        tl.Signals(
            [state(name) for name in ("rolls", "pitch", "yaw", "p", "q", "r")],
            [COMMAND],
            0.1,
            kinematics=body,
        )


@pytest.mark.parametrize(("angle", "rate"), [("deg", "rad/s"), ("rad", "deg/s")])
def test_a_rate_is_not_declared_in_another_unit_than_its_angle(angle, rate):
    command = tl.Command("u", "N m", (-1.0, 1.0))
    states = [tl.State("tilt", angle, 1.0), tl.State("turn", rate, 1.0, derivative_of="tilt")]
    with pytest.raises(
        tl.InvalidInput, match=rf"'turn' in {angle}/s, the derivative of 'tilt' in {angle}, found"
    ):
        tl.Signals(states, [command], 0.01)
    tl.Signals([states[0], tl.State("turn", f"{angle}/s", 1.0, derivative_of="tilt")], [command], 0.01)


@pytest.mark.parametrize(
    ("angle", "rate", "found"),
    [
        (
            "deg",
            "deg/s",
            "found roll in deg, pitch in deg, yaw in deg, p in deg/s, q in deg/s, r in deg/s; declare",
        ),
        ("rad", "deg/s", "found p in deg/s, q in deg/s, r in deg/s; declare"),
        ("rad", "rpm", "found p in rpm, q in rpm, r in rpm; declare"),
    ],
)
def test_a_rigid_body_is_declared_in_radians_as_its_kinematics_are_known_in_no_other_unit(angle, rate, found):
    names = ("roll", "pitch", "yaw", "p", "q", "r")

    def declared(angle, rate):
        units = (angle, angle, angle, rate, rate, rate)
        states = [tl.State(name, unit, 90.0) for name, unit in zip(names, units, strict=True)]
        return tl.Signals(states, [COMMAND], 0.01, kinematics=tl.RigidBody(names[:3], names[3:]))

    with pytest.raises(tl.InvalidInput, match=found):
        declared(angle, rate)
    with pytest.raises(tl.InvalidInput, match="expected roll, pitch, yaw in rad and p, q, r in rad/s"):
        declared(angle, rate)
    assert declared("rad", "rad/s").driven == (3, 4, 5)


def test_an_angle_that_a_body_turns_has_no_derivative_besides_and_it_is_said_where_to_remove_it():
    names = ("roll", "pitch", "yaw", "p", "q", "r")
    states = [state(name, {"p": "roll"}.get(name)) for name in names]
    with pytest.raises(tl.InvalidInput, match="remove `derivative_of` from 'p'"):
        tl.Signals(states, [COMMAND], 0.1, kinematics=tl.RigidBody(names[:3], names[3:]))


@pytest.mark.parametrize("unit", ["deg", "°", "degree", "degrees"])
def test_degrees_are_degrees_however_they_are_written(unit):
    heading = tl.State("heading", unit, 180.0)
    assert TURNS[unit] == 360.0
    with pytest.raises(tl.InvalidInput, match="declare both in the unit that the log has"):
        tl.Signals(
            [heading, tl.State("rate", "rad/s", 1.0, derivative_of="heading")],
            [tl.Command("rudder", "1", (-1.0, 1.0))],
            0.1,
        )


def test_names_that_python_takes_for_one_are_refused():
    with pytest.raises(tl.InvalidInput, match="expected names that differ, found 'fi' twice"):
        tl.Signals(
            [tl.State("\N{LATIN SMALL LIGATURE FI}", "1", 1.0), tl.State("fi", "1", 1.0)],
            [tl.Command("u", "1", (-1.0, 1.0))],
            0.1,
        )
