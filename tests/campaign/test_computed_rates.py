"""A rig whose rates are computed of an encoder's readings: predictions come true, and the law is that of the rig."""

import numpy as np

import twinloop as tl
from lives import THOROUGH

DT, STEPS, SHARE = 0.01, 200, 0.3
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 5.0, derivative_of="angle")],
    [tl.Command("current", "A", (-3.0, 3.0))],
    DT,
)
FAMILY = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 20.0), "angle.ki": (0.0, 20.0), "angle.kd": (0.0, 2.0)},
)
COUNT = 2.0 * np.pi / 4096


def flown(test, seed):
    """A flight of d rate / dt = 15 current - 3 rate, behind an encoder whose filtered difference is the rate."""
    controller, random = test.controller(), np.random.default_rng([seed, test.number])
    controller.reset()
    state, states, sent = np.array([0.0, 0.0]), [], []
    for k in range(test.steps + 1):
        angle = COUNT * np.floor((state[0] + 5e-4 * random.normal()) / COUNT + 0.5)
        change = (angle - states[-1][0]) / DT if states else 0.0
        rate = states[-1][1] + SHARE * (change - states[-1][1]) if states else 0.0
        states.append([angle, rate])
        if k == test.steps:
            break
        command = controller.command(np.array(states[-1]), test.target(k))
        command = command + (0.0 if test.excitation is None else test.excitation[k])
        command = np.clip(command, -3.0, 3.0)
        kept = np.exp(-3.0 * DT)
        steady = 15.0 * command[0] / 3.0
        state = np.array([
            state[0] + steady * DT + (state[1] - steady) * (1.0 - kept) / 3.0,
            steady + (state[1] - steady) * kept,
        ])  # fmt: skip
        sent.append(command)
    return tl.Trajectory(DT * np.arange(test.steps + 1), np.array(states), np.array(sent))


def test_predictions_of_a_rig_that_computes_its_rates_come_true():
    campaign = tl.Campaign(
        SIGNALS, controller=FAMILY, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=DT * STEPS,
        options={**THOROUGH, "lags": True}, progress=None,
    )  # fmt: skip
    test = campaign.test({"angle.kp": 0.8, "angle.ki": 0.3, "angle.kd": 0.1})
    for _ in range(3):
        campaign.tell(test, flown(test, 0))
        test = campaign.ask()
    twin = campaign.twin
    held, ((state, of, kept, share),) = twin.model.reports
    assert not held and (state, of) == (1, 0)
    np.testing.assert_allclose([kept, share], [1.0 - SHARE, SHARE / DT], rtol=1e-6)
    assert [one.code for one in twin.remarks if one.serious] == []
    assert "derived-rate" in [one.code for one in twin.remarks]
    # Neither is the lag of the filter one of the actuator, nor the angle early.
    assert all(actuator[0] == 0.0 for actuator in twin.model.actuators) and not any(twin.model.offsets)
    for run in campaign.experiments[1:]:
        assert abs(run.test.predicted - run.quality) < 0.03 * run.quality
    again = tl.Campaign.from_record(campaign.to_record())
    assert again.twin.model.reports == twin.model.reports
    assert again.ask().genes.tolist() == test.genes.tolist()
