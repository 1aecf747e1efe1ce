"""A small aircraft in attitude hold: six degrees of freedom, nonlinear; with and without its air data.

Coefficients are those of the Aerosonde in R. W. Beard, T. W. McLain, "Small Unmanned Aircraft", 2012, appendix E.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from twinloop.controllers import PID, Mixer
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task

MASS, GRAVITY, DENSITY = 13.5, 9.81, 1.2682
WING, SPAN, CHORD = 0.55, 2.8956, 0.18994
JX, JY, JZ, JXZ = 0.8244, 1.135, 1.759, 0.1204
LIFT = (0.28, 3.45, -0.36)
"""At no angle of attack, for each rad of it, for each rad of elevator."""
DRAG = (0.03, 0.30)
PITCHING = (-0.02338, -0.38, -3.6, -0.5)
"""At no angle of attack, for each rad of it, for the reduced rate, for each rad of elevator."""
SIDE = -0.98
ROLLING = (-0.12, -0.26, 0.14, 0.08)
"""For each rad of sideslip, for reduced rates p and r, for each rad of aileron."""
YAWING = (0.25, 0.022, -0.35, 0.06)
SPEED = 25.0
"""Of the trimmed flight, m/s."""


def forces(speed: float, alpha: float, beta: float, elevator: float) -> tuple[float, float, float]:
    """Of the air, along the body's axes, N."""
    pressure = 0.5 * DENSITY * speed * speed * WING
    lift = pressure * (LIFT[0] + LIFT[1] * alpha + LIFT[2] * elevator)
    drag = pressure * (DRAG[0] + DRAG[1] * alpha)
    x = -drag * math.cos(alpha) + lift * math.sin(alpha)
    z = -drag * math.sin(alpha) - lift * math.cos(alpha)
    return x, pressure * SIDE * beta, z


def _trim() -> tuple[float, float, float]:
    """Angle of attack, elevator and thrust of level flight, by Newton's method."""
    alpha, elevator = 0.05, -0.05
    for _ in range(20):
        elevator = -(PITCHING[0] + PITCHING[1] * alpha) / PITCHING[3]
        lifted, steeper = (
            forces(SPEED, a, 0.0, elevator)[2] + MASS * GRAVITY * math.cos(a) for a in (alpha, alpha + 1e-6)
        )
        alpha -= lifted / ((steeper - lifted) / 1e-6)
    elevator = -(PITCHING[0] + PITCHING[1] * alpha) / PITCHING[3]
    return alpha, elevator, MASS * GRAVITY * math.sin(alpha) - forces(SPEED, alpha, 0.0, elevator)[0]


ALPHA, ELEVATOR, THRUST = _trim()


def derivative(z: Row, u: Row) -> Row:
    """Of (roll, pitch, p, q, r, u, v, w) under (aileron, elevator), in rad, rad/s and m/s."""
    roll, pitch, p, q, r, fore, side, down = z
    aileron, elevator = u
    speed = math.sqrt(fore * fore + side * side + down * down)
    alpha, beta = math.atan2(down, fore), math.asin(side / speed)
    x, y, lift = forces(speed, alpha, beta, elevator)
    weight = MASS * GRAVITY
    fx = x + THRUST - weight * math.sin(pitch)
    fy = y + weight * math.cos(pitch) * math.sin(roll)
    fz = lift + weight * math.cos(pitch) * math.cos(roll)
    pressure = 0.5 * DENSITY * speed * speed * WING
    reduced = [0.5 * SPAN * p / speed, 0.5 * CHORD * q / speed, 0.5 * SPAN * r / speed]
    rolling, yawing = (
        pressure * SPAN * (c[0] * beta + c[1] * reduced[0] + c[2] * reduced[2] + c[3] * aileron)
        for c in (ROLLING, YAWING)
    )
    pitching = PITCHING[0] + PITCHING[1] * alpha + PITCHING[2] * reduced[1] + PITCHING[3] * elevator
    moment = pressure * CHORD * pitching
    # H = J ω with Jxz beside the diagonal: J ω' = M − ω × H.
    hx, hy, hz = JX * p - JXZ * r, JY * q, -JXZ * p + JZ * r
    mx, my, mz = rolling - (q * hz - r * hy), moment - (r * hx - p * hz), yawing - (p * hy - q * hx)
    determinant = JX * JZ - JXZ * JXZ
    across = q * math.sin(roll) + r * math.cos(roll)
    return [
        p + math.tan(pitch) * across,
        q * math.cos(roll) - r * math.sin(roll),
        (JZ * mx + JXZ * mz) / determinant,
        my / JY,
        (JXZ * mx + JX * mz) / determinant,
        r * side - q * down + fx / MASS,
        p * down - r * fore + fy / MASS,
        q * fore - p * side + fz / MASS,
    ]


