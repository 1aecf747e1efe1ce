"""Whether a model follows flights whose commands were sent in pulses, by a relay or a valve that is open or shut."""

from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.campaign.data.sent import in_pulses, other_commands
from twinloop.campaign.identify_and_plan.following import in_pieces

DT, STEPS = 0.02, 250
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 5.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-10.0, 10.0), scale=1.0)],
    DT,
)
STANDS = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 60.0), "angle.ki": (0.0, 9.0), "angle.kd": (0.0, 20.0)},
).bind(SIGNALS)


def model(push):
    """rate' = 16 angle + push torque, which falls over by itself in a quarter of a second."""
    lines = ["r3 = r0 * 16.0", f"r4 = r2 * {push!r}", "r3 = r3 + r4"]
    return _core.Model(_core.Program.parse(program_text(3, 1, 5, [lines])), "acceleration", SIGNALS.engine)


def flown(send, noise=1e-4):
    """A flight of the model with push 1, whose loop sends what `send` makes of each command."""
    controller, random = (
        STANDS.controller(STANDS.genes({"angle.kp": 40.0, "angle.ki": 0.0, "angle.kd": 8.0})),
        np.random.default_rng(0),
    )
    controller.reset()
    x, states, sent = np.array([0.2, 0.0]), [np.array([0.2, 0.0])], []
    for _ in range(STEPS):
        u = send(float(controller.command(states[-1], np.zeros(2))[0]))
        for _ in range(40):
            middle = x + 0.5 * DT / 40 * np.array([x[1], 16.0 * x[0] + u])
            x = x + DT / 40 * np.array([middle[1], 16.0 * middle[0] + u])
        states.append(x + noise * random.standard_normal(2))
        sent.append([float(u)])
    test = tl.Test(STANDS, controller.genes, [0.2, 0.0], [0.0, 0.0], STEPS)
    run = tl.Trajectory(DT * np.arange(STEPS + 1), np.array(states), np.array(sent))
    return SimpleNamespace(test=test, number=0, trajectory=run)


def relay():
    """Sends 10 or -10, whichever leaves less that is owed."""
    owed = [0.0]

    def send(wanted):
        owed[0] += wanted
        pulse = 10.0 if owed[0] > 0.0 else -10.0
        owed[0] -= pulse
        return pulse

    return send


def test_pulses_are_no_commands_of_another_controller():
    flight = flown(relay())
    assert set(flight.trajectory.commands.ravel()) == {-10.0, 10.0}
    assert in_pulses([flight]) == [0] and other_commands([flight]) == []


def test_pulses_of_the_wrong_sign_are():
    flight = flown(relay())
    run = flight.trajectory
    wrong = tl.Trajectory(run.t, run.states, -run.commands)
    other = SimpleNamespace(test=flight.test, number=0, trajectory=wrong)
    assert in_pulses([other]) == [] and other_commands([other]) == [0]


def test_what_a_controller_gives_is_neither():
    flight = flown(lambda wanted: wanted)
    assert in_pulses([flight]) == [] and other_commands([flight]) == []


def test_a_model_that_is_right_follows_pulses_piece_by_piece():
    flight, limits, workers = flown(relay()), Limits(SIGNALS), _core.Workers(1)
    (right,) = in_pieces(model(1.0), [flight], limits, workers)
    (weak,) = in_pieces(model(0.2), [flight], limits, workers)
    (turned,) = in_pieces(model(-1.0), [flight], limits, workers)
    assert right < 0.1 < 0.5 < weak < turned
    # By the recorded commands alone it falls over, like any other.
    whole = tl.Replay(SIGNALS, flight.trajectory.states[0], flight.trajectory.commands)
    free = _core.replay(model(1.0), limits.engine, whole.initial_state, whole.commands)
    off = np.square(
        np.asarray(free.read)[0][: int(free.lasted[0]) + 1]
        - flight.trajectory.states[: int(free.lasted[0]) + 1]
    )
    assert free.lasted[0] < STEPS or off.mean() > 1.0


def test_a_pendulum_under_its_own_controller_has_no_pulses(new_campaign, pendulum):
    campaign = new_campaign()
    test = campaign.test(PENDULUM_GAINS)
    run = pendulum.run(test)
    assert in_pulses([SimpleNamespace(test=test, number=0, trajectory=run)]) == []
    assert run.steps == pytest.approx(20)
