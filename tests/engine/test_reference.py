"""References that vary with time, starts of one's own, and runs under commands without a controller."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_GAINS, TINY
from oracles import same_bits
from twinloop import _core, flights
from twinloop._experiment.limits import Limits
from twinloop.controllers import PID, Mixer
from twinloop.law.flight import drawn_runs, fly
from twinloop.objectives import closed_loop, selected_tests
from twinloop.planning.quality import quality_of
from twinloop.test import final_distance

STEPS = 20
WORKERS = _core.Workers()


@pytest.fixture
def family(pendulum_signals, pendulum_controller):
    return pendulum_controller.bind(pendulum_signals)


def pendulum_of(signals):
    lines = ("r3 = sin(r0)", "r3 = r3 * -24.5", "r4 = r2 * 41.0", "r3 = r3 + r4")
    text = "program inputs=3 outputs=1 registers=5\npage 1\n" + "\n".join(lines)
    return _core.Model(_core.Program.parse(text), "acceleration", signals.engine)


@pytest.fixture
def model(pendulum_signals):
    return pendulum_of(pendulum_signals)


def reference(t):
    return [np.sin(2.0 * t), 2.0 * np.cos(2.0 * t)]


ROWS = np.array([reference(0.05 * k) for k in range(STEPS + 1)])


def led(family, target, gains=(2.0, 2.0, 0.3), initial=(0.0, 0.0)):
    return tl.Test(family, np.array(gains), np.array(initial), np.array(target), STEPS)


def test_rows_that_are_all_alike_are_a_constant_target_to_the_bit(family, model):
    one, other = (
        fly(model, led(family, target)) for target in ([1.0, 0.5], np.tile([1.0, 0.5], (STEPS + 1, 1)))
    )
    assert same_bits(one.states, other.states) and same_bits(one.commands, other.commands)


def test_a_controller_is_led_to_the_row_of_its_period(family, model):
    test = led(family, ROWS)
    run, controller = fly(model, test), test.controller()
    for k in range(STEPS):
        assert same_bits(controller.command(run.states[k], test.target(k)), run.commands[k])
        assert same_bits(model.step(run.states[k : k + 1], run.commands[k : k + 1])[0], run.states[k + 1])
    assert same_bits(test.target(STEPS), ROWS[-1])


@given(st.integers(0, 2**32 - 1), st.sampled_from(["iae", "ise", "final_distance"]))
def test_the_engine_judges_flights_as_their_records_are_judged(seed, kind):
    signals, plant = PLANT.signals, pendulum_of(PLANT.signals)
    family = CONTROLLER.bind(signals)
    draw = np.random.default_rng(seed)
    genes = draw.random((5, 3)) * [6.0, 6.0, 1.0]
    targets = np.cumsum(draw.normal(0.0, 0.2, (5, STEPS + 1, 2)), axis=1)
    quality = quality_of(kind, signals, (1.0, 0.25), 0.1, 0.01)
    drawn = flights.candidates(family, genes, np.zeros(2), targets, STEPS)
    found, _ = flights.qualities([plant], drawn, quality.engine, signals)
    for i in range(5):
        test = led(family, targets[i], genes[i])
        run = fly(plant, test)
        assert found[0, 0, i] == pytest.approx(quality.flown(run, test.target_state), rel=1e-12)
        distance = _core.final_distances(
            [plant], Limits(signals).setting(family.engine), genes[i : i + 1], test.task
        )
        assert distance[0, 0] == pytest.approx(final_distance(run.states[-1], targets[i, -1]), rel=1e-12)


CONTROLLER = PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)},
)
PLANT = tl.systems.Simulated(
    tl.Signals(
        [tl.State("angle", "rad", scale=np.pi), tl.State("rate", "rad/s", scale=8.0, derivative_of="angle")],
        [tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
        0.05,
    ),
    lambda x, u: [x[0] + 0.05 * x[1], x[1] + 0.05 * (20.0 * u[0] - 24.5 * np.sin(x[0]) - x[1])],
    default_gains=PENDULUM_GAINS,
)


def test_models_are_judged_on_tests_with_and_without_a_reference_side_by_side(family, model):
    tests = [led(family, [1.0, 0.0]), led(family, ROWS), led(family, -ROWS, (3.0, 0.0, 0.1))]
    runs = [fly(model, test) for test in tests]
    # The last one was cut: of its reference only the first rows were flown.
    runs[2] = tl.Trajectory(runs[2].t[:15], runs[2].states[:15], runs[2].commands[:14], "aborted", "by hand")
    together = closed_loop([model], selected_tests(tests, runs), WORKERS)
    alone = [
        closed_loop([model], selected_tests([t], [r]), WORKERS)[0, 0]
        for t, r in zip(tests, runs, strict=True)
    ]
    assert same_bits(together[0], alone) and together.max() == 0.0
    other = led(family, 0.5 * ROWS)
    assert closed_loop([model], selected_tests([other], [runs[1]]), WORKERS)[0, 0] > 1e-3


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_follows_a_function_of_time(preset, tmp_path):
    few = {"moves": 500, "starts": 1, "generations": 0, "lags": False, "committee_size": 3, "draws": 2}
    few |= {"tuning_steps": 4, "candidates": 8, "evaluations": 64, "target_range": (0.1, 0.0)}

    def begun(target):
        return tl.Campaign(
            PLANT.signals, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=target, duration=1.0,
            preset=preset, threads=1, options=TINY if preset == "paper" else few,
        )  # fmt: skip

    campaign, rows = begun(reference), begun(ROWS)
    assert same_bits(campaign.setup.target_state, ROWS)
    for one in (campaign, rows):
        first = one.test(PENDULUM_GAINS)
        one.tell(first, PLANT.run(first))
    asked = campaign.ask()
    assert same_bits(asked.genes, rows.ask().genes) and asked.target_state.shape == (STEPS + 1, 2)
    campaign.tell(asked, PLANT.run(asked))
    assert campaign.experiments[1].quality is not None
    assert campaign.best_test.target_state.shape == (STEPS + 1, 2)
    again = tl.Campaign.from_record(campaign.to_record())
    assert same_bits(again.setup.target_state, ROWS)
    assert same_bits(again.best_test.genes, campaign.best_test.genes)


def test_a_reference_of_another_length_is_refused(family):
    for rows in (ROWS[:-1], np.vstack([ROWS, ROWS]), ROWS[:, :1]):
        with pytest.raises(tl.InvalidInput, match=r"Test.target_state: expected the shape \(21, 2\)"):
            led(family, rows)
    with pytest.raises(tl.InvalidInput, match=r"target_state\(0\.3 s\)"):
        tl.Campaign(
            PLANT.signals, controller=CONTROLLER, initial_state=[0, 0], duration=1.0,
            target_state=lambda t: [1.0, 0.0] if t < 0.3 else [np.nan, 0.0],
        )  # fmt: skip
    with pytest.raises(tl.InvalidInput, match="a row of it for each of 21 states"):
        _core.Task([0.0, 0.0], ROWS[:-1], STEPS)


# Starts and commands


def test_a_twin_simulates_a_test_from_any_start(family, model, pendulum_signals):
    twin = tl.Twin(model, pendulum_signals)
    test = led(family, [1.0, 0.0])
    assert same_bits(twin.simulate(test, initial_state=test.initial_state).states, twin.simulate(test).states)
    found = twin.simulate(test, initial_state=[0.5, -1.0])
    assert same_bits(found.states, twin.simulate(led(family, [1.0, 0.0], initial=(0.5, -1.0))).states)
    with pytest.raises(tl.InvalidInput, match="Initial state"):
        twin.simulate(test, initial_state=[0.5])


def test_a_run_under_recorded_commands_is_that_of_the_controller_that_gave_them(
    family, model, pendulum_signals
):
    run = fly(model, led(family, ROWS))
    again = fly(model, tl.Replay(pendulum_signals, run.states[0], run.commands))
    assert same_bits(again.states, run.states) and same_bits(again.commands, run.commands)


@given(st.integers(0, 2**32 - 1))
def test_a_run_under_commands_is_step_after_step_with_lags_and_all(seed):
    signals = PLANT.signals
    program = pendulum_of(signals).program
    lagging = _core.Model(program, "acceleration", signals.engine, [(0.08, 2, None, 0.0)], [])
    draw = np.random.default_rng(seed)
    commands = draw.uniform(-3.0, 3.0, (30, 1))
    twin = tl.Twin(lagging, signals)
    found = twin.simulate_commands([0.3, 0.0], commands)
    # What stood in for it: a controller of no gains, whose excitation the commands were.
    nothing = PID(axes=[("angle", None)], gains=CONTROLLER.gains, output=Mixer(np.zeros((1, 1)))).bind(
        signals
    )
    test = tl.Test(nothing, np.zeros(3), [0.3, 0.0], [0.3, 0.0], 30, excitation=commands)
    expected = fly(lagging, test)
    assert same_bits(found.states, expected.states) and same_bits(found.commands, expected.commands)
    assert np.abs(found.commands).max() <= 2.0


def test_commands_of_another_shape_are_refused(model, pendulum_signals):
    twin = tl.Twin(model, pendulum_signals)
    assert len(twin.simulate_commands([0.1, 0.2], np.empty((0, 1))).states) == 1
    for state, commands in (([0.1], [[0.0]]), ([0.1, 0.2], [[0.0, 1.0]])):
        with pytest.raises(tl.InvalidInput):
            twin.simulate_commands(state, commands)
    with pytest.raises(tl.InvalidInput, match="at least one row"):
        tl.Replay(pendulum_signals, np.zeros(2), np.empty((0, 1)))


# Records beside tests


@given(
    st.lists(st.tuples(st.booleans(), st.integers(1, 40)), min_size=1, max_size=20), st.integers(0, 2**32 - 1)
)
def test_records_and_tests_are_judged_side_by_side_as_one_by_one(kinds, seed):
    signals, draw = PLANT.signals, np.random.default_rng(seed)
    model, family = pendulum_of(signals), CONTROLLER.bind(signals)
    none = _core.SelectedTests(Limits(signals).setting(family.engine))
    selected, alone, oracle = none, [], []
    for recorded, steps in kinds:
        states, commands = draw.normal(size=(steps + 1, 2)), draw.uniform(-4.0, 4.0, (steps, 1))
        test = tl.Test(family, [2.0, 2.0, 0.3], states[0], [1.0, 0.0], steps)

        def entered(into, recorded=recorded, test=test, states=states, commands=commands):
            if recorded:
                return into.with_record(states, commands)
            return into.with_test(test.genes, test.target_state, states, commands)

        selected = entered(selected)
        alone.append(closed_loop([model], entered(none), WORKERS)[0, 0])
        free = fly(model, tl.Replay(signals, states[0], commands) if recorded else test)
        whole = len(free.states) == steps + 1
        oracle.append(np.square(free.states - states)[1:].mean() if whole else np.inf)
    found = closed_loop([model], selected, WORKERS)[0]
    assert same_bits(found, np.array(alone))
    np.testing.assert_allclose(found, oracle, rtol=1e-12)


@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_runs_under_the_same_commands_in_several_draws_are_those_of_each_draw(count, seed):
    signals, draw = PLANT.signals, np.random.default_rng(seed)
    model, replay = pendulum_of(signals), tl.Replay(signals, [0.3, 0.0], draw.uniform(-4.0, 4.0, (15, 1)))
    noise, moved = draw.normal(scale=0.1, size=(count, 16, 2)), draw.normal(scale=0.1, size=(count, 15, 2))
    runs = drawn_runs(model, replay, Limits(signals), noise=noise, disturbance=moved)
    for k in range(count):
        one = fly(model, replay, noise=noise[k], disturbance=moved[k])
        assert same_bits(runs.measured[k][: len(one.states)], one.states)
    state = np.array([0.3, 0.0])
    for command, gust in zip(replay.commands, moved[0], strict=True):
        state = model.step(state[np.newaxis], command[np.newaxis])[0] + gust
    if runs.lasted[0] == 15:
        assert same_bits(runs.states[0, -1], state) and same_bits(runs.commands[0], replay.commands)


def test_only_what_the_engine_has_flies_a_replay(pendulum_signals):
    replay = tl.Replay(pendulum_signals, np.zeros(2), np.ones((3, 1)))
    with pytest.raises(tl.InvalidInput, match="found a function"):
        fly(lambda state, command: state, replay)