def air_data(z: Row) -> list[float]:
    """Roll, pitch, p, q, r, airspeed, angle of attack and sideslip of an inner state."""
    fore, side, down = z[5:]
    speed = math.sqrt(fore * fore + side * side + down * down)
    return [*z[:5], speed, math.atan2(down, fore), math.asin(side / speed)]


def from_air_data(x: Row) -> list[float]:
    """The inner state of those eight."""
    speed, alpha, beta = x[5:]
    across = math.cos(beta)
    return [
        *x[:5], speed * math.cos(alpha) * across, speed * math.sin(beta), speed * math.sin(alpha) * across
    ]  # fmt: skip


TRIMMED = [0.0, ALPHA, 0.0, 0.0, 0.0, SPEED, ALPHA, 0.0]
"""Level flight: roll, pitch, p, q, r, airspeed, angle of attack, sideslip."""
TURN = math.radians(25.0)
CLIMB = math.radians(8.0)
STATES = (
    State("roll", "rad", 1.0, envelope=(-1.0, 1.0)),
    State("pitch", "rad", 0.5, envelope=(-0.6, 0.6)),
    State("p", "rad/s", 2.0, envelope=(-3.0, 3.0)),
    State("q", "rad/s", 2.0, envelope=(-3.0, 3.0)),
    State("r", "rad/s", 1.0, envelope=(-2.0, 2.0)),
    State("airspeed", "m/s", 25.0, envelope=(15.0, 40.0)),
    State("alpha", "rad", 0.3, envelope=(-0.25, 0.3)),
    State("beta", "rad", 0.3, envelope=(-0.3, 0.3)),
)
NOISE = (1e-3, 1e-3, 5e-3, 5e-3, 5e-3, 0.1, 2e-3, 2e-3)
COMMANDS = (
    Command("aileron", "rad", (-0.4, 0.4)),
    Command("elevator", "rad of elevator", (-0.4, 0.4)),
)


def machine(logged: Sequence[int], seed: int | None) -> Machine:
    """The aircraft.

    Args:
        logged: places of the states that are read.
        seed: of the noise; None: there is none.
    """
    signals = Signals([STATES[i] for i in logged], COMMANDS, 0.04)

    def inner(x: Row) -> Row:
        full = list(TRIMMED)
        for place, value in zip(logged, x, strict=True):
            full[place] = value
        return from_air_data(full)

    def outer(z: Row) -> Row:
        full = air_data(z)
        return [full[place] for place in logged]

    mechanism = Mechanism(runge_kutta(derivative), substeps=4, inner=inner, outer=outer)
    return Machine(signals, mechanism, [NOISE[i] for i in logged], seed)


def _task(system: Machine) -> Task:
    names = system.signals.state_names
    start = [TRIMMED[i] for i, state in enumerate(STATES) if state.name in names]
    target = np.array(start)
    target[:2] = [TURN, ALPHA + CLIMB]
    family = PID(
        axes=[("roll", "p"), ("pitch", "q")],
        gains={
            "roll.kp": (0.0, 1.5), "roll.ki": (0.0, 0.5), "roll.kd": (0.0, 0.4),
            "pitch.kp": (0.0, 3.0), "pitch.ki": (0.0, 2.0), "pitch.kd": (0.0, 0.8),
        },
        output=Mixer(np.diag([1.0, -1.0]), np.array([0.0, ELEVATOR])),
        anti_windup="clamping",
    )  # fmt: skip
    return Task(
        family,
        start=start,
        target=target,
        duration=4.0,
        first={
            "roll.kp": 0.2, "roll.ki": 0.0, "roll.kd": 0.05, "pitch.kp": 0.3, "pitch.ki": 0.2, "pitch.kd": 0.1,
        },
        weights={name: 0.0 for name in names if name not in ("roll", "pitch")},
    )  # fmt: skip


LOGGED = Plant(
    "aircraft",
    "aircraft in attitude hold, air data logged",
    lambda seed: machine(range(8), seed),
    _task,
)
HIDDEN = Plant(
    "aircraft-hidden",
    "aircraft in attitude hold; airspeed, angle of attack, sideslip and yaw rate hidden",
    lambda seed: machine(range(4), seed),
    _task,
    frozenset({"hidden"}),
)
