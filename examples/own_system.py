"""Your own system from a step function: a pendulum that a motor lifts to one radian."""

import math

import twinloop as tl

signals = tl.Signals(
    states=[
        tl.State("angle", "rad", scale=math.pi),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle", envelope=(-12.0, 12.0)),
    ],
    commands=[tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
    dt=0.05,
)


def step(x, u):
    """One period of a pendulum of 0.3 kg and 0.4 m, in a thousand small steps."""
    angle, rate = x
    for _ in range(1000):
        rate += 0.00005 * (u[0] - 0.3 * 9.81 * 0.4 * math.sin(angle) - 0.05 * rate) / (0.3 * 0.4**2)
        angle += 0.00005 * rate
    return angle, rate


rig = tl.systems.Simulated(signals, step, noise=0.001)
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
campaign.test({"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3})  # flown first
campaign.run(rig, experiments=3)

print(campaign.report(name="pendulum"))
