"""A body turned by three torques: Euler's equations with what a plant adds to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from twinloop.controllers import PID
from twinloop.signals import Command, RigidBody, Signals, State
from twinloop_exam.zoo.machine import Row

ANGLES = ("roll", "pitch", "yaw")
RATES = ("p", "q", "r")
TORQUES = ("torque_x", "torque_y", "torque_z")


def signals(dt: float, torque: float, tilt: float = 1.2, rate: float = 6.0) -> Signals:
    """Three angles, three body rates, three torques.

    Args:
        dt: period, s.
        torque: the largest, N m.
        tilt: largest safe roll and pitch, rad.
        rate: largest safe rate, rad/s.
    """
    angles = [State(name, "rad", math.pi, envelope=(-tilt, tilt)) for name in ANGLES[:2]]
    angles.append(State("yaw", "rad", math.pi, envelope=(-math.pi, math.pi)))
    rates = [State(name, "rad/s", 5.0, envelope=(-rate, rate)) for name in RATES]
    commands = [Command(name, "N m", (-torque, torque)) for name in TORQUES]
    return Signals([*angles, *rates], commands, dt, kinematics=RigidBody(ANGLES, RATES))


def turning(angles: Row, rates: Row) -> list[float]:
    """Derivatives of roll, pitch and yaw, rad/s."""
    (roll, pitch, _), (p, q, r) = angles, rates
    across = q * math.sin(roll) + r * math.cos(roll)
    return [p + math.tan(pitch) * across, q * math.cos(roll) - r * math.sin(roll), across / math.cos(pitch)]


def spinning(inertia: Sequence[float], rates: Row, torques: Row) -> list[float]:
    """Angular accelerations by Euler's equations, rad/s²."""
    (a, b, c), (p, q, r) = inertia, rates
    return [
        (torques[0] + (b - c) * q * r) / a,
        (torques[1] + (c - a) * r * p) / b,
        (torques[2] + (a - b) * p * q) / c,
    ]


def controller(inertia: Sequence[float], box: Mapping[str, float]) -> PID:
    """One PID an axis, in N m.

    Args:
        inertia: kg m².
        box: largest kp, ki and kd over the inertia.
    """
    bounds = {
        f"{angle}.{term}": (0.0, top * moment)
        for angle, moment in zip(ANGLES, inertia, strict=True)
        for term, top in box.items()
    }
    return PID(axes=list(zip(ANGLES, RATES, strict=True)), gains=bounds)


def gains(inertia: Sequence[float], kp: float, ki: float, kd: float) -> dict[str, float]:
    """The same gains on every axis, over its inertia."""
    return {
        f"{angle}.{term}": value * moment
        for angle, moment in zip(ANGLES, inertia, strict=True)
        for term, value in (("kp", kp), ("ki", ki), ("kd", kd))
    }


def free(inertia: Sequence[float], torques: Callable[[Row, Row], Row]) -> Callable[[Row, Row], Row]:
    """The derivative of six states under torques that depend on the rates and the commands."""

    def derivative(z: Row, u: Row) -> Row:
        rates = z[3:6]
        return [*turning(z[:3], rates), *spinning(inertia, rates, torques(rates, u))]

    return derivative
