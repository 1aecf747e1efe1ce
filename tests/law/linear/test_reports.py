"""What is given of readings in a linear law: beside the twin's own flights, and beside itself in continuous time."""

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop.law.reports import Computed, Held, with_reports

DT = 0.02
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 5.0, derivative_of="angle")],
    [tl.Command("torque", "1", (-3.0, 3.0))],
    DT,
)
COMPUTED = Computed(0, 0.8, 0.2 / DT)


def twin(*reports):
    """d rate / dt = 8 torque - 3 angle - 0.5 rate."""
    lines = ["r4 = r2 * 24.0", "r5 = r1 * 0.5", "r3 = r4 - r5", "r5 = r0 * 3.0", "r3 = r3 - r5"]
    program = _core.Program.parse(program_text(3, 1, 6, [lines]))
    model = _core.Model(program, "acceleration", SIGNALS.engine)
    return tl.Twin(with_reports(model, reports), SIGNALS)


def read_by(linear, commands):
    """Readings of a linear law from rest."""
    state, seen = np.zeros(len(linear.A)), []
    for u in commands:
        seen.append(linear.C @ state)
        state = linear.A @ state + linear.B @ u
    return np.array([*seen, linear.C @ state])[:, :2]


def test_a_computed_rate_is_the_one_that_the_twin_gives():
    commands = 0.5 * np.random.default_rng(0).normal(size=(60, 1))
    rig = twin(None, COMPUTED)
    linear = rig.linearise([0.0, 0.0], [0.0], discrete=True)
    assert linear.states[2:] == ("rate_before", "angle_read_before")
    flown = rig.simulate_commands([0.0, 0.0], commands).states
    np.testing.assert_allclose(read_by(linear, commands), flown, atol=1e-9)
    assert np.abs(flown - twin().simulate_commands([0.0, 0.0], commands).states).max() > 0.05


def test_a_slow_sensor_is_behind_by_its_age_and_half_its_period():
    commands = 0.5 * np.random.default_rng(0).normal(size=(60, 1))
    linear = twin(Held(6, 1, 4), None).linearise([0.0, 0.0], [0.0], discrete=True)
    in_time = twin().simulate_commands([0.0, 0.0], commands).states
    found = read_by(linear, commands)
    np.testing.assert_allclose(found[7:, 0], in_time[:-7, 0], atol=1e-9)
    np.testing.assert_allclose(found[:, 1], in_time[:, 1], atol=1e-9)


@pytest.mark.parametrize("reports", [(None, COMPUTED), (Held(10, 10, 6), None), (Held(4, 1, 0), COMPUTED)])
def test_in_continuous_time_it_is_as_late_at_low_frequencies(reports):
    rig, slow = twin(*reports), np.array([0.3])
    instant, period = (rig.linearise([0.0, 0.0], [0.0], discrete=discrete) for discrete in (False, True))
    plain = twin().linearise([0.0, 0.0], [0.0], discrete=True)
    late = period.response(slow)[0, :2, 0] / plain.response(slow)[0, :2, 0]
    np.testing.assert_allclose(instant.offsets, -np.angle(late) / slow[0], rtol=0.02, atol=1e-4)
    np.testing.assert_allclose(np.abs(late), 1.0, rtol=0.01)
