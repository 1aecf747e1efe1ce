"""A rig of which an angle is logged and nothing else: its law is found, predictions come true, any door takes it."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import twinloop as tl
from command import invoke
from lives import THOROUGH
from oracles import same_bits
from twinloop.campaign.examination.log_check import check_log
from twinloop.campaign.identify_and_plan.outputs_alone import outputs_alone
from twinloop.contracts import check_system
from twinloop.faces.figures.residuals import autocorrelation, crosscorrelation
from twinloop.faces.sheet import Sheet
from twinloop.guard import Guard
from twinloop.law.actuation import Actuation, Actuator, HiddenState
from twinloop.law.exports.controller_source import controller_c, controller_python
from twinloop.law.reports import Computed
from twinloop.logs import write_columns
from twinloop.store import StoredAs
from twinloop.trajectory import completed

DT, NOISE = 0.05, 1e-3
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 3.0, envelope=(-2.5, 2.5))],
    [tl.Command("torque", "N m", (-3.0, 3.0))],
    DT,
    lags=1,
)
PID = tl.controllers.PID(
    axes=[("angle", "angle_rate")],
    gains={"angle.kp": (0.0, 20.0), "angle.ki": (0.0, 20.0), "angle.kd": (0.0, 5.0)},
)
GAINS = {"angle.kp": 2.0, "angle.ki": 1.0, "angle.kd": 0.2}
RIG = """\
dt = 0.05
lags = 1
[states.angle]
unit = "rad"
scale = 3.0
[commands.torque]
unit = "N m"
bounds = [-3.0, 3.0]
"""


def after(state, torque):
    """A pendulum one period later."""
    swing = lambda t, x: [x[1], -9.0 * np.sin(x[0]) - 0.5 * x[1] + 4.0 * torque]  # noqa: E731
    return solve_ivp(swing, (0.0, DT), state, rtol=1e-9, atol=1e-9).y[:, -1]


class Rig(tl.System):
    """It reads the angle, and passes to its controller what it has read."""

    signals = SIGNALS
    controller, default_gains, noise = PID, GAINS, NOISE

    def __init__(self):
        self.runs = 0

    def run(self, test):
        stream = np.random.default_rng([7, self.runs])
        self.runs += 1
        controller = test.controller()
        controller.reset()
        state, read, sent = np.array([test.initial_state[0], 0.0]), [], []
        for k in range(test.steps + 1):
            read.append(state[:1] + NOISE * stream.standard_normal(1))
            if k < test.steps:
                sent.append(controller.command(read[-1], test.target(k)))
                state = after(state, sent[-1][0])
        return tl.Trajectory(DT * np.arange(test.steps + 1), np.array(read), np.array(sent))


def logged(seed, steps=200):
    """A log of the angle, begun in motion, and what the angle truly was."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (steps // 5, 1)), 5, axis=0)
    states = [stream.uniform(-0.5, 0.5, 2)]
    for (torque,) in commands:
        states.append(after(states[-1], torque))
    true = np.array(states)
    read = true[:, :1] + NOISE * stream.standard_normal((len(true), 1))
    return tl.Trajectory(DT * np.arange(len(true)), read, commands), true


@pytest.fixture(scope="module")
def twin():
    return tl.identify([logged(1)[0], logged(2)[0]], SIGNALS, options=THOROUGH, progress=None)


def test_the_law_is_that_of_the_pendulum(twin):
    law = twin.equations().partition("d angle_rate / dt = ")[2]
    lines = [
        line.partition("#")[0].replace(" ", "").split("*", 1) for line in law.splitlines() if "*" in line
    ]
    terms = {name: float(weight) for weight, name in lines}
    assert terms.keys() == {"angle_rate", "torque_scaled", "sin(angle)"}
    assert terms["sin(angle)"] == pytest.approx(-9.0, rel=0.01)
    assert terms["angle_rate"] == pytest.approx(-0.5, rel=0.02)
    assert terms["torque_scaled"] == pytest.approx(12.0, rel=0.01)
    assert twin.law.reports == (None, Computed(0, 0.0, 1.0 / DT))
    assert not twin.remarks


