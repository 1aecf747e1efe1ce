"""What a twin says of where its flights were: in its equations, and when a simulation goes far beyond."""

import warnings

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop.law.flown import far_beyond, spans

SIGNALS = tl.Signals(
    states=[tl.State("x", "m", 5.0), tl.State("turn", "rad", 3.0, periodic=True)],
    commands=[tl.Command("u", "m/s", (-1.0, 1.0))],
    dt=0.1,
)


def twin(*flights):
    """Of x' = u, whose second state stays."""
    program = _core.Program.parse(program_text(3, 2, 5, [["r3 = r2 + 0.0"], ["r4 = r1 - r1"]]))
    return tl.Twin(_core.Model(program, "acceleration", SIGNALS.engine), SIGNALS, flights=flights)


def flight(*places):
    states = np.column_stack([places, np.linspace(-3.0, 3.0, len(places))])
    return tl.Trajectory(0.1 * np.arange(len(places)), states, np.zeros((len(places) - 1, 1)))


def test_the_span_is_that_of_all_readings_and_of_states_that_have_ends():
    [span] = twin(flight(0.0, 0.4, 0.2), flight(-0.1, 0.0)).flown
    assert (span.state, span.unit, span.low, span.high) == ("x", "m", -0.1, 0.4)
    assert twin().flown == ()


def test_the_legend_says_where_the_law_was_learnt():
    assert (
        "# flown: x from -0.1 to 0.4 m; beyond, the law is extrapolated"
        in twin(flight(-0.1, 0.4)).equations()
    )
    assert "flown" not in twin().equations()


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (0.45, None),
        (0.89, None),
        (0.91, "takes x to 0.91 m, and the flights went from -0.1 to 0.4"),
        (-0.7, "takes x to -0.7 m"),
    ],
)
def test_a_simulation_that_goes_far_beyond_is_said(end, said):
    known, steps = twin(flight(-0.1, 0.4)), 10
    commands = np.full((steps, 1), (end - 0.2) / (0.1 * steps))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = known.simulate_commands([0.2, 0.0], commands)
    assert run.states[-1, 0] == pytest.approx(end)
    assert [issubclass(w.category, tl.RemarkWarning) and said in str(w.message) for w in caught] == [
        True
    ] * bool(said)
    # The user's own line is named.
    assert all(w.filename == __file__ for w in caught)


def test_a_test_that_goes_far_beyond_is_said_and_a_flight_beside_the_twin_is_not():
    known, gains = twin(flight(0.0, 0.1)), {"x.kp": (1.0, 5.0), "x.ki": 0.0, "x.kd": 0.0}
    family = tl.controllers.PID([("x", None)], gains).bind(SIGNALS)
    test = tl.Test(family, family.genes({"x.kp": 5.0}), np.zeros(2), np.array([1.0, 0.0]), 20)
    with pytest.warns(tl.RemarkWarning, match=r"x to 1 m, and the flights went from 0 to 0\.1"):
        run = known.simulate(test)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        known.free_run(test, run)
        twin(run).simulate(test)


def test_one_state_is_said_once_however_often_it_leaves():
    found = list(far_beyond(spans(SIGNALS, [flight(0.0, 1.0)]), flight(0.0, -1.5, 2.4, 0.0, 2.5), SIGNALS))
    assert [(each.code, each.serious) for each in found] == [("beyond-flown", True)]
    # By the value that is furthest beyond, on either side.
    assert "x to -1.5 m" in found[0].sentence


def test_an_environment_does_not_repeat_it_at_every_step():
    pytest.importorskip("gymnasium")
    world = twin(flight(0.0, 0.1)).env([0.0, 0.0], [1.0, 0.0], 50)
    with warnings.catch_warnings():
        warnings.simplefilter("error", tl.RemarkWarning)
        world.reset(seed=1)
        for _ in range(20):
            world.step([1.0])
