"""States of which a law says that nothing moves them, though they move."""

from types import SimpleNamespace

import numpy as np

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop.campaign.identify_and_plan import unmoved
from twinloop.campaign.identify_and_plan.unmoved import lawless_states, unmoved_states

STEPS, SENSOR = 100, 1e-3
SIGNALS = tl.Signals(
    [
        tl.State("angle", "rad", 1.0),
        tl.State("rate", "rad/s", 5.0, derivative_of="angle"),
        tl.State("airspeed", "m/s", 10.0),
    ],
    [tl.Command("torque", "N m", (-10.0, 10.0), scale=1.0)],
    0.02,
)
FAMILY = tl.controllers.PID(
    axes=[("angle", "rate")], gains={"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 1.0), "angle.kd": (0.0, 2.0)}
).bind(SIGNALS)
SETUP = SimpleNamespace(signals=SIGNALS, family=FAMILY, target_state=np.zeros(3))


def found(rate, motion, sensor=SENSOR):
    """What is unmoved if the first output is `rate` and the second one nothing, and every state moves by `motion`."""
    program = _core.Program.parse(program_text(4, 2, 6, [[rate, "r5 = r5 + 0.0"]]))
    identified = SimpleNamespace(
        model=_core.Model(program, "acceleration", SIGNALS.engine),
        sensors=lambda n_x: np.full(n_x, sensor),
        sums=[SimpleNamespace(chain=SimpleNamespace(states=states)) for states in ((1, 0), (2,))],
    )
    noise = SENSOR * np.random.default_rng(0).standard_normal((STEPS + 1, 3))
    states = noise + motion[:, np.newaxis]
    flight = SimpleNamespace(trajectory=SimpleNamespace(states=states, commands=np.zeros((STEPS, 1))))
    return unmoved_states(identified, [flight], SETUP)


def test_an_empty_equation_of_a_state_that_moves_and_that_the_controller_answers_to_is_found():
    """The angle's controller answers to the rate; nobody answers to the airspeed, which may do what it likes."""
    turning = np.sin(np.linspace(0.0, 3.0, STEPS + 1))
    assert found("r4 = r4 + 0.0", turning) == [1]
    assert found("r4 = r3 * 2.0", turning) == []


def test_a_reading_that_wraps_is_no_motion():
    """An angle that turns steadily is a straight line through whole turns."""
    heading = tl.State("heading", "rad", 3.0, periodic=True)
    signals = tl.Signals([heading], [tl.Command("rudder", "1", (-1.0, 1.0))], 0.02)
    family = tl.controllers.PID(
        [("heading", None)], {"heading.kp": (0.0, 1.0), "heading.ki": 0.0, "heading.kd": 0.0}
    ).bind(signals)
    setup = SimpleNamespace(signals=signals, family=family, target_state=np.zeros(1))
    program = _core.Program.parse(program_text(2, 1, 3, [["r2 = r2 + 0.0"]]))
    identified = SimpleNamespace(
        model=_core.Model(program, "increment", signals.engine),
        sensors=lambda n_x: np.full(n_x, SENSOR),
        sums=[SimpleNamespace(chain=SimpleNamespace(states=(0,)))],
    )

    def said(angle):
        wrapped = (angle[:, np.newaxis] + np.pi) % (2.0 * np.pi) - np.pi
        run = SimpleNamespace(states=wrapped, commands=np.zeros((STEPS, 1)))
        return unmoved_states(identified, [SimpleNamespace(trajectory=run)], setup)

    noise = SENSOR * np.random.default_rng(0).standard_normal(STEPS + 1)
    assert said(noise + np.linspace(0.0, 10.0, STEPS + 1)) == []
    assert said(noise + 4.0 + np.sin(np.linspace(0.0, 3.0, STEPS + 1))) == [0]


def test_noise_and_a_straight_line_are_no_motion():
    assert found("r4 = r4 + 0.0", np.linspace(0.0, 5.0, STEPS + 1)) == []
    assert found("r4 = r4 + 0.0", np.zeros(STEPS + 1)) == []


def test_motion_that_was_taken_for_noise_is_still_motion():
    turning = np.sin(np.linspace(0.0, 3.0, STEPS + 1))
    assert found("r4 = r4 + 0.0", turning, sensor=0.5) == [1]


def test_a_state_without_a_law_takes_its_integral_with_it(monkeypatch):
    stub, given = SimpleNamespace, []
    identified = stub(sums=[stub(chain=stub(states=(1, 0))), stub(chain=stub(states=(2,)))])
    monkeypatch.setattr(unmoved, "unmoved_states", lambda *arguments: given.append(arguments) or [1])
    assert lawless_states(identified, ["flight"], SETUP) == (0, 1)
    assert given == [(identified, ["flight"], SETUP)]
    monkeypatch.setattr(unmoved, "unmoved_states", lambda *arguments: [])
    assert lawless_states(identified, ["flight"], SETUP) == ()


def test_a_body_rate_without_a_law_takes_the_angle_about_its_axis_with_it(monkeypatch):
    names = ("roll", "pitch", "yaw", "p", "q", "r")
    signals = tl.Signals(
        [tl.State(name, "rad" if i < 3 else "rad/s", 1.0) for i, name in enumerate(names)],
        [tl.Command("torque", "N m", (-1.0, 1.0))],
        0.02,
        kinematics=tl.RigidBody(names[:3], names[3:]),
    )
    identified = SimpleNamespace(
        sums=[SimpleNamespace(chain=SimpleNamespace(states=(i,))) for i in (3, 4, 5)]
    )
    monkeypatch.setattr(unmoved, "unmoved_states", lambda *arguments: [5])
    assert lawless_states(identified, [], SimpleNamespace(signals=signals)) == (2, 5)
