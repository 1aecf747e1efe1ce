"""What a twin makes of sensors that are late or early, beside a slow simulation by SciPy that reads its own past."""

import numpy as np
import pytest

import twinloop as tl
from late_sensors import BODY, DT, PENDULUM, flown, loop_of, swinging, turning
from law_twins import SWINGING
from oracles import same_bits
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.flights import candidates, disagreements, qualities, quality
from twinloop.law.law import Law
from twinloop.law.linear.margins import closed_loops, margins_of

TURNING = [
    "r9 = r6 * 3.0", "r9 = r9 - r3",
    "r10 = r7 * 2.0", "r10 = r10 - r4", "r12 = r1 * 3.0", "r10 = r10 - r12",
    "r11 = r8 * 2.0", "r11 = r11 - r5", "r12 = r3 * r4", "r12 = r12 * 0.5", "r11 = r11 + r12",
]  # fmt: skip


def twin_of(signals, lines, offsets=(), factor=10.0):
    inputs, outputs = signals.n_x + signals.n_u, len(signals.driven)
    program = _core.Program.parse(program_text(inputs, outputs, inputs + outputs + 2, [lines]))
    model = _core.Model(program, "acceleration", signals.engine, offsets=list(offsets))
    return tl.Twin(model, signals, limits=tl.Limits(signals, factor))


def late_by(signals, late):
    return [0.0 if i in signals.driven else late for i in range(signals.n_x)]


LOOPS = {
    "pendulum": (swinging, PENDULUM, SWINGING, loop_of(PENDULUM, [2.0, 1.0, 0.1], [1.0, 0.5])),
    "body": (
        turning, BODY, TURNING, loop_of(BODY, [3.0, 0.5, 0.6], [0.6, -0.5, 0.8, 0.5, -1.0, 0.5]),
    ),
}  # fmt: skip


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize(("periods", "left"), [(0.3, 5e-4), (1.0, 5e-4), (1.6, 5e-4), (-0.2, 5e-3)])
def test_a_controller_on_the_twin_reads_what_the_sensors_read(loop, periods, left):
    law, signals, lines, test = LOOPS[loop]
    readings, states = flown(law, signals, test, periods * DT)
    run = twin_of(signals, lines, late_by(signals, periods * DT)).simulate(test)
    in_time = twin_of(signals, lines).simulate(test)
    for mine, other, expected in (
        (run.states, in_time.states, readings),
        (run.true_states, in_time.states, states),
    ):
        # What one step a period leaves is there without an offset, too.
        assert np.abs(mine - expected).max() < left * np.abs(other - expected).max() + 2e-5
    assert np.abs(in_time.states - readings).max() > 5e-3


def test_before_the_start_all_went_on_at_its_first_rates_and_the_state_of_a_reading_is_found_again():
    for periods in (0.4, 2.5, -0.7):
        for signals, lines in ((PENDULUM, SWINGING), (BODY, TURNING)):
            twin = twin_of(signals, lines, late_by(signals, periods * DT), 100.0)
            start = np.random.default_rng(3).uniform(-0.9, 0.9, signals.n_x)
            first = twin.simulate_commands(start, np.zeros((0, signals.n_u)))
            assert same_bits(first.true_states[0], start)
            np.testing.assert_allclose(twin.model.states_of(first.states)[0], start, atol=1e-12)
    pendulum = twin_of(PENDULUM, SWINGING, [0.01, 0.0]).simulate_commands([0.5, 2.0], np.zeros((0, 1)))
    assert pendulum.states[0] == pytest.approx([0.5 - 0.01 * 2.0, 2.0], abs=1e-15)


def test_a_body_is_read_where_no_pitch_is_singular():
    # Half a turn of pitch at a steady rate, through the vertical.
    twin = twin_of(BODY, [], late_by(BODY, 0.3 * DT))
    run = twin.simulate_commands([0.0, 0.3, 0.0, 0.0, 2.0, 0.0], np.zeros((60, 3)))
    late = (run.t - 0.3 * DT) * 2.0 + 0.3
    expected = np.arcsin(np.sin(late))
    np.testing.assert_allclose(np.arcsin(np.sin(run.states[:, 1])), expected, atol=1e-6)


def test_in_time_keeps_every_bit():
    for _, signals, lines, test in LOOPS.values():
        plain = twin_of(signals, lines)
        zeros = tl.Twin(plain.model.with_offsets([0.0] * signals.n_x), signals)
        assert zeros.model.offsets == []
        one, other = plain.simulate(test), zeros.simulate(test)
        assert same_bits(one.states, other.states) and same_bits(one.states, one.true_states)


