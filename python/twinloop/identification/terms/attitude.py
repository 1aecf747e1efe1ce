"""Attitude: how the pose of a rigid body turns its weight, its thrust and its velocity, where velocities are logged.

Along the earth's axes a body is driven by its thrust, which its pose turns; along its own by its weight, which its
pose turns the other way. A place changes by the velocity, turned where that is logged along the body's axes, as that
of a vehicle under water is. Written out such a term has two or three sines and cosines times a command, or seven times
velocities. It is one choice among few, and needed by every machine that flies or dives.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import NamedTuple

from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import alike_commands
from twinloop.law.expressions import INPUT
from twinloop.signals import Signals


class Waves(NamedTuple):
    """Nodes of the sines and cosines of roll, pitch and yaw."""

    sin_roll: int
    sin_pitch: int
    sin_yaw: int
    cos_roll: int
    cos_pitch: int
    cos_yaw: int


def _waves(pool: Pool, signals: Signals) -> Waves | None:
    """Of the angles of a rigid body; None without one, or where nothing but its rates is driven."""
    body, names = signals.kinematics, signals.state_names
    if body is None or all(names[i] in body.rates for i in signals.driven):
        return None
    angles = [names.index(name) for name in body.angles]
    return Waves(
        *(pool.wave(function, i, signals.states[i].period) for function in ("sin", "cos") for i in angles)
    )


def _along_the_earth(pool: Pool, waves: Waves) -> tuple[int, int]:
    """Of the body's vertical, what points along the earth's two horizontal axes."""
    forward = pool.product(waves.cos_roll, waves.sin_pitch)
    return (
        pool.add("+", pool.product(forward, waves.cos_yaw), pool.product(waves.sin_roll, waves.sin_yaw)),
        pool.add("-", pool.product(forward, waves.sin_yaw), pool.product(waves.sin_roll, waves.cos_yaw)),
    )


def along_the_body(signals: Signals) -> set[int]:
    """Rates of a rigid body, and its velocities where they are logged along its axes, beside places they change."""
    if signals.kinematics is None:
        return set()
    return {signals.state_names.index(name) for name in signals.kinematics.rates} | set(_velocities(signals))


def turned(pool: Pool, signals: Signals, terms: Iterable[int]) -> set[int]:
    """Of terms those by which a pose turns a thrust or a velocity: short, for they drive velocities and places.

    They drive nothing along the body's axes: what does is fixed to it, or its weight, which no yaw turns. Where a law
    lacks much, such terms would stand in for it there, at the price of an input.
    """
    body, waves = signals.kinematics, _waves(pool, signals)
    if body is None or waves is None:
        return set()
    angles = {signals.state_names.index(name) for name in body.angles}
    yaw, found = {waves.sin_yaw, waves.cos_yaw}, set()
    for term in terms:
        if term in pool.found:
            parts = set(pool.needed([term]))
            others = {part for part in parts if pool[part].operation == INPUT} - angles
            if not parts.isdisjoint(yaw) or (others and not parts.isdisjoint(waves)):
                found.add(term)
    return found


def tilts(pool: Pool, signals: Signals) -> list[int]:
    """Nodes of the earth's vertical in the body's axes, then of the body's along the earth's horizontal ones.

    The last of the first three is the body's vertical along the earth's, too; signs are those of the terms' weights.
    None without the angles of a rigid body, or where nothing but its rates is driven.
    """
    waves = _waves(pool, signals)
    if waves is None:
        return []
    found = [
        waves.sin_pitch,
        pool.product(waves.sin_roll, waves.cos_pitch),
        pool.product(waves.cos_roll, waves.cos_pitch),
        *_along_the_earth(pool, waves),
    ]
    for tilt in found:
        # As short as an input.
        pool.found.setdefault(tilt, pool.length(0))
    return found


def carried(pool: Pool, signals: Signals) -> list[int]:
    """Nodes of the body's velocity along the earth's axes, by which places change; three, or none.

    There are three where exactly three states have the unit of a place that is driven, per second: they are taken for
    the velocity along the body's axes, forward, sideways and along its vertical, in this order. Where they are along
    the earth's already, the place changes by one of them alone, which is as short. A place that grows against the
    vertical, such as a height where the vertical points down, has the last one with a weight below 0.
    """
    waves, turns, velocities = _waves(pool, signals), tilts(pool, signals), _velocities(signals)
    if waves is None or not velocities:
        return []
    _, _, sin_yaw, cos_roll, cos_pitch, cos_yaw = waves
    sin_pitch, across, level, north, east = turns
    ahead, aside, below = velocities
    down = pool.product(waves.sin_roll, sin_pitch)
    horizontal = [
        (
            pool.product(cos_pitch, cos_yaw),
            pool.add("-", pool.product(down, cos_yaw), pool.product(cos_roll, sin_yaw)),
            north,
        ),
        (
            pool.product(cos_pitch, sin_yaw),
            pool.add("+", pool.product(down, sin_yaw), pool.product(cos_roll, cos_yaw)),
            east,
        ),
    ]
    found = []
    for row in horizontal:
        parts = [pool.product(turn, velocity) for turn, velocity in zip(row, velocities, strict=True)]
        found.append(pool.add("+", pool.add("+", parts[0], parts[1]), parts[2]))
    vertical = pool.add("+", pool.product(across, aside), pool.product(level, below))
    found.append(pool.add("-", vertical, pool.product(sin_pitch, ahead)))
    for place in found:
        # As short as an input.
        pool.found.setdefault(place, pool.length(0))
    return found


def _velocities(signals: Signals) -> list[int]:
    """The only three states with the unit of a driven place per second that are no rates of the body; else none."""
    turning = () if signals.kinematics is None else signals.kinematics.rates

    def of(unit: str) -> list[int]:
        return [
            i
            for i, state in enumerate(signals.states)
            if state.unit == f"{unit}/s" and state.name not in turning
        ]

    units = dict.fromkeys(signals.states[i].unit for i in signals.driven)
    found = [velocities for unit in units if len(velocities := of(unit)) == 3]
    return found[0] if len(found) == 1 else []


def tilted(pool: Pool, tilt: int, command: int) -> list[int]:
    """The nodes of a command and of its square, times a tilt: each as short as a product of two inputs."""
    nodes = [pool.product(tilt, factor) for factor in (command, pool.product(command, command))]
    for node in nodes:
        pool.found.setdefault(node, pool.length(pool.product(0, command)))
    return nodes


def attitude(pool: Pool, signals: Signals) -> list[int]:
    """Tilts, alone and times each command that has none alike, and the velocity along the earth's axes.

    Of commands that have alike ones, directions are turned.
    """
    found = tilts(pool, signals)
    single = [signals.n_x + group[0] for group in alike_commands(signals) if len(group) == 1]
    pulling = [node for pair in product(found, single) for node in tilted(pool, *pair)]
    return [*found, *pulling, *carried(pool, signals)]
