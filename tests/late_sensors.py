"""A pendulum and a body that turns, read by sensors some of which are late: the truth of SciPy's integrator."""

import numpy as np
from scipy.integrate import solve_ivp

import twinloop as tl
from twinloop.controllers import PID, Mixer
from twinloop.identification.records import Run

DT = 0.04
PENDULUM = tl.Signals(
    [tl.State("angle", "rad", 3.0), tl.State("rate", "rad/s", 6.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-2.0, 2.0), scale=1.0)],
    DT,
)
BODY = tl.Signals(
    [tl.State(name, "rad", 3.0) for name in "abc"] + [tl.State(name, "rad/s", 6.0) for name in "pqr"],
    [tl.Command(name, "N m", (-2.0, 2.0), scale=1.0) for name in "uvw"],
    DT,
    kinematics=tl.RigidBody(("a", "b", "c"), ("p", "q", "r")),
)


def swinging(state, command):
    return np.array([state[1], -9.0 * np.sin(state[0]) - 0.4 * state[1] + 5.0 * command[0]])


def turning(state, command):
    roll, pitch, _, p, q, r = state
    across = q * np.sin(roll) + r * np.cos(roll)
    return np.array(
        [p + np.tan(pitch) * across, q * np.cos(roll) - r * np.sin(roll), across / np.cos(pitch),
         3.0 * command[0] - p, 2.0 * command[1] - q - 3.0 * pitch, 2.0 * command[2] - r + 0.5 * p * q]
    )  # fmt: skip


def read(law, signals, seed, late=0.0, noise=1e-3, steps=100):
    """A run of which the angles are read `late` seconds after the rates; before it, everything rests."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-1.5, 1.5, (steps // 5, signals.n_u)), 5, axis=0)
    driven = [i in signals.driven for i in range(signals.n_x)]
    # The readings begin a period after the start, so that an early sensor, too, has something to read.
    commands = np.vstack([np.zeros((1, signals.n_u)), commands, commands[-1:]])
    x, states = np.zeros(signals.n_x), []
    for command in commands:
        path = solve_ivp(
            lambda _, y, u=command: law(y, u),
            (0.0, DT),
            x,
            "DOP853",
            dense_output=True,
            rtol=1e-10,
            atol=1e-12,
        ).sol
        path = path([0.0, -late if late <= 0.0 else DT - late, DT]).T
        states.append(path)
        x = path[-1]
    paths = np.array(states)
    now = paths[1:, 0]
    other = paths[:-1, 1] if late > 0.0 else paths[1:, 1]
    readings = np.where(driven, now, other)
    return Run.of(readings + noise * stream.normal(size=readings.shape), commands[1:-1])


def loop_of(signals, genes, start, steps=60):
    """A test of a PID on each angle, the same gains on all of them, to 0."""
    angles = [name for i, name in enumerate(signals.state_names) if i not in signals.driven]
    rates = [name for i, name in enumerate(signals.state_names) if i in signals.driven]
    gains = {f"{angle}.{term}": (0.0, 8.0) for angle in angles for term in ("kp", "ki", "kd")}
    axes = list(zip(angles, rates, strict=True))
    family = PID(axes=axes, gains=gains, output=Mixer(np.eye(len(axes)))).bind(signals)
    return tl.Test(family, np.tile(genes, len(axes)), start, np.zeros(signals.n_x), steps)


def flown(law, signals, test, late=0.0):
    """Readings and states (n + 1, n_x) of a closed loop of which the controller reads the angles `late` seconds after.

    Before the start everything goes on at its first rates; what is read early the last command has moved.
    """
    driven = [i in signals.driven for i in range(signals.n_x)]
    controller, x = test.family.controller(test.genes), test.initial_state.copy()
    low, high = np.array([command.bounds for command in signals.commands]).T
    sizes = np.array([command.size for command in signals.commands])
    command, paths, states, readings = (low + high) / 2.0, [], [], []
    for k in range(test.steps + 1):
        at = k * DT - late
        if late < 0.0:
            other = _path(law, x, command / sizes)(-late)
        elif at < 0.0:
            drift = solve_ivp(
                lambda _, y: np.where(driven, 0.0, law(y, np.zeros(signals.n_u))),
                (0.0, at),
                test.initial_state,
                rtol=1e-11,
                atol=1e-13,
            )
            other = drift.y[:, -1]
        else:
            period = min(int(at / DT), k - 1) if k else 0
            other = paths[period](at - period * DT) if k else x
        states.append(x)
        readings.append(np.where(driven, x, other))
        if k < test.steps:
            command = np.clip(controller.command(readings[-1], test.target_state), low, high)
            paths.append(_path(law, x, command / sizes))
            x = paths[-1](DT)
    return np.array(readings), np.array(states)


def _path(law, x, command):
    return solve_ivp(
        lambda _, y: law(y, command), (0.0, DT), x, "DOP853", dense_output=True, rtol=1e-11, atol=1e-13
    ).sol
