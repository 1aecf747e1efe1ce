"""What a flight records once it has left its envelope for good is not learnt where no law explains it with the rest."""

import math
from functools import partial

import numpy as np
import pytest

import twinloop as tl
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.inside import LEAST, enough_inside, inside

SIGNALS = tl.Signals(
    [
        tl.State("angle", "rad", 0.3, envelope=(-0.6, 0.6)),
        tl.State("rate", "rad/s", 1.0, derivative_of="angle", envelope=(-4.0, 4.0)),
    ],
    [tl.Command("torque", "1", (-1.0, 1.0))],
    0.02,
)
CONTROLLER = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 8.0), "angle.ki": 0.0, "angle.kd": (0.0, 3.0)},
)
HOLDS, FALLS = {"angle.kp": 1.5, "angle.kd": 0.3}, {"angle.kp": 0.5, "angle.kd": 0.1}
FLOOR = 0.9
"""rad."""


def falling(x, u, floor):
    """An inverted pendulum that bounces off a floor at either side, over one period."""
    angle, rate = x
    for _ in range(20):
        rate += SIGNALS.dt / 20 * (12.0 * math.sin(angle) - 0.6 * rate + 14.0 * u[0])
        angle += SIGNALS.dt / 20 * rate
        if abs(angle) > floor:
            angle, rate = math.copysign(floor, angle), -0.35 * rate
    return [angle, rate]


def campaign(**options):
    return tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.2, 0.0], target_state=[0.0, 0.0], duration=3.0,
        seed=0, threads=1, progress=None, options=options or None,
    )  # fmt: skip


def flown(campaign, *gains, floor=FLOOR):
    system = tl.systems.Simulated(SIGNALS, partial(falling, floor=floor), noise=[5e-4, 5e-3], seed=0)
    for each in gains:
        test = campaign.test(each)
        campaign.tell(test, system.run(test))
    return campaign


def codes(twin):
    return [remark.code for remark in twin.remarks]


def test_a_flight_that_falls_on_a_floor_is_learnt_as_far_as_it_was_inside():
    found = flown(campaign(), HOLDS, FALLS)
    fallen = found.experiments[1]
    twin, at = found.twin, inside(found.experiments)[1].trajectory.steps * SIGNALS.dt
    told = next(remark.sentence for remark in twin.remarks if remark.code == "inside")

    assert fallen.left_envelope and fallen.trajectory.steps == 150
    assert f"test 1 from {at:.4g} s on" in told and "test 0" not in told
    linear = twin.linearise(at=np.zeros(2), command=np.zeros(1))
    np.testing.assert_allclose(linear.A[1], [12.0, -0.6], rtol=0.1)
    np.testing.assert_allclose(linear.B[1], [14.0], rtol=0.03)
    assert "does-not-follow" not in codes(twin) and "free-run" not in codes(twin)


def test_otherwise_no_law_explains_the_floor():
    twin = flown(campaign(inside=False), HOLDS, FALLS).twin
    linear = twin.linearise(at=np.zeros(2), command=np.zeros(1))

    assert "inside" not in codes(twin) and {"does-not-follow", "free-run"} & set(codes(twin))
    assert abs(linear.A[1, 0] / 12.0 - 1.0) > 0.2


def test_a_flight_that_a_law_explains_outside_too_is_learnt_whole():
    found = flown(campaign(), HOLDS, FALLS, floor=math.inf)
    assert found.experiments[1].gone_from is not None
    assert not {"inside", "does-not-follow", "free-run"} & set(codes(found.twin))


def experiments(*flights):
    told = campaign()
    for states in flights:
        readings = np.column_stack([states, np.zeros(len(states))])
        told.attach(
            tl.Trajectory(SIGNALS.dt * np.arange(len(states)), readings, np.zeros((len(states) - 1, 1)))
        )
    return list(told.experiments)


def test_of_a_flight_what_came_before_is_kept_and_the_record_stays():
    stays, falls = (
        0.1 * np.sin(np.arange(40.0)),
        np.concatenate([np.linspace(0.1, 0.5, 25), np.full(15, 0.9)]),
    )
    told = experiments(stays, falls)
    kept = inside(told)

    assert kept[0] is told[0]
    assert kept[1].trajectory.steps == 24 and told[1].trajectory.steps == 39
    assert kept[1].trajectory.states.tobytes() == told[1].trajectory.states[:25].tobytes()
    assert enough_inside(told, kept) and not enough_inside(told[1:], inside(experiments(falls[20:])))
    assert [type(run) for run in kept] == [Experiment, Experiment]


@pytest.mark.parametrize("first", [0, 3])
def test_a_few_readings_are_kept_of_a_flight_that_is_outside_at_once(first):
    (kept,) = inside(experiments(np.where(np.arange(40) < first, 0.0, 0.9)))
    assert kept.trajectory.steps == LEAST - 1
