"""The numbers behind the report's figures, beside SciPy, python-control and formulas written slowly."""

import hashlib
import itertools
import math
from types import SimpleNamespace

import control
import numpy as np
import pytest
import scipy.signal

import lives
import twinloop as tl
from conftest import pendulum_step
from law_twins import SWINGING, twin_of
from twinloop._experiment.envelope import usages_of
from twinloop.campaign.examination.data import fingerprint
from twinloop.campaign.examination.frequency import frequency_responses
from twinloop.campaign.examination.loops import loops_around, noise_of_commands
from twinloop.campaign.examination.poles import poles
from twinloop.campaign.examination.steps import moved_states, step_answer
from twinloop.campaign.examination.use import effort, envelope_use, gain_slopes, outside_of
from twinloop.faces.figures.use import gains
from twinloop.faces.report.tables.controller import margins as margins_table
from twinloop.faces.report.tables.twin import closed_poles
from twinloop.faces.report.tables.twin import poles as tables_of_poles
from twinloop.objectives import normalised_error

STREAM = np.random.default_rng(11)


@pytest.fixture(scope="module")
def good():
    return lives.learnt(pendulum_step, 4)


# Frequency responses


def test_a_single_response_is_that_of_scipy_with_its_coherence():
    u = STREAM.normal(size=(1024, 1))
    b, a = scipy.signal.butter(2, 0.3)
    y = scipy.signal.lfilter(b, a, u, axis=0) + 0.1 * STREAM.normal(size=(1024, 1))
    found = frequency_responses([u], [y], 0.1)
    settings = {"fs": 10.0, "window": "hann", "nperseg": 128, "noverlap": 64, "detrend": "constant"}
    f, cross = scipy.signal.csd(u[:, 0], y[:, 0], **settings)
    _, power = scipy.signal.welch(u[:, 0], **settings)
    _, coherence = scipy.signal.coherence(u[:, 0], y[:, 0], **settings)
    assert found.frequencies == pytest.approx(2 * np.pi * f[1:-1])
    assert found.gains[:, 0, 0] == pytest.approx((cross / power)[1:-1], rel=1e-6)
    count = 1024 // 64 - 1
    by_chance = 1 - (1 - coherence[1:-1]) * count / (count - 1)
    assert found.coherence[:, 0] == pytest.approx(np.clip(by_chance, 0, 1), abs=1e-6)


def test_two_inputs_are_told_apart_and_noise_is_not_coherent():
    u = STREAM.normal(size=(4096, 2))
    u[:, 1] += 0.5 * u[:, 0]
    filters = [scipy.signal.butter(1, 0.2), scipy.signal.butter(1, 0.5)]
    parts = [scipy.signal.lfilter(b, a, u[:, i]) for i, (b, a) in enumerate(filters)]
    y = np.stack([parts[0] - 2.0 * parts[1], STREAM.normal(size=4096)], axis=1)
    found = frequency_responses([u[:2048], u[2048:]], [y[:2048], y[2048:]], 1.0)
    for i, (factor, (b, a)) in enumerate(zip((1.0, -2.0), filters, strict=True)):
        _, true = scipy.signal.freqz(b, a, found.frequencies)
        assert np.abs(found.gains[:, 0, i] - factor * true).max() < 0.25
    assert np.median(found.coherence[:, 0]) > 0.99
    assert (found.coherence[:, 1] < found.needed).all()


def test_what_sensors_explain_is_held_against_the_coherence():
    u = 1e-3 * STREAM.normal(size=(1024, 1))
    noise = STREAM.normal(size=(1024, 1))
    fed_back = u - 2.0 * noise  # a controller that answers to its sensor's noise: coherent, and no plant
    without = frequency_responses([fed_back], [noise], 0.1)
    known = frequency_responses([fed_back], [noise], 0.1, np.ones(1))
    assert (without.coherence > 0.9).all()
    assert (known.coherence < known.needed).mean() > 0.9
    assert frequency_responses([u[:20]], [noise[:20]], 0.1) is None


# Loops


