"""Attitude: how the pose of a rigid body turns its weight and its thrust, where velocities are logged beside it.

Along the earth's axes a body is driven by its thrust, which its pose turns; along its own by its weight, which its
pose turns the other way. Written out such a term has two or three sines and cosines times a command. It is one choice
among few, and needed by every machine that flies.
"""

from __future__ import annotations

from itertools import product

from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import alike_commands
from twinloop.signals import Signals


def tilts(pool: Pool, signals: Signals) -> list[int]:
    """Nodes of the earth's vertical in the body's axes, then of the body's along the earth's horizontal ones.

    The last of the first three is the body's vertical along the earth's, too; signs are those of the terms' weights.
    None without the angles of a rigid body, or where nothing but its rates is driven.
    """
    body, names = signals.kinematics, signals.state_names
    if body is None or all(names[i] in body.rates for i in signals.driven):
        return []
    waves = [
        [
            pool.wave(function, names.index(name), signals.states[names.index(name)].period)
            for name in body.angles
        ]
        for function in ("sin", "cos")
    ]
    (sin_roll, sin_pitch, sin_yaw), (cos_roll, cos_pitch, cos_yaw) = waves
    forward = pool.product(cos_roll, sin_pitch)
    found = [
        sin_pitch,
        pool.product(sin_roll, cos_pitch),
        pool.product(cos_roll, cos_pitch),
        pool.add("+", pool.product(forward, cos_yaw), pool.product(sin_roll, sin_yaw)),
        pool.add("-", pool.product(forward, sin_yaw), pool.product(sin_roll, cos_yaw)),
    ]
    for tilt in found:
        # As short as an input.
        pool.found.setdefault(tilt, pool.length(0))
    return found


def tilted(pool: Pool, tilt: int, command: int) -> list[int]:
    """The nodes of a command and of its square, times a tilt: each as short as a product of two inputs."""
    nodes = [pool.product(tilt, factor) for factor in (command, pool.product(command, command))]
    for node in nodes:
        pool.found.setdefault(node, pool.length(pool.product(0, command)))
    return nodes


def attitude(pool: Pool, signals: Signals) -> list[int]:
    """Tilts, alone and times each command that has none alike; of those that have, directions are turned."""
    found = tilts(pool, signals)
    single = [signals.n_x + group[0] for group in alike_commands(signals) if len(group) == 1]
    return [*found, *(node for pair in product(found, single) for node in tilted(pool, *pair))]
