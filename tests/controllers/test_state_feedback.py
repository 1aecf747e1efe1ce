"""State feedback: the law against plain NumPy, the names, units and bounds of its gains, its contract."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import same_bits
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.contracts import check_controller, check_system
from twinloop.controllers import Mixer, StateFeedback


class Feedback:
    """u = K e + K_I ∫e with the integral updated before it is used, then the map."""

    def __init__(self, genes, dt, states, integral, mixer, bounds):
        matrix = np.asarray(mixer.matrix)
        gains = np.reshape(genes, (matrix.shape[1], -1))
        self.of_states, self.of_integrals = gains[:, : len(states)], gains[:, len(states) :]
        self.dt, self.states, self.integral, self.mixer = dt, list(states), list(integral), mixer
        self.bounds, self.sum = np.asarray(bounds), np.zeros(len(integral))

    def command(self, state, target):
        error = np.asarray(target) - state
        self.sum = self.sum + error[self.integral] * self.dt
        u = self.of_states @ error[self.states] + self.of_integrals @ self.sum
        v = self.mixer.matrix @ u + self.mixer.offset
        raised = np.sign(v) * np.abs(v) ** self.mixer.power
        return np.clip(raised, self.bounds[:, 0], self.bounds[:, 1])


@given(st.integers(0, 2**32 - 1), st.sampled_from([None, ("yaw_rate", "roll", "pitch")]), st.booleans())
def test_a_controller_is_the_plain_feedback(seed, states, integrating):
    system = tl.systems.Quadrotor()
    names = list(system.signals.state_names)
    integral = ("yaw", "pitch") if integrating else ()
    output = system.controller.output
    family = StateFeedback(states, (-0.3, 0.3), output, integral).bind(system.signals)
    stream = np.random.default_rng(seed)
    genes = stream.uniform(-0.3, 0.3, family.size)
    indices = [names.index(name) for name in states or names], [names.index(name) for name in integral]
    plain = Feedback(genes, 0.02, *indices, output, [(0.0, 300.0)] * 4)
    controller = family.controller(genes)
    target = stream.uniform(-0.5, 0.5, 6)
    for _ in range(30):
        state = stream.normal(0.0, 0.2, 6)
        np.testing.assert_allclose(
            controller.command(state, target), plain.command(state, target), rtol=1e-11, atol=1e-9
        )


def test_with_the_pids_gains_it_flies_as_the_pid_does(quadrotor, first_test):
    """For targets at rest, K_D on the measured rate is a gain on the rate's error."""
    output = quadrotor.controller.output
    angles = ("roll", "pitch", "yaw")
    family = StateFeedback(None, (0.0, 0.3), output, angles).bind(quadrotor.signals)
    gains = dict.fromkeys(family.names, 0.0)
    for j, angle in enumerate(angles):
        for source, term in ((angle, "kp"), (f"{angle}_rate", "kd"), (f"{angle}.integral", "ki")):
            gains[f"{source}->u{j + 1}"] = quadrotor.default_gains[f"{angle}.{term}"]
    test = tl.Test(family, family.genes(gains), np.zeros(6), quadrotor.target_state, 100)
    flown, expected = quadrotor.run(test), quadrotor.run(first_test)
    np.testing.assert_allclose(flown.states, expected.states, rtol=0.0, atol=1e-10)


def test_gains_have_names_units_and_bounds_in_rows_of_the_outputs(quadrotor):
    output = Mixer(quadrotor.controller.output.matrix, power=0.5, unit="N m")
    bounds = {"roll": (0.0, 0.3), "roll_rate": (-0.1, 0.1), "roll.integral": (1e-4, 0.1, "log")}
    bounds["roll->u2"] = (-1.0, 1.0)
    family = StateFeedback(["roll_rate", "roll"], bounds, output, ["roll"]).bind(quadrotor.signals)
    row = ("roll_rate", "roll", "roll.integral")
    assert family.names == tuple(f"{source}->u{j}" for j in (1, 2, 3) for source in row)
    assert [gain.unit for gain in family.gains[:3]] == ["N m/(rad/s)", "N m/rad", "N m/(rad s)"]
    assert [(g.low, g.high) for g in family.gains[3:6]] == [(-0.1, 0.1), (-1.0, 1.0), (1e-4, 0.1)]
    assert [gain.logarithmic for gain in family.gains[:3]] == [False, False, True]


def test_without_a_mixer_an_output_is_a_command_and_bears_its_name(pendulum_signals):
    family = StateFeedback(None, (-6.0, 6.0)).bind(pendulum_signals)
    assert family.names == ("angle->torque", "rate->torque")
    controller = family.controller([2.0, 0.5])
    assert controller.command([0.1, -1.0], [0.3, 0.0])[0] == pytest.approx(2.0 * 0.2 + 0.5)
    assert controller.command([-9.0, 0.0], [0.0, 0.0])[0] == 2.0