def python_control_loop(loops):
    """Plant and controller as state spaces of python-control: u = C(x + noise) + what is added to the commands."""
    plant, law = loops.plant, loops.controller
    seen = plant.C[: law.D.shape[1]]
    P = control.ss(plant.A, plant.B, seen, np.zeros((len(seen), plant.B.shape[1])), plant.dt)
    K = control.ss(law.A, law.B, law.C, law.D, plant.dt)
    return P, K


def test_closed_loops_and_what_noise_does_are_those_of_python_control(good):
    loops = loops_around(good.twin, good.setup, good.best_test.genes, "axes")[0][0]
    P, K = python_control_loop(loops)
    frequencies = np.array([0.5, 3.0, 20.0])
    to_commands, to_states = loops.closed(frequencies)
    noise = control.feedback(K, P, sign=1)
    disturbed = control.feedback(P, K, sign=1)
    for i, w in enumerate(frequencies):
        point = np.exp(1j * w * good.signals.dt)
        assert to_commands[i] == pytest.approx(np.atleast_2d(noise(point)), rel=1e-6)
        assert to_states[i] == pytest.approx(
            np.atleast_2d(disturbed(point)).reshape(to_states[i].shape), rel=1e-6
        )
    # The variance that white noise causes: Lyapunov's equation.
    sensors = np.array([1e-3, 5e-3])
    W = scipy.linalg.solve_discrete_lyapunov(noise.A, noise.B @ np.diag(sensors**2) @ noise.B.T)
    variance = noise.C @ W @ noise.C.T + noise.D @ np.diag(sensors**2) @ noise.D.T
    assert noise_of_commands(loops, sensors) == pytest.approx(np.sqrt(np.diag(variance)), rel=1e-3)


def test_curves_of_a_loop_reach_the_sensitivity_of_its_margins(good):
    found = good.examine()
    assert len(found.loops) == good.signals.n_u
    for curves, margins in zip(found.loops, found.margins.nominal, strict=True):
        assert curves.sensitivity[0].max() == pytest.approx(margins.sensitivity, rel=0.02)
        assert len(curves.open) == 1 + len(good.twin.members)


def test_what_is_drawn_of_a_twin_with_dry_friction_is_first_how_it_slides_then_how_it_sticks(good):
    strong = [line.replace("r2 * 5.0", "r2 * 25.0") for line in SWINGING]
    swings = [*strong, "r5 = r1 * 40.0", "r5 = tanh(r5)", "r5 = r5 * 0.5", "r3 = r3 - r5"]
    found = good.examine()
    found.twin = twin_of(swings, signals=good.signals, inputs=3)
    for free, slope in ((found.sliding_open_poles, 0.4), (found.open_poles, 0.4 + 40.0 * 0.5)):
        pull = 9.0 * math.cos(found.setup.final_target[0])
        expected = poles(np.linalg.eigvals([[0.0, 1.0], [-pull, -slope]]))
        assert [pole.real for pole in free] == pytest.approx([pole.real for pole in expected])
    slides, sticks = found.sliding_closed_poles, found.closed_poles
    assert sum(pole.damping for pole in slides) < sum(pole.damping for pole in sticks)
    (curves,), (margins,) = found.loops, found.margins.nominal
    assert len(curves.open) == len(found.responses[0].twin) == 2
    assert margins.friction == "sliding"
    assert curves.sensitivity[0].max() == pytest.approx(margins.sensitivity, rel=0.02)
    tables = [table.title for table in (*tables_of_poles(found, True), *closed_poles(found))]
    assert [title.rpartition(" ")[2] for title in tables] == ["sticking", "sliding"] * 2
    assert margins_table(found).head[-1] == "dry friction"
    assert {row[-1] for row in margins_table(found).rows} == {"sliding"}


