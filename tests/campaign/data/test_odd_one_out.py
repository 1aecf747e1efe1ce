"""The one log of several with a wrong sign, unit or order of columns is named; healthy ones never are."""

import dataclasses

import numpy as np
import pytest

import twinloop as tl
from twinloop.campaign.data.odd_one_out import odd_one_out, said_odd

DT = 0.02
ARM = tl.Signals(
    [tl.State("angle", "rad", 3.0), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-2.0, 2.0))],
    DT,
)
PLAIN = tl.Signals(
    [tl.State("a", "m", 3.0), tl.State("b", "m/s", 8.0)], [tl.Command("u", "V", (-2.0, 2.0))], DT
)


def pendulum(x, u):
    return [x[1], -9.0 * np.sin(x[0]) - 0.4 * x[1] + 5.0 * u[0]]


HEALTHY = {
    "pendulum": pendulum,
    "held up": lambda x, u: [x[1], 8.0 * np.sin(x[0]) + 4.0 * u[0] - 3.0 * x[1] - 12.0 * x[0]],
    "dry friction": lambda x, u: [x[1], 4.0 * u[0] - 1.5 * np.tanh(x[1] / 0.02) - 0.3 * x[1]],
    "two wells": lambda x, u: [x[1], 2.0 * x[0] - 2.0 * x[0] ** 3 - 0.2 * x[1] + u[0]],
    "a squared thrust": lambda x, u: [x[1], 6.0 * u[0] * abs(u[0]) - 0.5 * x[1] * abs(x[1])],
    "two tanks": lambda x, u: [
        0.5 + 0.2 * u[0] - 0.4 * np.sqrt(max(x[0], 0.0)),
        0.4 * np.sqrt(max(x[0], 0.0)) - 0.4 * np.sqrt(max(x[1], 0.0)),
    ],
}