def test_reset_forgets_the_integrals(pendulum_signals):
    controller = (
        StateFeedback(["rate"], (0.0, 6.0), None, ["angle"]).bind(pendulum_signals).controller([0, 6])
    )
    found = [controller.command([0.0, 0.0], [1.0, 0.0])[0] for _ in range(3)]
    np.testing.assert_allclose(found, [0.3, 0.6, 0.9], rtol=1e-14)
    controller.reset()
    assert same_bits([controller.command([0.0, 0.0], [1.0, 0.0])[0] for _ in range(3)], found)


def test_it_keeps_to_the_contract(quadrotor, pendulum, pendulum_signals):
    output = quadrotor.controller.output
    check_controller(StateFeedback(None, (-0.3, 0.3), output, ["yaw"]), quadrotor.signals)
    direct = StateFeedback(None, (-6.0, 6.0), integral=["angle"])
    check_controller(direct, pendulum_signals)
    gains = {"angle->torque": 2.0, "rate->torque": 0.3, "angle.integral->torque": 1.0}
    check_system(pendulum, direct, gains=gains, target_state=np.array([1.0, 0.0]))


def test_the_campaign_takes_it(pendulum, new_campaign):
    campaign = new_campaign(controller=StateFeedback(None, (0.0, 6.0)))
    first = campaign.test({"angle->torque": 2.0, "rate->torque": 0.3})
    campaign.tell(first, pendulum.run(first))
    assert campaign.ask().parameters.keys() == {"angle->torque", "rate->torque"}


REFUSED = {
    "no states": (lambda: StateFeedback([], (0, 1)), "at least one state"),
    "a state twice": (lambda: StateFeedback(["angle", "angle"], (0, 1)), "each once"),
    "one name as a string": (lambda: StateFeedback("angle", (0, 1)), "a list of names"),
    "an integral twice": (lambda: StateFeedback(None, (0, 1), None, ["angle"] * 2), "each once"),
    "bounds the wrong way round": (lambda: StateFeedback(None, (1, 0)), "low < high"),
    "an output that is no mixer": (lambda: StateFeedback(None, (0, 1), 3), "Mixer or None"),
    "an offset without a row": (
        lambda: Mixer([[1.0, 0.0]], [0.5, 0.5]),
        "a row of the matrix and an entry of the offset for each command, found 1 and 2",
    ),
}
UNFIT = {
    "an unknown state": (StateFeedback(["angel"], (0, 1)), "did you mean 'angle'"),
    "an unknown integral": (StateFeedback(None, (0, 1), None, ["x"]), "Unknown state"),
    "an unknown gain": (StateFeedback(None, {"angel": (0, 1), "rate": (0, 1)}), "Unknown gain 'angel'"),
    "a missing gain": (StateFeedback(None, {"angle": (0, 1)}), "found none for rate->torque"),
    "a mixer for two commands": (StateFeedback(None, (0, 1), Mixer([[1.0], [1.0]])), "expected the shape"),
}


def test_no_campaign_begins_with_an_offset_that_no_command_can_reach(new_campaign, pendulum_signals):
    in_percent = StateFeedback(None, (0, 1), Mixer([[1.0]], [62.0]))
    with pytest.raises(
        tl.InvalidInput, match=r"within its bounds, .* found 62; give it in the unit of the command"
    ):
        new_campaign(controller=in_percent)
    # One that was begun is read all the same, and what has no offset may be clipped at rest.
    record = new_campaign(controller=StateFeedback(None, (0, 1), Mixer([[1.0]], [0.5]))).to_record()
    record["setup"]["controller"]["output"]["offset"] = [62.0]
    assert tl.Campaign.from_record(record).setup.mixer.offset == [62.0]
    pushes = replace(pendulum_signals, commands=[tl.Command("torque", "N m", (0.2, 1.0))])
    Mixer([[1.0]]).check_offset(pushes)


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_feedback_is_refused(case):
    make, sentence = REFUSED[case]
    with pytest.raises(tl.InvalidInput, match=sentence):
        make()


@pytest.mark.parametrize("case", UNFIT)
def test_what_does_not_fit_the_signals_is_refused(pendulum_signals, case):
    feedback, sentence = UNFIT[case]
    with pytest.raises(tl.InvalidInput, match=sentence):
        feedback.bind(pendulum_signals)


def test_every_width_flies_the_same_bits_with_rotors_that_lag():
    system = tl.systems.Quadrotor(drag=0.05, motor_lag=0.03)
    family = StateFeedback(None, (-0.1, 0.3), system.controller.output, ["yaw"]).bind(system.signals)
    genes = np.random.default_rng(0).uniform(-0.1, 0.3, (70, family.size))
    task = _core.Task(np.zeros(6), system.target_state, 40)

    setting = Limits(system.signals).setting(family.engine)

    def flown(width):
        workers = _core.Workers(1, width)
        return _core.rollout(system.dynamics, setting, genes, task, workers=workers).states

    narrow = flown("baseline")
    assert all(same_bits(narrow, flown(width)) for width in _core.vector_widths())
    alone = _core.rollout(system.dynamics, setting, genes[69:], task).states
    assert same_bits(narrow[69:], alone)
