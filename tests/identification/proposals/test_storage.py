"""Hidden states that motion fills are found where there are some, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import twinloop as tl
from sameness import same, through_json
from small_plants import gravity, lagging_motor, pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.identify import identify_runs
from twinloop.identification.proposals.storage import shows, storage
from twinloop.identification.records import Run, stages
from twinloop.identification.search.moderation import precisions
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.screen import AT_ONCE, Screen
from twinloop.identification.starts import starts
from twinloop.law.actuation import Actuation, Actuator, HiddenState

WORKERS = _core.Workers(2)
QUICK = {"moves": 4000, "starts": 2, "generations": 2, "population": 30, "committee_size": 4}
JOINT = tl.Signals(
    [tl.State("angle", "rad", 3.0), tl.State("speed", "rad/s", 10.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-1.0, 1.0))],
    0.02,
)
ROOM = tl.Signals([tl.State("air", "K", 10.0)], [tl.Command("heater", "W", (0.0, 2000.0))], 60.0)


def integrated(slope, start, commands, dt, steps=10):
    """States of a plant in fine steps of Heun's rule, (n + 1, all of them)."""
    x, states = np.array(start, dtype=float), [np.array(start, dtype=float)]
    for u in commands:
        for _ in range(steps):
            first = slope(x, u)
            second = slope(x + dt / steps * first, u)
            x = x + 0.5 * dt / steps * (first + second)
        states.append(x)
    return np.array(states)


