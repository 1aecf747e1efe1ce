"""Hidden states that motion fills: simulated, linearised, printed, kept; exports that lack them say so."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import twinloop as tl
from law_twins import BODY, SIGNALS, STORED, flown, stored_twin, twin_of
from sameness import same, through_json
from twinloop.law.actuation import Actuation
from twinloop.law.exports.augmented import augmented, begun
from twinloop.law.forms import DERIVATIVES
from twinloop.law.law import Law
from twinloop.law.linear.margins import closed_loops

LINEAR = ["r6 = r0 * -3.0", "r7 = r1 * 0.4", "r6 = r6 - r7", "r7 = r2 * 5.0", "r6 = r6 + r7", "r7 = r4 * 2.0",
          "r6 = r6 + r7", "r7 = r5 * 14.0", "r6 = r6 - r7"]  # fmt: skip
STEPPED = ["r6 = r1 * 0.05", "r6 = r6 + r5", "r7 = r0 * -0.2", "r8 = r5 * 0.3", "r7 = r7 - r8", "r8 = r2 * 0.2",
           "r7 = r7 + r8"]  # fmt: skip
RNG = np.random.default_rng(4)
COMMANDS = RNG.uniform([-2.0, 0.0], [2.0, 5.0], (60, 2))


SWINGING = [((), False, 0.25, 0.4, (1,), True, 0.11, 0.0, 0.0)] * 2
"""Two that turn into each other."""


GAP = [((), False, 0.25, 0.4, (1,), False, 0.12, 0.01, 0.05)] * 2
"""What presses on a mass behind a gap, and its rate."""


SERVO = [((0, 1), False, 0.25, 0.4, (), False, 0.11, 0.0, 0.0)] * 2
"""Two that turn into each other while commands drive them."""


def pressed(twist, rate, gap=0.01, damping=0.05):
    """A spring and a damper that never pull, softened where they just touch."""
    deep = abs(twist) - gap
    return np.sign(twist) * max(0.0, min(100.0 * deep, deep + damping * np.sign(twist) * rate))


def linear_twin(form="acceleration", hidden=STORED):
    lines = LINEAR if form in DERIVATIVES else STEPPED
    return twin_of(lines, form, inputs=6, actuators=[(0.0, 0, None, 0.0)] * 2, hidden=hidden)


def test_a_free_run_is_the_solution_of_its_equations():
    twin, dt = linear_twin(), SIGNALS.dt
    angle_scale = 8.0

    def slope(u):
        def of(t, y):
            angle, rate, twisted, filled = y
            acceleration = -3.0 * angle - 0.4 * rate + 5.0 * u[0] / 2.0 + 2.0 * twisted - 14.0 * filled
            return [rate, acceleration, u[0] / 2.0 - twisted / 0.4, rate / angle_scale - 0.25 - filled / 0.4]

        return of

    found = twin.simulate_commands([0.3, 2.0], COMMANDS).true_states
    y = np.array([0.3, 2.0, 0.0, 0.4 * (2.0 / angle_scale - 0.25)])
    for state, u in zip(found[1:], COMMANDS, strict=True):
        y = solve_ivp(slope(u), (0.0, dt), y, rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(state, y[:2], atol=2e-5)


def test_two_that_turn_into_each_other_are_a_mass_on_a_spring():
    twin = linear_twin(hidden=SWINGING)
    fades, turns = np.array([[2.5, 0.0], [0.0, 2.5]]), np.array([[0.0, 1.0], [-1.0, 0.0]]) / 0.11

    def slope(u):
        def of(t, y):
            acceleration = -3.0 * y[0] - 0.4 * y[1] + 5.0 * u[0] / 2.0 + 2.0 * y[2] - 14.0 * y[3]
            return [y[1], acceleration, *(y[1] / 8.0 - 0.25 - (fades + turns) @ y[2:])]

        return of

    found = twin.simulate_commands([0.3, 2.0], COMMANDS).true_states
    # It begins where nothing of it moves.
    y = np.array([0.3, 2.0, *np.linalg.solve(fades + turns, [2.0 / 8.0 - 0.25] * 2)])
    for state, u in zip(found[1:], COMMANDS, strict=True):
        y = solve_ivp(slope(u), (0.0, SIGNALS.dt), y, rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(state, y[:2], atol=2e-4)
    plant = twin.linearise([0.2, -1.0], [0.5, 1.0])
    np.testing.assert_allclose(plant.A[2:, 2:], -(fades + turns))
    text = twin.equations(3)
    assert "d hidden_1 / dt = (rate/8) - 0.25 - hidden_1/0.4 - hidden_2/0.11" in text
    assert "d hidden_2 / dt = (rate/8) - 0.25 - hidden_2/0.4 + hidden_1/0.11" in text


@pytest.mark.parametrize("lags", [(0.0, 0.0), (0.07, 0.0)])
def test_two_that_commands_drive_are_a_servo_that_swings(lags):
    actuators = [(lag, 1, 0.0, 0.0) for lag in lags]
    twin = twin_of(LINEAR, inputs=6, actuators=actuators, hidden=SERVO)
    fades, turns = np.array([[2.5, 0.0], [0.0, 2.5]]), np.array([[0.0, 1.0], [-1.0, 0.0]]) / 0.11

    def slope(u):
        def of(t, y):
            torque, fan = (y[4 + i] if lag else u[i] for i, lag in enumerate(lags))
            acceleration = -3.0 * y[0] - 0.4 * y[1] + 5.0 * torque / 2.0 + 2.0 * y[2] - 14.0 * y[3]
            filled = 0.5 * (torque / 2.0 + fan / 5.0) - 0.25 - (fades + turns) @ y[2:4]
            lagging = [(u[i] - y[4 + i]) / lag if lag else 0.0 for i, lag in enumerate(lags)]
            return [y[1], acceleration, *filled, *lagging]

        return of

    found = twin.simulate_commands([0.3, 2.0], COMMANDS).true_states
    y, arrived = np.array([0.3, 2.0, 0.0, 0.0, 0.0, 0.0]), np.vstack([np.zeros(2), COMMANDS])
    for state, u in zip(found[1:], arrived, strict=False):
        y = solve_ivp(slope(u), (0.0, SIGNALS.dt), y, rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(state, y[:2], atol=3e-4)
    text = twin.equations(3)
    assert "d hidden_1 / dt = torque_scaled/2 + fan_scaled/2 - 0.25 - hidden_1/0.4 - hidden_2/0.11" in text
    assert "d hidden_2 / dt = torque_scaled/2 + fan_scaled/2 - 0.25 - hidden_2/0.4 + hidden_1/0.11" in text
    assert "from 0 at the start" in text


@pytest.mark.parametrize("lag", [0.0, 0.07])
def test_a_servo_is_linearised_where_it_settles(lag):
    twin = twin_of(LINEAR, inputs=6, actuators=[(lag, 0, None, 0.0), (0.0, 0, None, 0.0)], hidden=SERVO)
    plant = twin.linearise([0.2, -1.0], [0.5, 1.0])
    first = 2 + (lag > 0.0)
    pair = slice(first, first + 2)
    fades = np.array([[2.5, 1.0 / 0.11], [-1.0 / 0.11, 2.5]])
    np.testing.assert_allclose(plant.A[pair, pair], -fades)
    np.testing.assert_allclose(plant.state[pair], np.linalg.solve(fades, [0.5 * (0.25 + 0.2) - 0.25] * 2))
    np.testing.assert_allclose(plant.drift[pair], 0.0, atol=1e-15)
    # Of the torque's scale of 2, and of the fan's of 5, the mean of both.
    np.testing.assert_allclose(plant.A[pair, 2] if lag else plant.B[pair, 0], 0.25)
    np.testing.assert_allclose(plant.B[pair, 1], 0.1)


def test_a_mass_behind_a_gap_is_pressed_on_either_side_and_moves_along_at_the_start():
    twin = linear_twin(hidden=GAP)

    def slope(u):
        def of(t, y):
            turning = y[1] / 8.0 - 0.25 - y[3]
            press = pressed(y[2], turning)
            acceleration = -3.0 * y[0] - 0.4 * y[1] + 5.0 * u[0] / 2.0 + 2.0 * press - 14.0 * y[3]
            return [y[1], acceleration, turning, press / 0.12**2 - y[3] / 0.4]

        return of

    found = twin.simulate_commands([0.3, 2.0], COMMANDS).true_states
    y, presses = np.array([0.3, 2.0, 0.0, 2.0 / 8.0 - 0.25]), []
    for state, u in zip(found[1:], COMMANDS, strict=True):
        y = solve_ivp(slope(u), (0.0, SIGNALS.dt), y, rtol=1e-9, atol=1e-11, max_step=1e-3).y[:, -1]
        presses.append(pressed(y[2], y[1] / 8.0 - 0.25 - y[3]))
        np.testing.assert_allclose(state, y[:2], atol=3e-2)
    assert min(presses) < 0.0 and 0.0 in presses
    text = twin.equations(3)
    assert "d hidden_1_twist / dt = (rate/8) - 0.25 - hidden_2" in text
    assert "d hidden_2 / dt = hidden_1/0.0144 - hidden_2/0.4" in text
    assert "half of which is 0.01" in text and "moves along at the start" in text


@pytest.mark.parametrize("rate", [2.0, 4.0, -3.0])
def test_a_law_with_a_gap_is_linearised_where_the_mass_moves_along(rate):
    """Pressed on a side by its friction, or free where nothing has to press."""
    plant = linear_twin(hidden=GAP).linearise([0.2, rate], [0.5, 1.0])
    assert plant.states[2:4] == ("hidden_1_twist", "hidden_2")
    twist, along = plant.state[2:4]
    assert along == pytest.approx(rate / 8.0 - 0.25)
    press = along * 0.12**2 / 0.4
    assert twist == pytest.approx(press + np.sign(press) * 0.01)
    touches = float(press != 0.0)
    turning = np.array([0.0, 1.0 / 8.0, 0.0, -1.0])
    pressing = touches * (np.array([0.0, 0.0, 1.0, 0.0]) + 0.05 * turning)
    np.testing.assert_allclose(plant.A[2], turning)
    np.testing.assert_allclose(plant.A[3], pressing / 0.12**2 - np.array([0.0, 0.0, 0.0, 2.5]))
    np.testing.assert_allclose(plant.A[1], 2.0 * pressing + np.array([-3.0, -0.4, 0.0, -14.0]))
    np.testing.assert_allclose(plant.drift[2:4], 0.0, atol=1e-15)


def test_of_small_motions_the_linearisation_of_a_law_with_a_gap_flies_as_the_law_does():
    twin, at, u = linear_twin(hidden=GAP), np.array([0.2, 4.0]), np.array([0.5, 1.0])
    plant = twin.linearise(at, u, discrete=True)
    # One period from the point itself, and from beside it, by differences of the law written out.
    model = Law.of(twin.model, SIGNALS)
    other = augmented(model)
    flown = tl.Twin(other.model(), other.signals)

    def after(x):
        return flown.simulate_commands(x, u[np.newaxis]).true_states[1]

    step = 1e-6
    columns = [
        (after(plant.state + step * e) - after(plant.state - step * e)) / (2 * step) for e in np.eye(4)
    ]
    np.testing.assert_allclose(plant.A, np.array(columns).T, rtol=1e-5, atol=1e-6)


def test_a_twist_within_its_gap_makes_no_loop_unstable():
    """At rest nothing presses: the twist moves nothing, and stays where it is."""
    gap = [((), False, 0.0, 0.4, (1,), False, 0.12, 0.01, 0.05)] * 2
    law = Law.of(linear_twin(hidden=gap).model, SIGNALS)
    mixer = tl.controllers.Mixer([[1.0], [0.0]], offset=[0.0, 2.5], unit="N m")
    family = tl.controllers.StateFeedback(
        None, gains={"angle": (-9.0, 0.0), "rate": (-9.0, 0.0)}, output=mixer
    ).bind(SIGNALS)
    (loops,) = closed_loops([law], family, np.full(family.size, 0.1), np.zeros(2), None, "commands")
    poles = loops.closed_poles()
    assert len(poles) == 3 and (np.abs(poles) < 1.0).all()
    # The mass alone, by its friction.
    assert np.abs(poles - np.exp(-SIGNALS.dt / 0.4)).min() < 1e-6


@pytest.mark.parametrize(
    "wrong",
    [
        {"gap": 0.0},
        {"gap": -0.01},
        {"damping": 0.0},
        {"turns": 0.0},
        {"settled": True},
        {"squared": True},
    ],
)
def test_a_record_with_what_is_no_gap_is_refused(wrong):
    twin = linear_twin(hidden=GAP)
    law = Law.of(twin.model, SIGNALS)
    assert same(Law.of(law.model(), SIGNALS).actuation, law.actuation)
    assert same(tl.Twin.from_record(through_json(twin.to_record())).model.hidden, twin.model.hidden)
    record, alone = (through_json(each.to_record()) for each in (twin, law.actuation))
    for one in (record["model"]["hidden"], alone["hidden"]):
        for place in (0, 1):
            one[place].update(wrong)
    with pytest.raises(tl.InvalidInput):
        tl.Twin.from_record(record)
    with pytest.raises(tl.InvalidInput):
        Actuation.from_record(alone)


@pytest.mark.parametrize("form", ["explicit-euler", "semi-implicit-euler", "increment", "absolute"])
def test_a_gap_needs_a_law_that_is_integrated_finely(form):
    with pytest.raises(tl.InvalidInput, match="gap"):
        linear_twin(form, hidden=GAP)
    with pytest.raises(tl.InvalidInput, match="turn while commands fill them"):
        linear_twin(form, hidden=SERVO)


def test_a_record_with_one_that_turns_into_nothing_is_refused():
    twin = linear_twin(hidden=SWINGING)
    law = Law.of(twin.model, SIGNALS)
    assert same(Law.of(law.model(), SIGNALS).actuation, law.actuation)
    assert same(tl.Twin.from_record(through_json(twin.to_record())).model.hidden, twin.model.hidden)
    for place in (0, 1):
        record = through_json(twin.to_record())
        record["model"]["hidden"][place]["turns"] = 0.0
        with pytest.raises(tl.InvalidInput, match="pairs"):
            tl.Twin.from_record(record)
        alone = through_json(law.actuation.to_record())
        alone["hidden"][place]["turns"] = 0.2
        with pytest.raises(tl.InvalidInput, match="turns into"):
            Actuation.from_record(alone)


@pytest.mark.parametrize(
    ("form", "hidden"),
    [
        *(
            (form, hidden)
            for form in ("acceleration", "explicit-euler", "semi-implicit-euler", "increment", "absolute")
            for hidden in (STORED, SWINGING)
        ),
        ("acceleration", SERVO),
    ],
)
def test_of_a_linear_law_the_linearisation_flies_as_the_law_does(form, hidden):
    twin = linear_twin(form, hidden)
    at = np.array([0.2, -1.0])
    plant = twin.linearise(at, COMMANDS[0], discrete=True)
    assert plant.states[2:4] == ("hidden_1", "hidden_2")
    flown = twin.simulate_commands(at, COMMANDS).true_states
    begun = plant.state.copy()
    x = begun.copy()
    if hidden is SERVO:
        x[2:4] = 0.0  # a run begins with it at rest; it is linearised where it settles
    for state, u in zip(flown[1:], COMMANDS, strict=True):
        x = begun + plant.A @ (x - begun) + plant.B @ (u - COMMANDS[0]) + plant.drift
        np.testing.assert_allclose(x[:2], state, rtol=1e-9, atol=1e-9)


def test_at_an_instant_what_is_stored_is_filled_by_the_state_and_empties():
    plant = linear_twin().linearise([0.2, -1.0], [0.5, 1.0])
    np.testing.assert_allclose(plant.A[2:], [[0.0, 0.0, -2.5, 0.0], [0.0, 1.0 / 8.0, 0.0, -2.5]])
    np.testing.assert_allclose(plant.A[1], [-3.0, -0.4, 2.0, -14.0])
    np.testing.assert_allclose(plant.drift[3], 0.0, atol=1e-15)


def turning_twin():
    stored = [((), False, 0.0, 0.3, (3,), False, 0.0, 0.0, 0.0)]
    lines = ["r8 = r6 * 2.0", "r11 = r7 * -30.0", "r8 = r8 + r11"]
    return twin_of(lines, signals=BODY, inputs=8, actuators=[(0.0, 0, None, 0.0)], hidden=stored)


def test_a_body_that_turns_stores_as_well():
    """With the attitude as a quaternion and in several steps a period, what is stored is integrated along."""
    twin = turning_twin()
    commands = RNG.uniform(-2.0, 2.0, (40, 1))
    found = twin.simulate_commands(np.zeros(6), commands).true_states
    y = np.zeros(2)
    for state, u in zip(found[1:], commands, strict=True):
        # p' = 2 u / 2 − 30 h, h' = p / 5 − h / 0.3; nothing else turns, and so roll is the integral of p.
        y = solve_ivp(
            lambda t, y, u=u: [u[0] - 30.0 * y[1], y[0] / 5.0 - y[1] / 0.3],
            (0.0, 0.05),
            y,
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
        np.testing.assert_allclose(state[3], y[0], atol=1e-5)


def test_its_equations_say_what_fills_it_and_how_it_begins():
    text = stored_twin().equations(3)
    assert "d hidden_1 / dt = torque_scaled - hidden_1/0.4" in text
    assert "d hidden_2 / dt = (rate/8) - 0.25 - hidden_2/0.4" in text
    assert "as it settles under what fills it at the start" in text


def test_a_law_and_a_record_give_it_back_to_the_bit():
    twin = stored_twin()
    law = Law.of(twin.model, SIGNALS)
    assert same(Law.of(law.model(), SIGNALS).actuation, law.actuation)
    again = tl.Twin.from_record(through_json(twin.to_record()))
    run, other = (each.simulate_commands([0.1, 0.5], COMMANDS) for each in (twin, again))
    assert same(run.true_states, other.true_states)


@pytest.mark.parametrize("kind", ["python", "c", "fmu3", "casadi", "control"])
@pytest.mark.parametrize("which", ["stored", "swinging", "servo", "behind a gap", "turning"])
def test_an_export_has_it_as_states(which, kind, tmp_path):
    """What is written is compared with the twin's own free runs before it is handed out."""
    needed = {"casadi": "casadi", "control": "control", "fmu3": "fmpy"}
    if kind in needed:
        pytest.importorskip(needed[kind])
    made = {
        "stored": stored_twin,
        "swinging": lambda: linear_twin(hidden=SWINGING),
        "servo": lambda: linear_twin(hidden=SERVO),
        "behind a gap": lambda: linear_twin(hidden=GAP),
        "turning": turning_twin,
    }
    plain = made[which]()
    twin = tl.Twin(plain.model, plain.signals, flights=[flown(plain, seed=seed) for seed in range(2)])
    suffix = {"c": ".c", "fmu3": ".fmu"}.get(kind, ".py")
    twin.export(tmp_path / f"twin{suffix}", kind=kind)
    if kind == "python":
        module = {}
        exec((tmp_path / "twin.py").read_text(encoding="utf-8"), module)
        flight, hidden = twin.flights[0], len(twin.law.actuation.stored)
        assert len(module["STATES"]) == twin.signals.n_x + hidden
        start = begun(twin.law, flight.states[0])
        states = np.array(module["simulate"](start.tolist(), flight.commands.tolist()))
        expected = twin.simulate_commands(flight.states[0], flight.commands).true_states
        np.testing.assert_allclose(states[:, : twin.signals.n_x], expected, rtol=1e-9, atol=1e-9)
        assert np.abs(states[1:, twin.signals.n_x :]).min(axis=0).max() > 0.0


