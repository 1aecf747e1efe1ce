"""Values that never change are their own copies, with what they have in the native engine."""

import copy

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, TINY, pendulum_step
from twinloop._experiment.hold_back import HoldBack

NAMES = ("signals", "limits", "family", "hold-back", "test", "trajectory", "twin", "law", "setup", "replay")


@pytest.fixture(scope="module")
def values(pendulum_signals, pendulum_controller):
    """One of each."""
    plant = tl.systems.Simulated(pendulum_signals, pendulum_step, default_gains=PENDULUM_GAINS)
    campaign = tl.Campaign(
        pendulum_signals, controller=pendulum_controller, initial_state=[0.0, 0.0], target_state=[1.0, 0.0],
        duration=1.0, preset="paper", threads=1, options=TINY,
    )  # fmt: skip
    campaign.run(plant, 2)
    run, twin = campaign.experiments[0], campaign.twin
    found = (
        *(pendulum_signals, twin.limits, campaign.setup.family),
        HoldBack([[-1.0, 1.0], [-9.0, 9.0]], [[-2.0, 2.0], [-10.0, 10.0]]),
        *(run.test, run.trajectory, twin, twin.law, campaign.setup),
        tl.Replay(pendulum_signals, np.zeros(2), run.trajectory.commands),
    )
    return {"experiment": run, **dict(zip(NAMES, found, strict=True))}


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
@pytest.mark.parametrize("name", NAMES)
def test_a_value_is_its_own_copy(values, name, copied):
    assert copied(values[name]) is values[name]


def test_what_holds_values_is_copied_with_them(values):
    run = copy.deepcopy({"runs": [values["experiment"]]})["runs"][0]
    assert run.test is values["test"] and run.trajectory is values["trajectory"]