def held(stream, steps, low, high, hold):
    return np.repeat(stream.uniform(low, high, (steps // hold + 1, 1)), hold, axis=0)[:steps]


def joint(seed, noise=1.0, steps=160):
    """A motor that turns a load of much friction and no mass by a spring: its twist is filled by the motor's speed."""
    stream = np.random.default_rng(seed)
    commands = held(stream, steps, -0.8, 0.8, 12)

    def slope(x, u):
        return np.array([x[1], 100.0 * u[0] - 200.0 * x[2] - 2.0 * x[1], x[1] - 5.0 * x[2]])

    states = integrated(slope, [0.0, 0.0, 0.0], commands, JOINT.dt)[:, :2]
    return Run.of(states + noise * np.array([5e-4, 5e-3]) * stream.normal(size=states.shape), commands)


def room(seed, noise=0.01):
    """Air that a heater warms, and walls that the air does; it began cold."""
    stream = np.random.default_rng(seed)
    commands = held(stream, 250, 0.0, 2000.0, 25)

    def slope(x, u):
        flow = 100.0 * (x[0] - x[1])
        return np.array([(u[0] - flow - 20.0 * x[0]) / 6e4, (flow - 40.0 * x[1]) / 8e5])

    states = integrated(slope, [0.0, 0.0], commands, ROOM.dt)[:, :1]
    return Run.of(states + noise * stream.normal(size=states.shape), commands)


def coupled(seed, noise=1.0):
    """A motor that turns a load by a spring, which nobody measures: 0.5 of its inertia, swinging at 12 rad/s."""
    stream = np.random.default_rng(seed)
    commands = held(stream, 160, -0.8, 0.8, 8)

    def slope(x, u):
        spring = 48.0 * (x[0] - x[2]) + 0.2 * (x[1] - x[3])
        return np.array([x[1], 40.0 * u[0] - 0.5 * x[1] - spring, x[3], 2.0 * spring])

    states = integrated(slope, [0.0] * 4, commands, JOINT.dt, steps=40)[:, :2]
    return Run.of(states + noise * np.array([5e-4, 5e-3]) * stream.normal(size=states.shape), commands)


def learnt(runs, signals, **changes):
    return identify_runs(runs, signals, options_of("default", {**QUICK, **changes}), workers=WORKERS)


def missed(found, signals, plant, seeds=(50, 51)):
    """Largest error of free runs that were not learnt, in scales."""
    twin, scales, errors = (
        tl.Twin(found.model, signals),
        np.array([state.scale for state in signals.states]),
        [],
    )
    for seed in seeds:
        run = plant(seed, noise=0.0)
        states = twin.simulate_commands(run.states[0], run.commands).true_states
        errors.append(
            float(np.sqrt(np.square((states - run.states) / scales).mean()))
            if len(states) == len(run.states)
            else np.inf
        )
    return max(errors)


@pytest.mark.parametrize(
    ("plant", "signals", "time", "close"), [(joint, JOINT, 0.2, 0.01), (room, ROOM, 8e5 / 140.0, 0.05)]
)
def test_what_motion_fills_is_found_and_free_runs_miss_a_tenth_at_most(plant, signals, time, close):
    runs = [plant(seed) for seed in range(3)]
    blind, found = (learnt(runs, signals, storage=storage) for storage in (False, True))
    assert not blind.actuation.stored
    (stored,) = found.actuation.hidden
    assert stored.states and not stored.commands
    assert stored.time == pytest.approx(time, rel=close)
    without, within = (missed(each, signals, plant) for each in (blind, found))
    assert within < 1e-3 and within < 0.1 * without
    twin = tl.Twin(found.model, signals, members=found.members)
    assert "d hidden / dt = (" in twin.equations(3)
    again = tl.Twin.from_record(through_json(twin.to_record()))
    assert same(again.model.hidden, found.model.hidden) and again.equations(17) == twin.equations(17)


def test_a_load_behind_a_spring_is_a_pair_that_turns():
    runs = [coupled(seed) for seed in range(2)]
    blind, found = (learnt(runs, JOINT, storage=storage) for storage in (False, True))
    first, second = found.actuation.hidden
    assert first == second and bool(first.states) != bool(first.commands)
    # The motor held, the load swings at the root of 96 rad²/s², and fades with 0.2 of its speed a second. As the torque
    # drives it, motor and load swing freely: their poles, but for that of both together.
    free = np.linalg.eigvals(
        [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [-48.0, 48.0, -0.7, 0.2], [96.0, -96.0, 0.4, -0.4]]
    )
    poles = np.roots([1.0, 0.4, 96.0]) if first.states else free[np.abs(free.imag) > 1.0]
    assert 1.0 / first.turns == pytest.approx(abs(poles[0].imag), rel=0.02)
    assert 1.0 / first.time == pytest.approx(-poles[0].real, rel=0.1)
    without, within = (missed(each, JOINT, coupled) for each in (blind, found))
    assert within < 2e-3 and within < 0.02 * without


SPEED, SHARE = 30.0, 0.5
"""Of the servo, rad/s, and of its critical damping."""


def finned(seed, noise=1.0, gusts=0.0, share=SHARE):
    """A fin behind a servo of second order, which is not logged, turns a body that a keel brings back, in gusts."""
    stream = np.random.default_rng([seed, 5])
    commands = held(stream, 200, -0.8, 0.8, 8)
    blown = gusts * np.random.default_rng([seed, 6]).normal(size=commands.shape)

    def slope(x, u):
        turned = SPEED * SPEED * (u[0] - x[2]) - 2.0 * share * SPEED * x[3]
        return np.array([x[1], 60.0 * x[2] - 4.0 * x[1] - 9.0 * x[0] + u[1], x[3], turned])

    given = np.concatenate([commands, blown], axis=1)
    states = integrated(slope, [0.0] * 4, given, JOINT.dt, steps=20)[:, :2]
    return Run.of(states + noise * np.array([5e-4, 5e-3]) * stream.normal(size=states.shape), commands)


def sprung(seed, noise=1.0):
    """A link on a spring whose other end a motor turns, of which no sensor reads anything."""
    stream = np.random.default_rng([seed, 6])
    commands = held(stream, 250, -0.8, 0.8, 10)

    def slope(x, u):
        twist = 40.0 * (x[0] - x[2]) + 0.1 * (x[1] - x[3])
        return np.array([x[1], (-twist - 0.1 * x[1]) / 0.1, x[3], (twist + 4.0 * u[0] - 0.2 * x[3]) / 0.05])

    states = integrated(slope, [0.0] * 4, commands, JOINT.dt, steps=40)[:, :2]
    return Run.of(states + noise * np.array([5e-4, 5e-3]) * stream.normal(size=states.shape), commands)


def test_a_servo_that_no_sensor_reads_is_a_pair_that_its_command_drives():
    runs = [finned(seed) for seed in range(2)]
    blind, found = (learnt(runs, JOINT, storage=storage) for storage in (False, True))
    first, second = found.actuation.hidden
    assert first == second and first.commands == (0,) and not first.states
    assert 1.0 / first.turns == pytest.approx(SPEED * np.sqrt(1.0 - SHARE * SHARE), rel=0.05)
    assert 1.0 / first.time == pytest.approx(SHARE * SPEED, rel=0.05)
    without, within = (missed(each, JOINT, finned) for each in (blind, found))
    assert within < 2e-3 and within < 0.1 * without
    # One of the two alone is nothing that a later search could begin with.
    options = options_of("default", QUICK)
    later = identify_runs([*runs, finned(2)], JOINT, options, earlier=found, iteration=1, workers=WORKERS)
    assert later.actuation.hidden and all(
        one.commands == (0,) and one.turns for one in later.actuation.hidden
    )


def test_a_servo_that_hardly_swings_is_believed_only_where_it_leaves_nothing_but_noise(monkeypatch):
    """What states feed back answers for as long; gusts as large hide which of the two it is."""

    def found(gusts):
        runs = [finned(seed, gusts=gusts, share=0.8) for seed in range(2)]
        return any(one.commands and one.turns for one in learnt(runs, JOINT).actuation.hidden)

    assert found(0.0) and not found(2.0)
    monkeypatch.setattr("twinloop.identification.proposals.storage.LEFT", np.inf)
    assert found(2.0)


def test_a_motor_at_the_other_end_of_a_spring_is_found_by_its_link_alone():
    runs = [sprung(seed) for seed in range(2)]
    blind, found = (learnt(runs, JOINT, storage=storage) for storage in (False, True))
    assert any(one.commands and one.turns for one in found.actuation.stored)
    without, within = (missed(each, JOINT, sprung) for each in (blind, found))
    assert within < 0.1 * without


def back_emf(seed, noise=1.0):
    """A pendulum on a motor whose current lags by 0.15 s behind its voltage, less what its speed induces."""
    stream = np.random.default_rng([seed, 77])
    start = [stream.uniform(-0.4, 0.4), 0.0, 0.0]
    commands = held(stream, 300, -1.0, 1.0, 6)

    def slope(x, u):
        return np.array(
            [x[1], 4.0 * x[2] - 9.0 * np.sin(x[0]) - 0.5 * x[1], (u[0] - x[2] - 0.8 * x[1]) / 0.15]
        )

    states = integrated(slope, start, commands, DRIVEN.dt, steps=20)[:, :2]
    return Run.of(states + noise * np.array([3e-4, 2e-3]) * stream.normal(size=states.shape), commands)


DRIVEN = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("speed", "rad/s", 2.5, derivative_of="angle")],
    [tl.Command("voltage", "V", (-1.0, 1.0))],
    0.04,
)


def test_what_is_stored_is_found_that_a_lasting_disturbance_would_explain():
    found = learnt([back_emf(seed) for seed in (1, 2)], DRIVEN)
    current = found.actuation.hidden
    assert {(state.commands, state.states) for state in current} == {((0,), ()), ((), (1,))}
    assert [state.time for state in current] == pytest.approx([0.15, 0.15], rel=0.03)
    assert all(actuator.lag == 0.0 for actuator in found.actuation.actuators)
    assert missed(found, DRIVEN, back_emf) < 2e-3


def swinging(seed):
    return swung(gravity, seed, noise=1e-3)


def rubbing(seed):
    return swung(lambda angle, rate, u: 5.0 * u - 0.4 * rate - 1.5 * np.tanh(rate / 0.02), seed, noise=1e-3)


def lagging(seed):
    stream = np.random.default_rng(seed)
    commands = held(stream, 150, -2.0, 2.0, 8)
    return lagging_motor(commands, 0.02, 0.06, lambda u: 3.0 * u, stream)


MOTOR = tl.Signals([tl.State("speed", "rad/s", 5.0)], [tl.Command("volt", "V", (-2.0, 2.0))], 0.02)


@pytest.mark.parametrize(
    ("plant", "signals"), [(swinging, pendulum_like()), (rubbing, pendulum_like()), (lagging, MOTOR)]
)
def test_nothing_is_found_where_motion_fills_nothing(plant, signals):
    for first in (0, 10):
        assert not learnt([plant(first + i) for i in range(3)], signals).actuation.stored


def test_one_long_run_shows_what_several_do():
    wide = replace(JOINT, states=(replace(JOINT.states[0], scale=40.0), JOINT.states[1]))
    found = learnt([joint(0, steps=1000)], wide)
    (stored,) = found.actuation.hidden
    assert stored.states and stored.time == pytest.approx(0.2, rel=0.01)


def test_one_short_run_shows_no_storage_and_neither_do_increments():
    options = options_of("default", QUICK)
    for runs, form in (([joint(0)], "acceleration"), ([joint(0), joint(1)], "increment")):
        context = Context(runs, JOINT, options, Unit(0), WORKERS)
        start = starts(context, form)[0]()
        assert list(storage(context, fitted(context, start))) == []


def test_what_is_tried_beside_others_is_what_is_tried_alone():
    context = Context([joint(0), joint(1)], JOINT, options_of("default", QUICK), Unit(0), WORKERS)
    start = fitted(context, starts(context, "acceleration")[0]())
    several = [
        (HiddenState((), False, 0.0, time, (1,), settled),)
        for time in (0.05, 0.2)
        for settled in (False, True)
    ]
    turning = HiddenState((), False, 0.0, 1.0, (0,), False, 0.1)
    several += [(), (turning, turning), (HiddenState((0,), False, 0.0, 0.2), *several[2])] * 8
    assert len(several) > AT_ONCE
    at_once, screen = Screen.of(context, start, 0)(several), Screen.of(context, start, 0)
    alone = [one for sources in several for one in screen([sources])]
    assert len({found.evidence.length for found in at_once}) > 3
    for one, other, sources in zip(at_once, alone, several, strict=True):
        assert one.actuation.hidden == other.actuation.hidden == sources
        # As a search of its own has it, with all that its terms are worth.
        problem = Problem(context, one)
        for found, twin in zip(one.sums, other.sums, strict=True):
            assert found.weights == twin.weights and found.description_length == twin.description_length
            regression = problem.regression(found.chain, problem.values(problem.usable(list(found.weights))))
            gram = regression.gram(found.chain.sensors, found.chain.motion, WORKERS)
            prior = precisions(problem, found.chain, list(found.weights))
            best, _, _ = gram.with_prior(prior).solve(range(len(found.weights)))
            np.testing.assert_allclose(list(found.weights.values()), best, rtol=1e-6)


def test_an_angle_that_wraps_fills_nothing():
    wrapping = tl.Signals(
        [replace(JOINT.states[0], periodic=True), JOINT.states[1]], JOINT.commands, JOINT.dt
    )
    found = learnt([joint(seed) for seed in range(3)], wrapping)
    assert all(0 not in one.states for one in found.actuation.hidden)


def test_regressions_see_what_a_free_run_of_the_law_stores():
    """h by the readings of a run without noise is h of the law that made it."""
    for settled in (False, True):
        stored = HiddenState((), False, 0.5, 0.3, (1,), settled)
        text = "program inputs=4 outputs=1 registers=6\npage 1\nr4 = r3 * 1.0\n"
        model = _core.Model(_core.Program.parse(text), "acceleration", JOINT.engine, [Actuator()], [stored])
        # The speed that h drives tells what h was: it is its slope.
        commands = np.zeros((400, 1))
        states = tl.Twin(model, JOINT).simulate_commands([0.1, 3.0], commands).true_states
        seen = stages([Run.of(states, commands)], JOINT, Actuation((Actuator(),), (stored,)))
        kept, h = np.array([[0.0, 1.0], [0.1, -1.0 / 0.3]]), 0.3 * (0.3 - 0.5) * settled
        # d (v, h) / dt = (h, v / 10 − 0.5 − h / 0.3), solved by its eigenvalues.
        values, vectors = np.linalg.eig(np.array([[0.0, 1.0], [0.1, -1.0 / 0.3]]))
        rest = -np.linalg.solve(kept, np.array([0.0, -0.5]))
        weights = np.linalg.solve(vectors, np.array([3.0, h]) - rest)
        times = np.arange(400) * JOINT.dt
        exact = (rest[:, None] + vectors @ (weights[:, None] * np.exp(values[:, None] * times))).real
        np.testing.assert_allclose(states[:-1, 1], exact[0], atol=2e-6)
        np.testing.assert_allclose(seen.start[:, 3], exact[1], atol=2e-6)


def test_regressions_see_what_a_pair_that_turns_does():
    one = HiddenState((), False, 0.5, 0.3, (1,), True, 0.08)
    stream = np.random.default_rng(0)
    times = np.arange(401) * JOINT.dt
    speed = 3.0 * np.sin(1.7 * times) + np.cos(0.6 * times)
    states = np.stack([-3.0 / 1.7 * np.cos(1.7 * times) + np.sin(0.6 * times) / 0.6, speed], axis=1)
    seen = stages([Run.of(states, stream.normal(size=(400, 1)))], JOINT, Actuation((Actuator(),), (one, one)))
    rates = np.array([[1.0 / 0.3, 1.0 / 0.08], [-1.0 / 0.08, 1.0 / 0.3]])

    def slope(t, h):
        return (3.0 * np.sin(1.7 * t) + np.cos(0.6 * t)) / 10.0 - 0.5 - rates @ h

    begun = np.linalg.solve(rates, [speed[0] / 10.0 - 0.5] * 2)
    exact = solve_ivp(slope, (0.0, times[-1]), begun, t_eval=times, rtol=1e-10, atol=1e-12).y.T
    np.testing.assert_allclose(seen.start[:, 3:], exact[:-1], atol=2e-5)
    np.testing.assert_allclose(seen.end[:, 3:], exact[1:], atol=2e-5)


def test_regressions_see_what_a_servo_does():
    one = HiddenState((0,), False, 0.25, 0.1, turns=0.04)
    stream = np.random.default_rng(0)
    commands = held(stream, 60, -1.0, 1.0, 5)
    run = Run.of(np.zeros((61, 2)), commands)
    seen = stages([run], JOINT, Actuation((Actuator(),), (one, one)))
    rates, h = np.array([[10.0, 25.0], [-25.0, 10.0]]), np.zeros(2)
    for k, u in enumerate(commands):
        np.testing.assert_allclose(seen.start[k, 3:], h, atol=1e-4)
        # Held over a period the command fills it exactly.
        rest = np.linalg.solve(rates, [u[0] - 0.25] * 2)
        h = rest + expm(-rates * JOINT.dt) @ (h - rest)
        np.testing.assert_allclose(seen.end[k, 3:], h, atol=1e-4)


@pytest.mark.parametrize(("time", "shown"), [(0.039, False), (0.041, True)])
def test_a_servo_may_be_damped_well(time, shown):
    assert shows([HiddenState((0,), False, 0.0, time, turns=0.08)] * 2, 0.02) is shown
    assert not shows([HiddenState((), False, 0.0, time, (0,), turns=0.08)] * 2, 0.02)


def test_a_hypothesis_with_storage_comes_back_from_its_record():
    options = options_of("default", QUICK)
    context = Context([joint(0), joint(1)], JOINT, options, Unit(0), WORKERS)
    best = fitted(context, starts(context, "acceleration")[0]())
    found = list(storage(context, best))
    assert found and all(one.actuation.stored for one in found)
    record = through_json(found[0].to_record())
    assert same(Hypothesis.from_record(record, JOINT), found[0])


@pytest.mark.parametrize(
    ("states", "time", "shown"), [((0,), 0.019, False), ((0,), 0.02, True), ((), 0.019, True)]
)
def test_what_motion_fills_and_a_period_empties_is_no_state(states, time, shown):
    quick = HiddenState((0,) if not states else (), False, 0.0, time, states, False)
    slow = HiddenState((), False, 0.0, 0.5, (1,), False)
    assert shows((slow, quick), 0.02) is shown
    for turns, swings in ((0.2, False), (0.1, True)):
        assert shows((slow._replace(turns=turns),) * 2, 0.02) is swings
    assert shows((), 0.02)
