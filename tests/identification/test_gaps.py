"""What masses behind gaps do by readings of what drives them, against SciPy's integrator."""

import numpy as np
from scipy.integrate import solve_ivp

from twinloop.identification.gaps import Masses, behind_gaps
from twinloop.identification.stored import stored
from twinloop.law.actuation import HiddenState
from twinloop.signals import Command, Signals, State

DT, STEPS = 0.002, 400
MASSES = Masses(*np.array([[0.03, 0.05], [0.004, 0.02], [0.003, 0.01], [0.5, 2.0]]))


def driven(t):
    return 0.8 * np.sin(9.0 * t) + 0.1


def pressed(twist, rate, gap, damping):
    if twist < 0.0:
        return -pressed(-twist, -rate, gap, damping)
    return max(0.0, min(100.0 * (twist - gap), twist - gap + damping * rate))


def exact(turns, gap, damping, time, t):
    """What presses and the mass' rate, at some times; it moves along at the start."""

    def slope(t, y):
        turning = driven(t) - y[1]
        return [turning, pressed(y[0], turning, gap, damping) / turns**2 - y[1] / time]

    found = solve_ivp(slope, (0.0, t[-1]), [0.0, driven(0.0)], t_eval=t, rtol=1e-9, atol=1e-12, max_step=2e-4)
    press = [pressed(s, driven(at) - w, gap, damping) for at, (s, w) in zip(t, found.y.T, strict=True)]
    return np.column_stack([press, found.y[1]])


def at_stages():
    ends = DT * np.arange(STEPS + 1)
    return ends[:-1], 0.5 * (ends[:-1] + ends[1:]), ends[1:]


def test_masses_are_pressed_and_move_as_their_equations_say():
    times = at_stages()
    found = behind_gaps(MASSES, tuple(driven(t) for t in times), [slice(0, STEPS)], DT)
    for k, mass in enumerate(zip(*MASSES, strict=True)):
        for stage, t in zip(found, times, strict=True):
            expected = exact(*mass, np.concatenate([[0.0], t]) if t[0] else t)[-STEPS:]
            np.testing.assert_allclose(stage[:, 1, k], expected[:, 1], atol=2e-3)
            np.testing.assert_allclose(stage[:, 0, k], expected[:, 0], atol=2e-4)
            assert (expected[:, 0] == 0.0).mean() > 0.05 and np.ptp(expected[:, 0]) > 0.0


def test_each_run_begins_anew_and_masses_do_not_know_each_other():
    rates, third = tuple(driven(t) for t in at_stages()), STEPS // 3
    runs = [slice(0, third), slice(third, third), slice(third, STEPS)]
    both = behind_gaps(MASSES, rates, runs, DT)
    for k in range(2):
        alone = Masses(*(numbers[[k]] for numbers in MASSES))
        for rows in (runs[0], runs[2]):
            own = behind_gaps(
                alone, tuple(each[rows] for each in rates), [slice(0, rows.stop - rows.start)], DT
            )
            for stage, other in zip(both, own, strict=True):
                np.testing.assert_array_equal(stage[rows, :, k], other[:, :, 0])


def test_a_hidden_state_with_a_gap_is_such_a_mass():
    signals = Signals(
        [State("angle", "rad", 1.0), State("rate", "rad/s", 4.0, derivative_of="angle")],
        [Command("torque", "N m", (-1.0, 1.0))],
        DT,
    )
    rates = [driven(t) for t in at_stages()]
    inputs = tuple(np.column_stack([np.zeros(STEPS), 4.0 * (rate + 0.05), np.zeros(STEPS)]) for rate in rates)
    one = HiddenState((), False, 0.05, 0.5, (1,), False, 0.03, 0.004, 0.003)
    alone = Masses(*(numbers[[0]] for numbers in MASSES))
    expected = behind_gaps(alone, tuple(rates), [slice(0, STEPS)], DT)
    for stage, other in zip(stored(one, inputs, [slice(0, STEPS)], signals), expected, strict=True):
        np.testing.assert_allclose(stage, other[:, :, 0], rtol=1e-6, atol=1e-9)