def test_poles_are_read_with_their_damping_and_time():
    wn, zeta = 4.0, 0.3
    A = np.array([[0.0, 1.0, 0.0], [-(wn**2), -2 * zeta * wn, 0.0], [0.0, 0.0, 2.0]])
    for found in (poles(np.linalg.eigvals(A)), poles(np.linalg.eigvals(scipy.linalg.expm(0.01 * A)), 0.01)):
        grows, swings = found
        assert (grows.time, grows.damping) == (pytest.approx(-0.5), pytest.approx(-1.0))
        assert swings.frequency == pytest.approx(wn) and swings.damping == pytest.approx(zeta)
        assert swings.time == pytest.approx(1.0 / (zeta * wn))


@pytest.mark.parametrize("unit", [1e-10, 1e3, 1e11])
def test_poles_are_the_same_whatever_the_unit_of_time(unit):
    values = np.array([-1.0 + 2.0j, -1.0 - 2.0j, 0.0])
    for found in (poles(values * unit), poles(np.exp(0.01 * values), 0.01 / unit)):
        rests, swings = found
        assert (rests.damping, rests.time) == (1.0, math.inf)
        assert swings.damping == pytest.approx(1.0 / math.sqrt(5.0)) and swings.time * unit == pytest.approx(
            1.0
        )


def test_what_is_over_within_a_period_has_no_rate():
    (slow,) = poles(np.array([0.5, 4e-8 + 1e-8j, 4e-8 - 1e-8j, -1e-6]), 0.02)
    assert slow.time == pytest.approx(0.02 / math.log(2.0))


# Steps, use, data


def test_a_step_is_answered_as_python_control_says():
    wn, zeta = 3.0, 0.4
    t = np.linspace(0.0, 8.0, 4001)
    system = control.tf([wn**2], [1, 2 * zeta * wn, wn**2])
    _, y = control.step_response(system, t)
    info = control.step_info(system, T=t, SettlingTimeThreshold=0.05)
    found = step_answer("x", t, 1.0 - 2.0 * y, 1.0, -1.0)
    assert found.rise == pytest.approx(info["RiseTime"], abs=0.01)
    assert found.overshoot == pytest.approx(info["Overshoot"] / 100, abs=1e-3)
    assert found.overshoot == pytest.approx(math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), abs=1e-3)
    assert found.settling == pytest.approx(info["SettlingTime"], abs=0.01)
    cut = step_answer("x", t[:300], 1.0 - 2.0 * y[:300], 1.0, -1.0)
    assert (cut.rise, cut.settling) == (None, None)
    assert moved_states(np.zeros(3), np.array([0.0, 1.0, -1e-9]), [1.0, 1.0, 1.0]) == [1]


def test_effort_and_envelope_are_counted_number_by_number(good):
    run, signals = good.experiments[1].trajectory, good.signals
    (found,) = effort(run, signals)
    low, high = signals.commands[0].bounds
    places = [(u - 0.5 * (low + high)) / (0.5 * (high - low)) for u in run.commands[:, 0].tolist()]
    assert found.used == pytest.approx(math.sqrt(sum(p * p for p in places) / len(places)))
    assert found.saturated == sum(abs(p) >= 1 - 1e-6 for p in places) / len(places)
    steps = [b - a for a, b in itertools.pairwise(places)]
    assert found.moved == pytest.approx(math.sqrt(sum(s * s for s in steps) / len(steps)))
    ((name, most),) = envelope_use(run.states, signals)
    assert name == "rate" and most == pytest.approx(max(abs(x) for x in run.states[:, 1]) / 12.0)


def test_an_angle_that_wraps_uses_its_envelope_the_short_way_round():
    signals = tl.Signals(
        [tl.State("turn", "rad", 1.0, envelope=(2.0, 4.0), periodic=True), tl.State("rest", "m", 1.0)],
        [tl.Command("torque", "N m", (-1.0, 1.0))], 0.1,
    )  # fmt: skip
    states = np.array([[3.0, 9.0], [3.5 - 2.0 * math.pi, 9.0]])
    ((name, most),) = envelope_use(states, signals)
    assert name == "turn" and most == pytest.approx(0.5) == usages_of(signals, states).max()


def test_what_lies_outside_of_what_was_flown_is_counted():
    flown = np.array([[0.0, 0.0], [1.0, 2.0]])
    assert outside_of(flown, np.array([[0.5, 1.0], [1.1, 1.0], [0.5, -0.1], [1.0, 2.0]])) == 0.5


