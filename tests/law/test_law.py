"""Expressions, what is multiplied out of them, and laws: each against the program that they came from."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import twinloop as tl
from oracles import registers_of, run_program, same_bits
from strategies import exact_programs, program_text, programs, rows
from twinloop import _core
from twinloop.law.actuation import HiddenState
from twinloop.law.expansion import MOST_TERMS, Expansion, written
from twinloop.law.expressions import Expressions, Node
from twinloop.law.law import Law


@given(st.data())
def test_a_program_made_of_the_nodes_of_another_computes_the_same_bits(data):
    program = data.draw(exact_programs(inputs=3, outputs=2))
    inputs = data.draw(rows(3, size=50.0))
    assume(all(np.isfinite(bank).all() for bank in registers_of(program.effective(), inputs)))
    expressions = Expressions()
    again = expressions.program(expressions.entered(program), 3)
    np.testing.assert_array_equal(again.run(inputs), program.run(inputs))


@settings(deadline=None)
@given(st.data())
def test_what_is_multiplied_out_computes_the_same(data):
    program = data.draw(programs(inputs=3, outputs=2))
    inputs = np.random.default_rng(0).uniform(-2.0, 2.0, (10, 3))
    with np.errstate(all="ignore"):
        assume(all((np.abs(bank) < 100.0).all() for bank in registers_of(program.effective(), inputs)))
    for number, (name, _, _, second) in enumerate(program.effective().instructions):
        divided = name == "/" and isinstance(second, int)
        before = list(registers_of(program.effective(), inputs))[number]
        assume(not (divided and (np.abs(before[second]) < 1e-2).any()))
    source, target = Expressions(), Expressions()
    expansion = Expansion(source, target)
    roots = [written(target, expansion[node]) for node in source.entered(program)]
    found = target.program(roots, 3).run(inputs)
    np.testing.assert_allclose(found, run_program(program, inputs), rtol=1e-9, atol=1e-9)


def test_equal_expressions_are_one_node_and_operands_come_first():
    store = Expressions()
    x, y = store.input(0), store.input(1)
    assert store.add("*", x, y) == store.add("*", y, x) and store.add("-", x, y) != store.add("-", y, x)
    assert store.constant(0.0) == store.constant(-0.0) and store.constant(2.0) != store.power(x, 2)
    product = store.add("*", store.add("+", x, y), store.constant(2.0))
    assert store.needed([product]) == sorted(store.needed([product]))
    assert all(max(store[number].operands, default=-1) < number for number in range(len(store)))


def test_an_instruction_may_hold_a_constant_in_front():
    store = Expressions()
    two = store.constant(2.0)
    roots = [
        store.enter(Node("-", (two, store.input(0)))),
        store.enter(Node("/", (two, store.input(0)))),
        two,
    ]
    inputs = np.array([[4.0], [0.5]])
    np.testing.assert_array_equal(store.program(roots, 1).run(inputs), [[-2.0, 0.5, 2.0], [1.5, 4.0, 2.0]])


def test_long_products_stay_products():
    store, target = Expressions(), Expressions()
    total = store.input(0)
    for place in range(1, 8):
        total = store.add("+", total, store.input(place))
    cube = store.add("*", store.add("*", total, total), total)
    found = Expansion(store, target)[cube]
    assert len(found) <= MOST_TERMS
    inputs = np.random.default_rng(1).normal(size=(5, 8))
    values = target.program([written(target, found)], 8).run(inputs)[:, 0]
    np.testing.assert_allclose(values, inputs.sum(axis=1) ** 3, rtol=1e-12)


def test_what_overflows_when_it_is_multiplied_out_stays_as_it_is():
    store, target = Expressions(), Expressions()
    small = store.add("*", store.input(0), store.constant(1e-200))
    large = store.add("*", store.add("*", small, store.constant(1e200)), store.constant(1e200))
    square = store.add("*", large, large)
    node = written(target, Expansion(store, target)[square])
    assert target.program([node], 1).run([[1e-150]])[0, 0] == np.float64(1e-150 * 1e200) ** 2


BODY = tl.Signals(
    states=[tl.State(name, "rad", 1.0) for name in ("roll", "pitch", "yaw")]
    + [tl.State(name, "rad/s", 1.0) for name in ("p", "q", "r")],
    commands=[tl.Command("torque", "N m", (-2.0, 2.0))],
    dt=0.05,
    kinematics=tl.RigidBody(("roll", "pitch", "yaw"), ("p", "q", "r")),
)


def test_a_law_gives_its_model_back():
    program = _core.Program.parse(
        program_text(8, 3, 12, [["r8 = r6 * 2.0", "r9 = r7 * r3", "r10 = sin(r0)"]])
    )
    hidden = [((0,), True, None, 2.0, (), False, 0.0, 0.0, 0.0)]
    late = (0.01, 0.0, 0.0, 0.0, 0.0, 0.0)
    model = _core.Model(program, "acceleration", BODY.engine, [(0.04, 2, 0.5, 0.0)], hidden, late)
    law = Law.of(model, BODY)
    again = law.model()
    assert (again.form, again.actuators, again.hidden) == (model.form, model.actuators, model.hidden)
    assert law.offsets == late and again.offsets == model.offsets == list(late)
    rng = np.random.default_rng(0)
    states, commands = rng.normal(size=(9, 6)), rng.normal(size=(9, 1))
    assert same_bits(again.step(states, commands), model.step(states, commands))
    assert law.actuation.actuators[0].lag == 0.04 and law.actuation.hidden[0].time == 2.0
    assert law.symbols[6:] == ("torque_scaled", "hidden")


@pytest.mark.parametrize(
    ("place", "commands", "acts"),
    [(0, (), False), (1, (), True), (2, (0,), True), (2, (), False)],
    ids=["a state", "a command", "what it fills", "what a state fills"],
)
def test_whether_a_command_acts_in_a_law(place, commands, acts):
    signals = tl.Signals([tl.State("level", "m", 1.0)], [tl.Command("pump", "1", (0.0, 1.0))], 0.1)
    store = Expressions()
    output = store.add("*", store.input(place), store.constant(2.0))
    hidden = HiddenState(commands, False, 0.0, 0.5, states=() if commands else (0,))
    law = Law(signals, "acceleration", store, (output,), SimpleNamespace(hidden=(hidden,)), (0.0,))
    assert law.commanded is acts
