"""Runs of small plants under commands that change now and then: a pendulum, a motor, fans that set the air moving."""

import numpy as np

import twinloop as tl
from twinloop.identification.records import Run


def pendulum_like():
    return tl.Signals(
        [tl.State("angle", "rad", 3.0), tl.State("rate", "rad/s", 6.0, derivative_of="angle")],
        [tl.Command("torque", "N m", (-2.0, 2.0), scale=1.0)],
        0.02,
    )


def swung(slope, seed, steps=100, dt=0.02, start=(0.5, 0.0), noise=0.0, amplitude=1.5):
    """A run of a second-order plant under a command that changes now and then, in fine steps."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-amplitude, amplitude, (steps // 5 + 1, 1)), 5, axis=0)[:steps]
    x, states = np.array(start, dtype=float), [np.array(start, dtype=float)]
    for u in commands[:, 0]:
        for _ in range(20):
            h = dt / 20
            middle = x + 0.5 * h * np.array([x[1], slope(*x, u)])
            x = x + h * np.array([middle[1], slope(*middle, u)])
        states.append(x)
    states = np.array(states)
    return Run.of(states + noise * stream.normal(size=states.shape), commands)


def gravity(angle, rate, torque):
    return -9.0 * np.sin(angle) - 0.4 * rate + 5.0 * torque


def lagging_motor(commands, dt, lag, push, stream, steps=50):
    """A run of a motor whose speed fades by 0.8/s and is driven by `push(acting)`, in fine steps.

    The last command acts behind a lag (s), the others at once; the speed is read to 1e-3.
    """
    acting, speed, speeds = commands[0].copy(), 0.0, [0.0]
    for asked in commands:
        acting[:-1] = asked[:-1]
        for _ in range(steps):
            acting[-1] = acting[-1] + dt / steps * (asked[-1] - acting[-1]) / lag if lag else asked[-1]
            speed += dt / steps * (push(*acting) - 0.8 * speed)
        speeds.append(speed)
    readings = np.array(speeds)[:, None]
    return Run.of(readings + 1e-3 * stream.normal(size=readings.shape), commands)


def fans(runs, fading, seed=3, noise=1e-3):
    """Two fans turn a rotor against each other; the air that both have set moving weakens them, and comes to rest."""
    dt, stream, found = 0.02, np.random.default_rng(seed), []
    fan = {"unit": "1", "bounds": (0.0, 2.0), "scale": 1.0}
    signals = tl.Signals(
        [tl.State("speed", "rad/s", 5.0)],
        [tl.Command("left", **fan), tl.Command("right", **fan)],
        dt,
    )
    for _ in range(runs):
        commands = np.repeat(stream.uniform(0.2, 1.8, (15, 2)), 10, axis=0)
        speed, air, states = 0.0, 0.0, [0.0]
        for left, right in commands:
            for _ in range(50):
                push = 6.0 * (left * left - right * right)
                air += dt / 50 * (0.5 * (left * left + right * right) - 1.0 - air / 0.8)
                speed += dt / 50 * (push - 1.5 * speed - fading * air * (left - right))
            states.append(speed)
        readings = np.array(states)[:, None]
        found.append(Run.of(readings + noise * stream.normal(size=readings.shape), commands))
    return signals, found