def test_a_fingerprint_is_the_hash_of_the_numbers(good):
    run = good.experiments[0]
    numbers = [*run.trajectory.t, *run.trajectory.states.ravel(), *run.trajectory.commands.ravel()]
    digest = hashlib.sha256(b"".join(np.float64(x).tobytes() for x in numbers)).hexdigest()
    assert fingerprint(run) == digest[:16]


# What was learnt


def test_the_map_of_errors_holds_those_of_learnt_flights_and_of_those_to_come(good):
    found = good.examine()
    table = found.errors
    assert table.learnt.tolist() == [[column >= row for column in range(4)] for row in range(4)]
    last = np.array([row.normalised for row in good.twin.errors])
    assert table.values[:, -1] == pytest.approx(last, rel=1e-9)
    for place in (1, 2, 3):  # as the campaign counted before it had learnt them
        run = good.experiments[place]
        assert table.values[place, place - 1] == pytest.approx(
            normalised_error(run.before, run.frozen), rel=1e-6
        )


def test_the_chosen_equations_stand_among_their_rivals(good):
    rivals = good.examine().rivals
    chosen = [rival for rival in rivals if rival.chosen]
    assert [rival.state for rival in chosen] == ["rate"]
    assert all(rival.above > 0.0 for rival in rivals if not rival.chosen)
    assert any("sin" in term for term in chosen[0].terms)


def test_gains_are_changed_one_at_a_time_within_their_box(good):
    found = good.examine()
    best = found.best
    for i, slope in enumerate(found.slopes):
        gain = good.family.gains[i]
        assert slope.value == best.genes[i]
        for change, quality in zip(slope.changes, slope.qualities, strict=True):
            assert (quality is None) == (not gain.low <= slope.value + change * slope.size <= gain.high)
        genes = best.genes.copy()
        genes[i] *= 0.9
        test = good.test(genes, excitation=None)
        flown = good.twin.simulate(test)
        assert slope.qualities[1] == pytest.approx(
            good.setup.quality.flown(flown, test.target_state), rel=1e-6
        )


def test_a_gain_that_is_hardly_more_than_0_is_changed_as_one_of_0(good):
    """± 20 % of 6e-5 of a range of 6 is nothing, too, and the quality may hang on the range."""
    found = good.examine()
    place = [gain.name for gain in good.family.gains].index("angle.ki")
    gain = good.family.gains[place]
    span = gain.high - gain.low
    for share, of_range in ((1e-5, True), (0.009, True), (0.011, False)):
        best = good.test({**found.best.parameters, "angle.ki": share * span}, excitation=None)
        slope = gain_slopes(good.twin, good.setup, best)[place]
        assert slope.of_range == of_range and slope.size == pytest.approx(span if of_range else share * span)
        if of_range:
            there = [quality for quality in slope.qualities if quality is not None]
            assert max(there) > 1.01 * min(there)


def test_a_gain_of_0_is_changed_by_a_share_of_its_range(good):
    """± 20 % of 0 is nothing: a flat line would say that the gain need not be exact."""
    found = good.examine()
    names = [gain.name for gain in good.family.gains]
    place = names.index("angle.kd")
    gain = good.family.gains[place]
    best = good.test({**found.best.parameters, "angle.kd": 0.0}, excitation=None)
    slope = gain_slopes(good.twin, good.setup, best)[place]
    assert slope.of_range and slope.size == gain.high - gain.low
    genes = best.genes.copy()
    genes[place] = slope.changes[-1] * slope.size
    flown = good.twin.simulate(good.test(genes, excitation=None))
    expected = good.setup.quality.flown(flown, best.target_state)
    assert slope.qualities[-1] == pytest.approx(expected, rel=1e-6) and expected != slope.qualities[2]
    figure = gains(SimpleNamespace(slopes=(slope,), setup=good.setup))
    assert figure.panels[0].x_label == "change of the gain (% of its range)"
    assert "A gain below 1 % of its range is changed by shares of the range" in figure.caption