def test_lanes_read_their_own_pasts():
    _, signals, lines, test = LOOPS["body"]
    model = twin_of(signals, lines, late_by(signals, 1.3 * DT)).model
    genes = test.genes * np.random.default_rng(0).uniform(0.5, 1.5, (37, len(test.genes)))

    def flown_by(rows):
        setting = Limits(signals).setting(test.family.engine)
        return _core.rollout(model, setting, rows, test.task)

    together = flown_by(genes)
    for i in (0, 5, 36):
        alone = flown_by(genes[[i]])
        assert same_bits(alone.read[0], together.read[i]) and same_bits(alone.states[0], together.states[i])


def test_planned_flights_read_late_and_are_judged_by_what_is_read_of_them():
    _, signals, lines, test = LOOPS["pendulum"]
    twins = [twin_of(signals, lines, late_by(signals, periods * DT)) for periods in (0.0, 0.6)]
    models, runs = [twin.model for twin in twins], [twin.simulate(test) for twin in twins]
    flights = candidates(
        test.family, test.genes[np.newaxis], test.initial_state, test.target_state, test.steps
    )
    measure = quality("ise", [1.0, 0.0])
    for measured in (True, False):
        found = qualities(models, flights, measure, signals, measured=measured)[0][:, 0, 0]
        shown = [run.states if measured else run.true_states for run in runs]
        assert found == pytest.approx([DT * np.square(states[1:, 0]).sum() for states in shown], rel=1e-12)
    sds = [0.1, 0.1]
    apart = (runs[0].states - runs[1].states)[1:] / 0.1
    # Of two members, the determinant is 1 plus half their squared distance.
    assert disagreements(models, flights, sds)[0][0] == pytest.approx(
        np.log1p(np.square(apart).sum() / 2.0), rel=1e-9
    )


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("periods", [0.4, 1.0, 1.7, -0.3])
def test_around_a_point_readings_are_those_of_small_departures(loop, periods):
    _, signals, lines, _ = LOOPS[loop]
    twin = twin_of(signals, lines, late_by(signals, periods * DT))
    rest, size = np.zeros(signals.n_x), 1e-6
    linear = twin.linearise(rest, np.zeros(signals.n_u), discrete=True)
    commands = size * np.random.default_rng(1).normal(size=(12, signals.n_u))
    x, expected = np.zeros(len(linear.A)), []
    for command in commands:
        x = linear.A @ x + linear.B @ command
        expected.append((linear.C @ x)[: signals.n_x])
    found = twin.simulate_commands(rest, commands).states[1:]
    np.testing.assert_allclose(found, expected, atol=1e-5 * size)
    # Where time is continuous an offset is a factor on the answer.
    frequencies = np.array([0.05, 0.5])
    instant = twin.linearise(rest, np.zeros(signals.n_u))
    slow = instant.response(frequencies) * np.exp(-0.5j * frequencies * DT)[:, np.newaxis, np.newaxis]
    np.testing.assert_allclose(linear.response(frequencies)[:, : signals.n_x], slow, rtol=2e-3, atol=1e-6)


def test_a_late_sensor_takes_from_the_margin_of_delay_what_it_is_late():
    _, signals, lines, test = LOOPS["pendulum"]
    genes = np.array([6.0, 0.0, 0.0])
    laws = [twin_of(signals, lines, [late, 0.0]).law for late in (0.0, 0.3 * DT)]
    loops = closed_loops(laws, test.family, genes, test.target_state, None, "commands")
    prompt, late = (margins_of([loop], ["torque"], "commands").nominal[0] for loop in loops)
    assert late.delay == pytest.approx(prompt.delay - 0.3 * DT, abs=0.02 * DT)


def test_what_no_sensor_can_be_is_refused():
    plain = twin_of(PENDULUM, SWINGING).model
    for offsets in ([0.0], [0.0, 0.01], [np.nan, 0.0], [1e6, 0.0]):
        with pytest.raises(ValueError, match="expected one for each of 2 states"):
            plain.with_offsets(offsets)
    late = plain.with_offsets([0.3 * DT, 0.0])
    law = Law.of(late, PENDULUM)
    assert law.offsets == (0.3 * DT, 0.0) and law.model().offsets == [0.3 * DT, 0.0]
    assert late.with_constants(late.constants, None).offsets == late.offsets