def test_it_is_not_taken_for_a_sensor_where_reports_are_not_looked_for():
    options = {**THOROUGH, "reports": False}
    twin = tl.identify([logged(1)[0]], SIGNALS, options=options, progress=None)
    assert twin.law.reports == (None, Computed(0, 0.0, 1.0 / DT))


def test_it_follows_a_log_that_begins_in_motion_as_closely_as_that_was_read(twin):
    run, true = logged(3)
    angle, rate = twin.fit(run)
    assert angle.rmse < 2.0 * NOISE and rate.rmse < 2.0 * NOISE * np.sqrt(2.0) / DT
    free = twin.simulate_commands(true[0], run.commands).states[:, 0]
    assert np.abs(free - true[:, 0]).max() < 3.0 * NOISE
    at_rest = twin.simulate_commands([0.3], run.commands)
    assert same_bits(at_rest.states, twin.simulate_commands([0.3, 0.0], run.commands).states)


def test_predictions_of_flights_come_true():
    campaign = tl.Campaign(
        SIGNALS, controller=PID, initial_state=[0.0], target_state=[1.2], duration=3.0, options=THOROUGH, progress=None,
    )  # fmt: skip
    rig = Rig()
    first = campaign.test(GAINS)
    campaign.tell(first, rig.run(first))
    for last in (False, True):
        test = campaign.ask(last=last)
        campaign.tell(test, rig.run(test))
    assert [run.trajectory.states.shape[1] for run in campaign.experiments] == [2, 2, 2]
    assert all(run.trajectory.states[0, 1] == 0.0 for run in campaign.experiments)
    flown = campaign.experiments[-1].quality
    assert flown < 0.5 * campaign.experiments[0].quality
    assert abs(test.predicted - flown) < max(3.0 * test.spread, 0.02 * flown)
    assert not [remark for remark in campaign.twin.remarks if remark.serious]
    found = campaign.examine()
    assert found.autocorrelation.told.tolist() == [True, False]
    # No sensor reads the rate, so nothing is said of how far it moved beside a sensor's noise.
    assert found.movement[0] == "angle" and {flight.least for flight in found.data} == {"angle"}
    for figure in (autocorrelation(found), crosscorrelation(found)):
        assert [panel.title for panel in figure.panels] == ["angle"]


def test_a_target_that_moves_may_be_given_of_what_is_measured():
    arguments = {"controller": PID, "initial_state": [0.1], "duration": 1.0, "progress": None}
    reference = lambda t: [0.3 * t]  # noqa: E731
    called = tl.Campaign(SIGNALS, target_state=reference, **arguments).setup.target_state
    rows = tl.Campaign(
        SIGNALS, target_state=[reference(DT * k) for k in range(21)], **arguments
    ).setup.target_state
    assert same_bits(called, rows) and called.shape == (21, 2)
    np.testing.assert_allclose(called[:, 1], 0.3)


def test_a_system_that_reads_outputs_alone_keeps_its_contract():
    check_system(Rig())


def test_a_controller_given_readings_does_as_one_given_their_changes_too():
    test = tl.Test(PID.bind(SIGNALS), PID.bind(SIGNALS).genes(GAINS), np.zeros(2), np.array([1.0, 0.0]), 20)
    by_reading, by_state = test.controller(), test.controller()
    angles = np.cumsum(np.random.default_rng(0).normal(size=20)) * 0.05
    for k, angle in enumerate(angles):
        rate = (angle - angles[k - 1]) / DT if k else 0.0
        assert same_bits(by_reading.command([angle], [1.0]), by_state.command([angle, rate], [1.0, 0.0]))
    by_reading.reset(), by_state.reset()
    assert same_bits(by_reading.command([0.5], [1.0]), by_state.command([0.5, 0.0], [1.0, 0.0]))
    with pytest.raises(tl.InvalidInput):
        by_reading.command([0.5, 0.0, 0.0], [1.0])


def test_the_guard_is_given_readings_alone():
    bound = PID.bind(SIGNALS)
    test = tl.Test(bound, bound.genes(GAINS), np.zeros(2), np.array([1.0, 0.0]), 30)
    guard, plain = Guard(test, [0.0], clock=None), test.controller()
    state = np.zeros(2)
    for _ in range(30):
        command = guard.command(state[:1], test.target(0))
        assert same_bits(command, plain.command(state[:1], test.target(0)))
        state = after(state, command[0])
    flown = guard.trajectory(state[:1])
    assert flown.ended == "completed" and flown.states.shape == (31, 2)
    assert same_bits(flown.states[1:, 1], np.diff(flown.states[:, 0]) / DT)
    assert same_bits(guard.trajectory(state[:1]).states, flown.states)