def test_an_export_says_how_they_begin():
    for kind, mark in (("python", "# "), ("c", "   ")):
        files = stored_twin().export(kind)
        assert f"{mark}hidden_2 begins " in files
    text = stored_twin().export("python")
    state = np.array([0.4, -0.3])
    start = begun(stored_twin().law, state)
    for name, value in zip(stored_twin().law.held_symbols[-(len(start) - 2) :], start[2:], strict=True):
        words = "where it stands still under the first state" if value != 0.0 else "with 0"
        assert f"# {name} begins {words}." in text


def test_an_export_without_further_states_says_so():
    with pytest.raises(tl.NotAvailable, match="motion fills"):
        stored_twin().export("twin.py", kind="gymnasium")
    with pytest.raises(tl.NotAvailable, match="motion fills"):
        linear_twin("increment").export("python")
    for kind in ("latex", "sympy"):
        text = linear_twin(hidden=GAP).export(kind)
        for line in ("d hidden_1_twist / dt = (rate/8", "hidden_1 = max(0, min(100", "+ min(0, max(100"):
            assert line in text
    assert "hidden_2" in stored_twin().export("latex")
    assert "hidden_2" in stored_twin().export("sympy")


def test_a_step_knows_no_past_of_it_and_an_environment_does():
    pytest.importorskip("gymnasium")
    twin = stored_twin()
    with pytest.raises(tl.NotAvailable, match="simulate_commands"):
        twin.predict([0.1, 0.5], COMMANDS[1], past=COMMANDS[:1])
    env = twin.env([0.1, 0.5], [0.0, 0.0], 10)
    env.reset()
    seen = [env.step(u)[0] for u in COMMANDS[:10]]
    assert same(np.array(seen), twin.simulate_commands([0.1, 0.5], COMMANDS[:10]).true_states[1:])
