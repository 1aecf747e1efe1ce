"""Small twins of every kind, for tests that take them elsewhere: all forms, lags, delays, rigid bodies."""

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop.law.forms import DERIVATIVES

SIGNALS = tl.Signals(
    states=[tl.State("angle", "rad", 3.0), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
    commands=[tl.Command("torque", "N m", (-2.0, 2.0)), tl.Command("fan", "V", (0.0, 5.0))],
    dt=0.05,
)
PENDULUM = ["r4 = sin(r0)", "r4 = r4 * -9.0", "r5 = r1 * 0.4", "r4 = r4 - r5", "r5 = r2 * 11.0", "r4 = r4 + r5",
            "r5 = r3 * r3", "r5 = r5 * r0", "r4 = r4 + r5"]  # fmt: skip
SWINGING = [
    "r3 = sin(r0)",
    "r3 = r3 * -9.0",
    "r4 = r1 * 0.4",
    "r3 = r3 - r4",
    "r4 = r2 * 5.0",
    "r3 = r3 + r4",
]
"""The pendulum with a torque alone."""
FILLED = ["r5 = r4 * 3.0", "r6 = r2 * 11.0", "r5 = r5 + r6", "r6 = r3 * r0", "r5 = r5 - r6", "r6 = abs(r1)",
          "r6 = sqrt(r6)", "r6 = r1 / r6", "r5 = r5 - r6", "r7 = tanh(r1)", "r7 = max(r7, r2)",
          "r5 = r5 - r7"]  # fmt: skip
BODY = tl.Signals(
    states=[tl.State(name, "rad", 3.0) for name in ("roll", "pitch", "yaw")]
    + [tl.State(name, "rad/s", 5.0) for name in ("p", "q", "int")],
    commands=[tl.Command("double", "N m", (-2.0, 2.0))],
    dt=0.05,
    kinematics=tl.RigidBody(("roll", "pitch", "yaw"), ("p", "q", "int")),
)
"""Two of its names are words of C."""
FAST_BODY = tl.Signals(
    states=[tl.State(name, "rad", 3.0) for name in ("roll", "pitch", "yaw")]
    + [tl.State(name, "rad/s", 20.0) for name in ("p", "q", "r")],
    commands=[tl.Command("torque", "N m", (-2.0, 2.0))],
    dt=0.05,
    kinematics=tl.RigidBody(("roll", "pitch", "yaw"), ("p", "q", "r")),
)
"""It may turn by a radian a period, which is integrated in four steps."""


def flown(twin, steps=60, seed=0):
    """A flight that the twin follows, for its checks."""
    rng = np.random.default_rng(seed)
    low, high = np.array([command.bounds for command in twin.signals.commands]).T
    commands = low + (high - low) * rng.random((steps, twin.signals.n_u))
    start = 0.1 * rng.normal(size=twin.signals.n_x)
    return twin.simulate_commands(start, commands)


def model_of(lines, form="acceleration", signals=SIGNALS, inputs=4, actuators=None, hidden=()):
    """What the engine flies."""
    outputs = len(signals.driven) if form in DERIVATIVES else signals.n_x
    program = _core.Program.parse(program_text(inputs, outputs, inputs + outputs + 6, [lines]))
    return _core.Model(program, form, signals.engine, actuators, hidden)


def twin_of(lines, form="acceleration", signals=SIGNALS, inputs=4, offsets=(), errors=(), **actuation):
    model = model_of(lines, form, signals, inputs, **actuation)
    if offsets:
        model = model.with_offsets(offsets)
    bare = tl.Twin(model, signals)
    return tl.Twin(model, signals, errors, flights=[flown(bare, seed=i) for i in range(2)])


WRAPPING = tl.Signals(
    states=[
        tl.State("angle", "rad", 3.0, periodic=True),
        tl.State("rate", "rad/s", 8.0, derivative_of="angle"),
    ],
    commands=SIGNALS.commands,
    dt=0.05,
)
TURNING = ["r4 = r0 * -0.5", "r5 = r2 * 2.0", "r4 = r4 + r5", "r4 = r4 + 6.0"]
"""It goes round, and the raw angle pulls."""

TWINS = {
    "acceleration": lambda: twin_of(PENDULUM),
    "increment": lambda: twin_of(
        ["r4 = r1 * 0.05", "r5 = sin(r0)", "r5 = r5 * -0.4", "r6 = r2 * 0.5", "r5 = r5 + r6"], "increment",
    ),
    "absolute": lambda: twin_of(
        ["r4 = r1 * 0.05", "r4 = r4 + r0", "r5 = r1 * 0.9", "r6 = r3 * 0.01", "r5 = r5 - r6"], "absolute",
    ),
    "explicit Euler": lambda: twin_of(PENDULUM, "explicit-euler"),
    "semi-implicit Euler": lambda: twin_of(PENDULUM, "semi-implicit-euler"),
    "semi-implicit Euler, actuators and hidden states": lambda: twin_of(
        FILLED, "semi-implicit-euler", inputs=5, offsets=(0.003, 0.0),
        actuators=[(0.08, 2, None, 0.0), (0.0, 1, 2.0, 0.0)],
        hidden=[((0, 1), True, None, 0.7, (), False, 0.0, 0.0, 0.0)],
    ),
    "actuators and hidden states": lambda: twin_of(
        FILLED, inputs=5, offsets=(0.003, 0.0),
        actuators=[(0.08, 2, None, 0.0), (0.0, 1, 2.0, 0.0)],
        hidden=[((0, 1), True, None, 0.7, (), False, 0.0, 0.0, 0.0)],
    ),
    "a lag at rest": lambda: twin_of(
        FILLED, inputs=5, actuators=[(0.03, 0, 0.5, 0.0), (0.2, 0, None, 0.0)],
        hidden=[((1,), False, 0.25, 2.0, (), False, 0.0, 0.0, 0.0)],
    ),
    "limited rates": lambda: twin_of(
        FILLED, inputs=5, actuators=[(0.08, 1, None, 0.4), (0.0, 0, 0.5, 0.7)],
        hidden=[((1,), False, 0.25, 2.0, (), False, 0.0, 0.0, 0.0)],
    ),
    "an angle that wraps": lambda: twin_of(TURNING, signals=WRAPPING),
    "an angle that wraps, step by step": lambda: twin_of(
        ["r4 = r1 * 0.05", "r5 = r0 * -0.02", "r5 = r5 + 0.3"], "increment", WRAPPING,
    ),
    "kinematics": lambda: twin_of(
        ["r7 = r6 * 2.0", "r8 = r3 * r5", "r9 = sin(r0)"], signals=BODY, inputs=7,
    ),
    "kinematics, explicit Euler": lambda: twin_of(
        ["r7 = r6 * 2.0", "r8 = r3 * r5", "r9 = sin(r0)"], "explicit-euler", BODY, inputs=7,
    ),
    "kinematics, semi-implicit Euler": lambda: twin_of(
        ["r7 = r6 * 2.0", "r8 = r3 * r5", "r9 = sin(r0)"], "semi-implicit-euler", BODY, inputs=7,
        actuators=[(0.04, 1, 0.5, 0.0)],
    ),
    "kinematics in several steps": lambda: twin_of(
        ["r7 = r6 * 20.0", "r8 = r3 * r5", "r8 = r8 * -0.3", "r9 = sin(r0)"], signals=FAST_BODY, inputs=7,
        actuators=[(0.04, 1, 0.5, 0.0)],
    ),
}  # fmt: skip
STORED = [
    ((0,), False, 0.0, 0.4, (), False, 0.0, 0.0, 0.0),
    ((), False, 0.25, 0.4, (1,), True, 0.0, 0.0, 0.0),
]
"""A hidden state that a command fills, and one that motion does."""


def stored_twin():
    """A pendulum whose torque twists a joint, and whose speed does."""
    lines = ["r6 = sin(r0)", "r6 = r6 * -9.0", "r7 = r4 * 3.0", "r6 = r6 + r7", "r7 = r5 * 20.0", "r6 = r6 - r7",
             "r7 = r5 * r3", "r6 = r6 + r7"]  # fmt: skip
    return twin_of(lines, inputs=6, actuators=[(0.08, 1, None, 0.0), (0.0, 0, None, 0.0)], hidden=STORED)


ALL = pytest.mark.parametrize("which", TWINS)
