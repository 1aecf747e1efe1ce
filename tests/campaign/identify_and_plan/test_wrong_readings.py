"""A reading that is wrong is not learnt from, and what a twin rightly does not do there is not held against it."""

import math

import numpy as np
import pytest

import twinloop as tl
from small_plants import gravity, pendulum_like, swung
from twinloop.campaign.identify_and_plan.wrong_readings import without_wrong_readings

SIGNALS = pendulum_like()


def runs(row=None, size=0.5):
    """Three swings; of the second one a reading of the angle is wrong."""
    found = []
    for seed in (1, 2, 3):
        run = swung(gravity, seed, noise=1e-3)
        states = run.states.copy()
        if row is not None and seed == 2:
            states[row, 0] += size
        found.append(tl.Trajectory(0.02 * np.arange(len(states)), states, run.commands))
    return found


@pytest.mark.parametrize("row", [0, 40, -1])
def test_one_wrong_reading_changes_no_verdict(row):
    twin = tl.identify(runs(row), SIGNALS, seed=0)

    assert any(remark.code == "outliers" for remark in twin.remarks)
    assert not [remark for remark in twin.remarks if remark.severity == "serious"]
    assert not twin.law.actuation.hidden
    linear = twin.linearise(at=np.array([0.3, 0.1]), command=np.array([0.2]))
    np.testing.assert_allclose(linear.A[1], [-9.0 * math.cos(0.3), -0.4], rtol=0.02)
    np.testing.assert_allclose(linear.B[1], [5.0], rtol=0.02)


def test_of_a_flight_the_wrong_reading_alone_is_moved_and_the_record_stays():
    campaign = tl.Campaign(
        SIGNALS,
        controller=tl.controllers.PID(
            axes=[("angle", "rate")], gains={"angle.kp": (0.0, 1.0), "angle.ki": 0.0, "angle.kd": 0.0}
        ),
        initial_state=[0.5, 0.0],
        target_state=[0.0, 0.0],
        duration=2.0,
        progress=None,
    )
    for run in runs(40):
        campaign.attach(run)
    told = list(campaign.experiments)
    mended = without_wrong_readings(told, SIGNALS)

    assert mended[0] is told[0] and mended[2] is told[2]
    moved = mended[1].trajectory.states - told[1].trajectory.states
    assert np.argwhere(moved).tolist() == [[40, 0]]
    assert moved[40, 0] == pytest.approx(-0.5, abs=0.01)
