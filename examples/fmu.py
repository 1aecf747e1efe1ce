"""An FMU as the plant: here the twin of a pendulum, exported and experimented on. It needs a C compiler."""

import math

import twinloop as tl

signals = tl.Signals(
    states=[tl.State("angle", "rad", math.pi), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
    commands=[tl.Command("torque", "N m", (-2.0, 2.0))],
    dt=0.05,
)


def campaign():
    box = {"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)}
    controller = tl.controllers.PID(axes=[("angle", "rate")], gains=box)
    ends = {"initial_state": [0.0, 0.0], "target_state": [1.0, 0.0]}
    return tl.Campaign(signals, controller=controller, **ends, duration=2.0, goal="control")


def step(x, u):
    rate = x[1] + 0.05 * (u[0] - 1.2 * math.sin(x[0]) - 0.05 * x[1]) / 0.05
    return x[0] + 0.05 * rate, rate


gains = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3}
first = campaign().run(tl.systems.Simulated(signals, step, noise=1e-3, default_gains=gains), experiments=1)
print("Wrote", *first.twin.export("pendulum.fmu"))

# An FMU is a program: only load one from people whom you trust.
plant = tl.systems.FMU("pendulum.fmu", signals, noise=1e-3, default_gains=gains)
second = campaign().run(plant, experiments=2)
print(second.twin.equations())
