"""The attitude of a rigid body as a quaternion with its derivatives, as the engine moves it on (Diebel 2006)."""

from __future__ import annotations

import math

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.law.linear.dual import Dual


def quaternion(angles: Dual) -> Dual:
    """Roll, pitch and yaw (3,) as a quaternion (4,).

    Args:
        angles: rad.
    """
    half = angles * 0.5
    sines = Dual(np.sin(half.values), half.slopes * np.cos(half.values)[:, np.newaxis])
    cosines = Dual(np.cos(half.values), half.slopes * -np.sin(half.values)[:, np.newaxis])
    (sr, sp, sy), (cr, cp, cy) = ([each.rows([i]) for i in range(3)] for each in (sines, cosines))
    return Dual.stacked([
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ])  # fmt: skip


def turning(attitude: Dual, rates: Dual) -> Dual:
    """How body rates (3,), rad/s, turn a quaternion (4,).

    Args:
        attitude: the quaternion.
        rates: of the body.
    """
    a, b, c, d = (attitude.rows([i]) for i in range(4))
    p, q, r = ((rates * 0.5).rows([i]) for i in range(3))
    return Dual.stacked([
        (b * p + c * q + d * r) * -1.0, a * p + c * r - d * q, a * q - b * r + d * p, a * r + b * q - c * p
    ])  # fmt: skip


def angles(attitude: Dual, before: Floats) -> Dual:
    """Roll, pitch and yaw (3,) of a quaternion of any length, the nearest to what they were.

    Args:
        attitude: (4,).
        before: what the angles were (3,), rad.
    """
    a, b, c, d = (attitude.rows([i]) for i in range(4))
    forward, side = a * a + b * b - c * c - d * d, (b * c + a * d) * 2.0
    down, across = (b * d - a * c) * -2.0, (c * d + a * b) * 2.0
    up = a * a - b * b - c * c + d * d
    square = across * across + up * up
    level = Dual(np.sqrt(square.values), square.slopes * (0.5 / np.sqrt(square.values))[:, np.newaxis])
    found = Dual.stacked([_angle(across, up), _angle(down, level), _angle(side, forward)])
    values, slopes = found.values.copy(), found.slopes.copy()
    if math.cos(before[1]) < 0.0:
        # The same attitude, tipped over.
        values = values + math.pi
        values[1] = 2.0 * math.pi - values[1]
        slopes[1] *= -1.0
    turns = np.rint((before - values) / (2.0 * math.pi))
    return Dual(values + 2.0 * math.pi * turns, slopes)


def _angle(y: Dual, x: Dual) -> Dual:
    """The direction of (x, y)."""
    size = x.values * x.values + y.values * y.values
    slopes = (y * x.values).slopes - (x * y.values).slopes
    return Dual(np.arctan2(y.values, x.values), slopes / size[:, np.newaxis])
