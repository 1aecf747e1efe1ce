"""Masses behind gaps are found where there are some, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.identification.identify import identify_runs
from twinloop.identification.proposals import gaps
from twinloop.identification.records import Run

WORKERS = _core.Workers(2)
QUICK = {"moves": 4000, "starts": 2, "generations": 2, "population": 30, "committee_size": 4}
DRIVE = tl.Signals(
    [tl.State("angle", "rad", 2.0), tl.State("speed", "rad/s", 10.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-1.0, 1.0))],
    0.01,
)
STIFF, DAMPED, LOAD = 2400.0, 5.0, 3.0
"""Of the shaft, 1/s² and 1/s of the motor's inertia, and the load in motors."""


def drive(seed, half=0.08, weight=0.0, rubbing=0.0, noise=1.0, steps=180):
    """A motor whose load turns behind a gear with backlash; the motor alone is read."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-0.6, 0.6, (steps // 12 + 1, 1)), 12, axis=0)[:steps]

    def slope(x, u):
        twist = x[0] - x[1]
        deep = np.sign(twist) * max(0.0, abs(twist) - half)
        torque = STIFF * deep + DAMPED * (x[2] - x[3]) if deep else 0.0
        torque = torque if torque * deep > 0.0 else 0.0
        moved = 60.0 * u - torque - 1.5 * x[2] - weight * np.sin(x[0]) - rubbing * np.tanh(x[2] / 0.05)
        return np.array([x[2], x[3], moved, torque / LOAD - 0.8 * x[3]])

    x, states, h = np.zeros(4), [np.zeros(4)], DRIVE.dt / 20
    for u in commands[:, 0]:
        for _ in range(20):
            a = slope(x, u)
            b = slope(x + 0.5 * h * a, u)
            c = slope(x + 0.5 * h * b, u)
            x = x + h / 6.0 * (a + 2.0 * (b + c) + slope(x + h * c, u))
        states.append(x)
    read = np.array(states)[:, [0, 2]]
    return Run.of(read + noise * np.array([1e-3, 1e-2]) * stream.normal(size=read.shape), commands)


def learnt(runs, **changes):
    return identify_runs(runs, DRIVE, options_of("default", {**QUICK, **changes}), workers=WORKERS)


def missed(found, **plant):
    """Largest error of free runs that were not learnt, in scales."""
    twin, errors = tl.Twin(found.model, DRIVE), []
    for seed in (50, 51, 52):
        run = drive(seed, noise=0.0, **plant)
        states = twin.simulate_commands(run.states[0], run.commands).true_states
        assert len(states) == len(run.states)
        errors.append(float(np.sqrt(np.square((states - run.states) / [2.0, 10.0]).mean())))
    return max(errors)


@pytest.mark.parametrize("plant", [{}, {"weight": 8.0, "half": 0.05}], ids=["turning", "under a weight"])
def test_a_load_behind_backlash_is_found_by_its_motor_alone(plant):
    found = learnt([drive(seed, **plant) for seed in (0, 1)])
    first, second = found.actuation.hidden
    assert first == second and first.states == (1,)
    assert first.gap == pytest.approx(plant.get("half", 0.08) / 10.0, rel=0.03)
    assert first.turns == pytest.approx((LOAD / STIFF) ** 0.5, rel=0.03)
    assert first.damping == pytest.approx(DAMPED / STIFF, rel=0.25)
    assert missed(found, **plant) < 0.08


def test_without_storage_none_is_looked_for():
    assert not learnt([drive(seed) for seed in (0, 1)], storage=False).actuation.stored


def test_a_mass_that_tuning_drops_is_none(monkeypatch):
    """Of a robot's leg terms stayed that were found beside a mass, and the law was the better for them alone."""

    def dropped(context, with_mass, known):
        assert with_mass.actuation.hidden and not known.actuation.hidden
        return replace(known, fit=replace(known.fit, length=known.fit.length - 10.0))

    monkeypatch.setattr(gaps, "_polished", dropped)
    found = learnt([drive(seed) for seed in (0, 1)])
    assert not any(one.gap for one in found.actuation.hidden)


@pytest.mark.parametrize("rubbing", [0.0, 3.0])
def test_a_spring_without_a_gap_has_none(rubbing):
    found = learnt([drive(seed, half=0.0, rubbing=rubbing) for seed in (0, 1)])
    assert not any(one.gap for one in found.actuation.hidden)