def flown(law, stream, signals=PLAIN, steps=250):
    """A log from anywhere, by steps of any size about any mean, or under a controller with gains of its own."""
    state = stream.uniform(-1.0, 1.0, 2) * stream.choice([0.1, 1.0, 3.0])
    size, mean, gains = (
        10.0 ** stream.uniform(-1.0, 0.5),
        stream.uniform(-1.0, 1.0),
        stream.uniform(0.5, 4.0, 2),
    )
    pushes = np.repeat(mean + size * stream.uniform(-1.0, 1.0, int(stream.integers(3, 9))), steps)
    closed = stream.random() < 0.5
    states, commands = [], []
    for k in range(steps):
        if np.abs(state).max() > 50.0:
            return None  # it ran away
        states.append(state + stream.normal(size=2) * [1e-3, 5e-3])
        push = pushes[k * len(pushes) // steps]
        commands.append([push - gains @ states[-1] if closed else push])
        for _ in range(4):
            state = state + DT / 4 * np.array(law(state, commands[-1]))
    return tl.Trajectory(DT * np.arange(steps + 1), np.array([*states, state]), np.array(commands))


def said(flights, signals=PLAIN):
    return [
        each.sentence
        for each in said_odd(odd_one_out(flights, signals), [f"{k}.csv" for k in range(len(flights))])
    ]


def finite(law, seed, count, signals=PLAIN):
    stream, flights = np.random.default_rng(seed), []
    while len(flights) < count:
        flight = flown(law, stream, signals)
        flights += [] if flight is None else [flight]
    return flights


@pytest.mark.parametrize("system", HEALTHY)
def test_healthy_logs_are_never_accused_wherever_and_however_they_were_flown(system):
    for seed in range(25):
        assert said(finite(HEALTHY[system], seed, 3 + seed % 3)) == []


def servo(x, torque):
    return [x[1], -4.0 * np.sin(x[0]) - 3.0 * x[1] + 5.0 * torque]


def near(seed):
    """Four logs of an arm with a damper, under steps of a torque."""
    stream, flights = np.random.default_rng(seed), []
    for _ in range(4):
        pushes = np.repeat(stream.uniform(-0.5, 0.5, 8), 30)
        state, states = np.zeros(2), []
        for push in pushes:
            states.append(state + stream.normal(size=2) * [1e-3, 5e-3])
            for _ in range(4):
                state = state + DT / 4 * np.array(servo(state, push))
        t = DT * np.arange(len(pushes) + 1)
        flights.append(tl.Trajectory(t, np.array([*states, state]), pushes[:, np.newaxis]))
    return flights


@pytest.mark.parametrize(
    ("states", "commands", "words"),
    [
        ([1.0, 1.0], -1.0, "with the sign of its torque changed"),
        ([-1.0, -1.0], 1.0, None),  # the same as another sign of the torque: either is said
        ([1.0, 1.0], 1000.0, "with its torque divided by about 1000"),
        ([180.0 / np.pi] * 2, 1.0, None),  # the same as another unit of the torque
        ([1.0, 180.0 / np.pi], 1.0, "with its rate divided by about 57.3"),
        ([1.0, -1.0], 1.0, "with the sign of its rate changed"),
    ],
)
@pytest.mark.parametrize("place", [0, 2])
def test_the_log_with_a_wrong_sign_or_unit_is_named_with_what_makes_it_right(states, commands, words, place):
    flights = near(seed=place)
    assert said(flights, ARM) == []
    bad = flights[place]
    flights[place] = dataclasses.replace(bad, states=bad.states * states, commands=bad.commands * commands)
    (sentence,) = said(flights, ARM)
    assert sentence.startswith(f"Without {place}.csv one linear law explains most of the other 3 flights")
    assert f"It does not explain {place}.csv, but would with" in sentence
    assert words is None or words in sentence


def test_the_log_with_two_columns_exchanged_is_named():
    flights = near(seed=5)
    flights[1] = dataclasses.replace(flights[1], states=flights[1].states[:, ::-1].copy())
    (sentence,) = said(flights, ARM)
    assert "It does not explain 1.csv, but would with its angle and rate exchanged" in sentence


def test_of_two_logs_nobody_can_say_which_is_wrong_and_a_copy_is_no_witness():
    first, second, *_ = near(seed=0)
    wrong = dataclasses.replace(second, commands=-second.commands)
    assert said([first, wrong], ARM) == [] and said([first, first, wrong], ARM) == []
    others = [dataclasses.replace(flight, commands=-flight.commands) for flight in near(seed=1)[:2]]
    assert said([first, second, *others], ARM) == []


@pytest.mark.parametrize("speed", [0.2, 0.3, 0.4, 2.0, 5.0])
def test_a_log_at_another_speed_or_load_is_another_machine_and_no_other_unit(speed):
    def car(x, u, pace=1.0):
        return [x[1], 4.0 * pace * u[0] - 2.0 * x[1] - 3.0 * x[0]]

    stream = np.random.default_rng(7)
    logs = []
    while len(logs) < 3:
        pace = speed if len(logs) == 2 else 1.0
        log = flown(lambda x, u, pace=pace: car(x, u, pace), stream)
        logs += [] if log is None else [log]
    assert [
        sentence for sentence in said(logs, PLAIN) if "divided" in sentence or "multiplied" in sentence
    ] == []


def test_the_odd_one_is_put_right_by_the_change_that_is_said():
    flights = near(0)
    for scale, shrunk in (
        (np.array([1.0, 180.0 / np.pi]), np.log(180.0 / np.pi)),
        (np.array([1.0, -1.0]), 0.0),
    ):
        wrong = dataclasses.replace(flights[2], states=flights[2].states * scale)
        odd = odd_one_out([*flights[:2], wrong, flights[3]], ARM)
        np.testing.assert_allclose(odd.righted.states, flights[2].states, rtol=1e-12)
        np.testing.assert_array_equal(odd.righted.commands, flights[2].commands)
        assert (odd.place, odd.compared, odd.shrunk) == (2, 4, pytest.approx(shrunk))
    wrong = dataclasses.replace(flights[2], commands=1000.0 * flights[2].commands)
    odd = odd_one_out([*flights[:2], wrong, flights[3]], ARM)
    np.testing.assert_allclose(odd.righted.commands, flights[2].commands, rtol=1e-12)
    np.testing.assert_array_equal(odd.righted.states, flights[2].states)
    assert odd.shrunk == 0.0
