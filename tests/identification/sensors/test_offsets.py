"""Sensors that are late or early: whether the offset is found, is taken out, and is 0 where there is none."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import twinloop as tl
from late_sensors import BODY, DT, PENDULUM, flown, loop_of, read, swinging, turning
from oracles import same_bits
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.behind_a_law import that_hold
from twinloop.identification.sensors.chains import chains
from twinloop.identification.sensors.offsets import late_groups, moved, search_offsets
from twinloop.identification.starts import ANEW, begun

WORKERS = _core.Workers()
FAST = {"moves": 2000, "starts": 2, "generations": 0, "lags": False, "committee_size": 3, "tuning_steps": 8}


def offsets_of(runs, signals):
    scales = np.array([state.scale for state in signals.states])
    every = chains(signals, "acceleration", guessed_noise(runs, scales))
    return search_offsets(runs, signals, every, scales, WORKERS)


def learnt(runs, signals, **changes):
    return identify_runs(runs, signals, options_of("default", {**FAST, **changes}), workers=WORKERS)


SYSTEMS = [(swinging, PENDULUM, [0]), (turning, BODY, [0, 1, 2])]


@pytest.mark.parametrize(("law", "signals", "angles"), SYSTEMS)
@pytest.mark.parametrize("late", [0.3 * DT, -0.2 * DT, 0.7 * DT])
def test_the_offset_of_a_group_is_found_and_taken_out(law, signals, angles, late):
    run, true = (read(law, signals, 1, offset, noise) for offset, noise in ((late, 1e-3), (0.0, 0.0)))
    found = offsets_of([run], signals)
    expected = np.where(np.isin(range(signals.n_x), angles), late, 0.0)
    np.testing.assert_allclose(found, expected, atol=0.04 * DT)
    again = moved([read(law, signals, 1, late, 0.0)], signals, expected)[0]
    n = len(true.states)
    error = np.abs(again.states - true.states)[1 : n - 1]
    assert error.max() < 0.03 * np.abs(read(law, signals, 1, late, 0.0).states - true.states).max()


@pytest.mark.parametrize(("law", "signals", "angles"), SYSTEMS)
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3, 1e-2])
def test_no_offset_is_found_where_there_is_none(law, signals, angles, noise):
    for seed in range(4):
        assert not offsets_of([read(law, signals, seed, 0.0, noise)], signals).any()


def test_an_outlier_is_no_offset():
    for place, size in ((40, 4.0), (70, -2.0)):
        for state in range(2):
            run = read(swinging, PENDULUM, 2)
            run.states[place, state] += size
            assert not offsets_of([run], PENDULUM).any()


def constants(found):
    return dict(zip(found.sums[0].weights, found.model.constants.tolist(), strict=True))


def test_the_law_is_learnt_as_if_all_sensors_were_read_at_once():
    runs = [read(swinging, PENDULUM, seed, 0.3 * DT) for seed in range(2)]
    on, off = (learnt(runs, PENDULUM, offsets=offsets) for offsets in (True, False))
    assert on.offsets == pytest.approx([0.3 * DT, 0.0], abs=0.02 * DT)
    assert any(
        "Readings of angle come 1" in str(r) and "later than those of rate;" in str(r) for r in on.remarks
    )
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 2)) * [1.0, 4.0]
    commands = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 1))
    expected = [
        solve_ivp(lambda _, y, u=u: swinging(y, u), (0.0, DT), x, rtol=1e-10, atol=1e-12).y[:, -1]
        for x, u in zip(rows, commands, strict=True)
    ]
    errors = [np.abs(found.model.step(rows, commands) - expected).max() for found in (on, off)]
    assert errors[0] < 0.01 and errors[1] > 3.0 * errors[0]
    assert on.misfit < 1.3 and on.description_length < off.description_length - 50.0
    assert on.sensors(2)[0] == pytest.approx(1e-3, rel=0.3)
    assert not off.offsets.any()


def test_where_none_is_found_no_bit_changes():
    runs = [read(swinging, PENDULUM, 3)]
    on, off = (learnt(runs, PENDULUM, offsets=offsets) for offsets in (True, False))
    assert (
        same_bits(on.model.constants, off.model.constants) and on.description_length == off.description_length
    )
    assert [str(m.program) for m in on.members] == [str(m.program) for m in off.members]


def test_what_was_found_is_kept_once_there_are_many_runs():
    runs = [read(swinging, PENDULUM, seed, 0.3 * DT) for seed in range(5)]
    first = learnt(runs[:2], PENDULUM)
    options = options_of("default", FAST)
    later = identify_runs(runs, PENDULUM, options, workers=WORKERS, iteration=2, earlier=first)
    assert same_bits(later.offsets, first.offsets)


@pytest.mark.parametrize("late", [(0.0, 0.01), (0.02, 0.0), (-0.03, 0.02), (0.02, -0.03), (-0.02, -0.02)])
def test_in_a_longer_chain_each_state_is_moved_along_the_one_that_drives_it(late):
    signals = tl.Signals(
        [tl.State("y", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="y"),
         tl.State("a", "m/s2", 1.0, derivative_of="v")],
        [tl.Command("u", "V", (-1.0, 1.0))],
        DT,
    )  # fmt: skip
    t = DT * np.arange(50)

    def motion(y, v, a):
        return np.stack([np.sin(2.0 * y), 2.0 * np.cos(2.0 * v), -4.0 * np.sin(2.0 * a)], axis=1)

    run = Run.of(motion(t - late[0], t - late[1], t), np.zeros((49, 1)))
    found = moved([run], signals, np.array([*late, 0.0]))[0]
    errors = [np.abs(r.states - motion(t, t, t)).max(axis=0)[:2] for r in (found, run)]
    for after, before, offset in zip(*errors, late, strict=True):
        assert after < 1e-15 if offset == 0.0 else after < 0.03 * before
    assert same_bits(found.smooth, found.states) and same_bits(run.states[:, 2], found.states[:, 2])


def test_states_share_an_offset_by_unit_and_driven_ones_have_none():
    signals = tl.Signals(
        [tl.State("y", "m", 1.0), tl.State("a", "rad", 1.0), tl.State("b", "rad", 1.0)]
        + [tl.State(f"d{of}", "1/s", 1.0, derivative_of=of) for of in "yab"]
        + [tl.State("load", "kg", 1.0)],
        [tl.Command("u", "V", (-1.0, 1.0))],
        0.1,
    )
    every = chains(signals, "acceleration", np.ones(7))
    assert late_groups(signals, every) == [[0], [1, 2]]
    assert late_groups(signals, chains(signals, "increment", np.ones(7))) == []
    assert late_groups(BODY, chains(BODY, "acceleration", np.ones(6))) == [[0, 1, 2]]


def test_what_was_found_is_flown_on_the_twin_as_well():
    runs = [read(turning, BODY, seed, 0.3 * DT, 1e-4) for seed in range(2)]
    model = learnt(runs, BODY).model
    assert model.offsets[:3] == pytest.approx([0.3 * DT] * 3, abs=0.02 * DT)
    errors = []
    stream = np.random.default_rng(7)
    for genes in stream.uniform([1.0, 0.2, 0.1], [7.0, 1.0, 1.0], (4, 3)):
        test = loop_of(BODY, genes, [0.6, -0.5, 0.8, 0.5, -1.0, 0.5])
        readings, _ = flown(turning, BODY, test, 0.3 * DT)
        for known in (model, model.with_offsets([0.0] * 6)):
            off = tl.Twin(known, BODY).simulate(test).states - readings
            errors.append(np.square(off).mean() / np.square(readings - readings[0]).mean())
    late, in_time = np.median(np.reshape(errors, (4, 2)), axis=0)
    assert late < 1e-6 and in_time > 100.0 * late


SERVO = tl.Signals(
    [
        tl.State("angle", "rad", 1.0),
        tl.State("rate", "rad/s", 4.0, derivative_of="angle"),
    ],
    [tl.Command("asked", "rad", (-1.0, 1.0))],
    DT,
)


def served(late, seed=0, n=400):
    """A servo whose rate is damped within 17 ms, read with noise; its angle is read so many seconds late."""
    draw = np.random.default_rng(seed)
    asked = np.repeat(draw.uniform(-1.0, 1.0, n // 8), 8)

    def law(t, x, u):
        return [x[1], 900.0 * (u - x[0]) - 60.0 * x[1]]

    states, angles = [np.zeros(2)], [0.0]
    for u in asked:
        run = solve_ivp(law, (0.0, DT), states[-1], args=(u,), rtol=1e-10, atol=1e-12, dense_output=True)
        angles.append(run.sol(DT - late)[0])
        states.append(run.y[:, -1])
    readings = np.array(states)
    readings[:, 0] = angles
    noise = draw.normal(size=readings.shape) * [2e-4, 2e-3]
    return Run.of(readings + noise, asked[:, None])


def behind_a_law(run, found):
    """The offsets of those found for the servo that hold behind a linear law."""
    context = Context([run.continued(SERVO)], SERVO, options_of("default", FAST), Unit(0), WORKERS)
    return that_hold(context, begun(context, "acceleration", context.first_pool(), ANEW), found)


def test_damping_within_a_period_is_no_late_sensor_once_a_law_is_there():
    for seed in range(3):
        run = served(0.0, seed)
        found = offsets_of([run], SERVO)
        assert found[0] < 0.0, "without a law the damping passes for a sensor that is early"
        assert not behind_a_law(run, found).any()


def test_a_sensor_that_is_late_is_late_behind_a_law_as_well():
    run = served(0.7 * DT)
    found = offsets_of([run], SERVO)
    assert found[0] > 0.0 and found[1] == 0.0
    np.testing.assert_array_equal(behind_a_law(run, found), found)