def test_flown_blind_the_guard_expects_what_the_twin_simulates(twin):
    bound = PID.bind(SIGNALS)
    test = tl.Test(bound, bound.genes(GAINS), np.zeros(2), np.array([1.0, 0.0]), 30)
    guard = Guard(test, [1.5], twin=twin, clock=None)
    sent = [guard.command([0.0], test.target(0))]
    expected = []
    for _ in range(12):
        sent.append(guard.command([np.nan], test.target(0)))
        expected.append(guard._estimate)
    states = twin.simulate_commands([0.0], np.array(sent)).true_states
    np.testing.assert_allclose(np.array(expected), states[2:], atol=1e-9)


@pytest.fixture(scope="module")
def coarse(twin):
    """The same twin, whose flights were read by an encoder of 1 mrad."""
    run, _ = logged(1)
    rounded = completed(tl.Trajectory(run.t, 1e-3 * np.round(run.states / 1e-3), run.commands), SIGNALS)
    return tl.Twin(twin.model, SIGNALS, [], members=twin.members, noise=twin.noise, flights=[rounded])


@pytest.mark.parametrize(("target", "trips"), [(0.0, False), (1.0, True)])
def test_the_guard_lets_an_encoder_rest_where_the_twin_does(coarse, target, trips):
    bound = PID.bind(SIGNALS)
    test = tl.Test(bound, bound.genes(GAINS), np.zeros(2), np.array([target, 0.0]), 60)
    guard = Guard(test, [0.0], twin=coarse, clock=None)
    for _ in range(60):
        guard.command([0.0], test.target(0))
    assert guard.tripped is trips
    assert ("band" in guard.reason) is trips, guard.reason


def test_a_log_without_the_rate_is_loaded_checked_and_identified(tmp_path):
    (tmp_path / "rig.toml").write_text(
        RIG + "[options]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in THOROUGH.items())
    )
    files = []
    for seed in (1, 2):
        run, _ = logged(seed)
        files.append(tmp_path / f"{seed}.csv")
        write_columns(files[-1], {"t": run.t, "angle": run.states[:, 0], "torque": run.commands[:, 0]})
    loaded = tl.load(files[0], SIGNALS)
    assert same_bits(loaded.states, logged(1)[0].states)
    found = check_log(loaded.t, loaded.states, loaded.commands, SIGNALS)
    assert found.fit and [column.name for column in found.columns] == ["angle", "angle_rate", "torque"]
    assert "derived-rate" not in [remark.code for remark in found.remarks]
    checked = invoke("check", str(files[0]), str(tmp_path / "rig.toml"), "-o", str(tmp_path / "same.csv"))
    assert checked.exit_code == 0, checked.output
    assert same_bits(tl.load(tmp_path / "same.csv", SIGNALS).states, loaded.states)
    done = invoke("identify", *map(str, files), "--config", str(tmp_path / "rig.toml"), "--json")
    assert done.exit_code == 0, done.output
    assert "sin(angle)" in done.stdout


def test_some_rates_without_the_others_are_refused(tmp_path):
    two = tl.Signals([tl.State("q1", "rad", 1.0), tl.State("q2", "rad", 1.0)], SIGNALS.commands, DT, lags=1)
    path = tmp_path / "some.csv"
    names = ("t", "q1", "q2", "q2_rate", "torque")
    write_columns(path, {name: DT * np.arange(9.0) for name in names})
    with pytest.raises(tl.InvalidInput, match="found q2_rate without q1_rate"):
        tl.load(path, two)


def counted(steps, seed):
    """What an encoder of 0.2 mm reads of a cart that comes to rest, and what was sent."""
    stream, state, read, sent = np.random.default_rng(seed), np.zeros(2), [], []
    for k in range(steps + 1):
        read.append(2e-4 * np.round(state[0] / 2e-4))
        if k < steps:
            force = 0.6 * stream.uniform() if k < steps // 3 else 0.0
            sent.append([force])
            state = solve_ivp(
                lambda t, x, u=force: [x[1], 9.0 * u - 6.0 * x[1]], (0.0, DT), state, rtol=1e-9
            ).y[:, -1]
    return tl.Trajectory(DT * np.arange(steps + 1), np.array(read)[:, np.newaxis], np.array(sent))


