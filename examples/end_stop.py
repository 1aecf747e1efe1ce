"""A twin not to be trusted: a pendulum hits a hard stop of which three flights show too little; the report says so."""

import sys
import warnings

import numpy as np

import twinloop as tl

signals = tl.Signals(
    states=[
        tl.State("angle", "rad", scale=np.pi),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle", envelope=(-12.0, 12.0)),
    ],
    commands=[tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
    dt=0.05,
)


def step(x, u):
    """One period of a pendulum that bounces off a stop at 0.8 rad."""
    angle, rate = x
    for _ in range(10):
        rate += 0.005 * (u[0] - 0.3 * 9.81 * 0.4 * np.sin(angle) - 0.05 * rate) / (0.3 * 0.4**2)
        angle += 0.005 * rate
    return (0.8, -0.4 * abs(rate)) if angle > 0.8 else (angle, rate)


rig = tl.systems.Simulated(signals, step)
campaign = tl.Campaign(
    signals,
    controller=tl.controllers.PID(
        axes=[("angle", "rate")],
        gains={"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)},
    ),
    initial_state=[0.0, 0.0],
    target_state=[1.0, 0.0],
    duration=2.0,
)
# Twinloop warns that the twin does not follow its flights, which is what this example is there to show.
warnings.simplefilter("ignore", tl.RemarkWarning)
stream, test = np.random.default_rng(3), campaign.test({"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3})
for told in range(1, 4):
    run = rig.run(test)
    noisy = run.states + [1e-3, 5e-3] * stream.standard_normal(run.states.shape)
    campaign.tell(test, tl.Trajectory(run.t, noisy, run.commands))
    test = campaign.ask() if told < 3 else test

print(campaign.checks())
if len(sys.argv) > 1:
    campaign.report(sys.argv[1], "end stop")