def test_a_rate_that_is_made_does_not_freeze_where_an_encoder_comes_to_rest():
    cart = tl.Signals([tl.State("pos", "m", 0.5)], [tl.Command("force", "N", (-1.0, 1.0))], DT, lags=1)
    run = counted(120, 0)
    found = check_log(run.t, run.states, run.commands, cart)
    assert found.fit, [str(remark) for remark in found.remarks]


def test_a_log_is_known_again(tmp_path):
    campaign = tl.Campaign(
        SIGNALS, controller=PID, initial_state=[0.0], target_state=[1.2], duration=1.0, progress=None
    )
    run, _ = logged(1, 20)
    campaign.attach(run)
    states = campaign.experiments[0].trajectory.states
    assert same_bits(states[1:, 1], np.diff(run.states[:, 0]) / DT) and states[0, 1] == states[1, 1]


def test_a_log_with_a_column_for_the_rate_is_taken_as_it_is(tmp_path):
    run, true = logged(1, 20)
    path = tmp_path / "both.csv"
    write_columns(
        path, {"t": run.t, "angle": true[:, 0], "angle_rate": true[:, 1], "torque": run.commands[:, 0]}
    )
    assert same_bits(tl.load(path, SIGNALS).states, true)
    with pytest.raises(tl.InvalidInput, match="angle is missing"):
        write_columns(path, {"t": run.t, "angle_rate": true[:, 1], "torque": run.commands[:, 0]})
        tl.load(path, SIGNALS)


def test_a_person_is_told_how_the_rate_is_made_and_what_to_record(tmp_path):
    campaign = tl.Campaign(
        SIGNALS, controller=PID, initial_state=[0.0], target_state=[1.2], duration=1.0, progress=None
    )
    made = "angle_rate is not measured: (angle - angle a period before) / 0.05 s, 0 in the first period"
    text = Sheet(StoredAs("rig.db"), campaign.test(GAINS), "rig-test-0.csv", campaign.setup).text
    assert f"{made}.\nRecord t, angle, torque, then:" in text
    family = PID.bind(SIGNALS)
    genes = family.genes(GAINS)
    header, _ = controller_c(PID, family, genes, "loop")
    assert f"   {made}\n" in header and f"# {made}\n" in controller_python(PID, family, genes)


ALONE = tl.Signals([tl.State("angle", "rad", 3.0)], SIGNALS.commands, DT)
BARE = Actuation.direct(ALONE)
LAGGING = Actuation((Actuator(lag=0.5),))
FILLED = Actuation(BARE.actuators, (HiddenState((0,), False, 0.0, 1.0),))
STORED = Actuation(BARE.actuators, (HiddenState((), False, 0.0, 1.0, states=(0,)),))


def tank(seed):
    """A level that what flows in moves at once."""
    commands = np.repeat(np.random.default_rng(seed).uniform(0.0, 2.0, (40, 1)), 5, axis=0)
    level = [1.0]
    for (inflow,) in commands:
        level.append(level[-1] + DT * (inflow - np.sqrt(level[-1])))
    return tl.Trajectory(DT * np.arange(201), np.array(level)[:, np.newaxis], commands)


@pytest.mark.parametrize(
    ("actuation", "explained", "said"),
    [(BARE, True, 0), (BARE, False, 1), (LAGGING, True, 1), (FILLED, True, 1), (STORED, True, 1)],
)
def test_a_mass_without_a_rate_is_pointed_out_where_something_stands_for_it(actuation, explained, said):
    mass, still = [logged(1)[0], logged(2)[0]], [tank(1), tank(2)]
    found = list(outputs_alone(actuation, mass, ALONE, explained))
    assert [remark.code for remark in found] == ["outputs-alone"] * said
    assert all("lags=1" in remark.sentence and not remark.serious for remark in found)
    assert not list(outputs_alone(actuation, still, ALONE, explained))
    declared = [completed(run, SIGNALS) for run in mass]
    assert not list(outputs_alone(actuation, declared, SIGNALS, explained))
