"""Declared: derivatives and body rates, held against what the records show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import cos, sin
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, serious
from twinloop.signals import RigidBody, Signals
from twinloop.trajectory import Trajectory

MOVED = 20.0
"""Standard deviations of its noise that a state must have moved before it is held against its derivative."""
BENT = 5.0
"""The same about a line, which is all that a biased rate adds."""
WALKED = 3.0
"""Standard deviations of the random walk, which noise becomes when a rate is integrated, that this must have moved."""
AS_FAST = (0.5, 2.0)
"""Times as fast as its derivative says, between which a state is taken to do what was declared."""
ALIKE = 0.5
"""Correlation with its integrated derivative below which a state is taken to do something else."""
AS_A_BODY = 0.25
"""Share of their deviation from integrated derivatives that three angles have at most if body rates turn them."""
STEEP = 0.1
"""Cosine of a pitch below which its angles say little of body rates."""


def against_derivatives(recorded: Sequence[Trajectory], signals: Signals) -> Iterator[Remark]:
    """States that do not change as their declared derivatives say.

    Args:
        recorded: runs, periodic states among them as they were wrapped.
        signals: of the system.
    """
    runs = [Run.of(run.states, run.commands) for run in recorded]
    noise = guessed_noise(runs, np.array([state.scale for state in signals.states]))
    body = _as_a_body(runs, signals, noise)
    if body is not None:
        yield _turns(body)
    for i, rate in enumerate(signals.states):
        if rate.derivative_of is None or (body is not None and rate.name in body.rates):
            continue
        j = signals.state_names.index(rate.derivative_of)
        pairs = [_moved(run.states[:, j], run.states[:, i], signals.dt) for run in runs]
        # Integrated, white noise is a random walk: about its line it has a fifteenth of its last variance.
        walks = sum(float(noise[i]) * (signals.dt * run.steps) ** 2 / 15.0 for run in recorded)
        how = _against(
            [tuple(map(_without_line, pair)) for pair in pairs], BENT**2 * noise[j], WALKED**2 * walks
        )
        if how is None:
            how = _against(pairs, MOVED**2 * noise[j], 0.0)
        if how:
            yield serious(
                "derivative",
                f"{rate.derivative_of} {how} {rate.name}, its declared derivative, says: check their units and signs,"
                " the order of the columns, and what is declared.",
            )


def _against(pairs: Sequence[tuple[Floats, ...]], least: float, least_declared: float) -> str | None:
    """How states contradict what their derivatives say: "" if they do not, None if they moved too little to tell.

    Args:
        pairs: of each run, the state and the same by its derivative.
        least: mean square that the state must have.
        least_declared: sum of squares that its integrated derivative must have.
    """
    moved, declared = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    size, declared_size, product = (
        float(values.sum()) for values in (np.square(moved), np.square(declared), moved * declared)
    )
    if size <= len(moved) * least or declared_size <= least_declared:
        return None
    if product * product < ALIKE * ALIKE * size * declared_size:
        return "does not change as"
    if not AS_FAST[0] * declared_size < product < AS_FAST[1] * declared_size:
        return f"changes {product / declared_size:.3g} times as fast as"
    return ""


def _moved(state: Floats, rate: Floats, dt: float) -> tuple[Floats, Floats]:
    """A state over a run, and the same by its derivative, each less its mean."""
    said = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
    return state - state.mean(), said - said.mean()


def _without_line(values: Floats) -> Floats:
    """Values less their regression on a constant and time (n,)."""
    time = np.arange(len(values)) - 0.5 * (len(values) - 1)
    rest: Floats = values - values.mean()
    return rest - time * (float((time * rest).sum()) / max(float(np.square(time).sum()), 1.0))


def _as_a_body(runs: Sequence[Run], signals: Signals, noise: Floats) -> RigidBody | None:
    """Three angles that body rates turn, though these were declared as their derivatives; None where none are.

    They turn at different rates wherever a roll or a pitch is large, so it is a flight with such angles that tells.
    """
    index = signals.state_names.index
    pairs = [
        (index(rate.derivative_of), i)
        for i, rate in enumerate(signals.states)
        if rate.derivative_of is not None
        and (rate.unit, signals.states[index(rate.derivative_of)].unit) == ("rad/s", "rad")
    ]
    if signals.kinematics is not None or len(pairs) < 3:
        return None
    best = min(
        permutations(pairs, 3), key=lambda three: float(_off(runs, three, signals.dt, noise, True).sum())
    )
    declared, turned = (_off(runs, best, signals.dt, noise, body) for body in (False, True))
    if not (declared > BENT**2).any() or turned.sum() > AS_A_BODY * declared.sum():
        return None
    names = signals.state_names
    return RigidBody([names[angle] for angle, _ in best], [names[rate] for _, rate in best])


def _off(
    runs: Sequence[Run], three: Sequence[tuple[int, int]], dt: float, noise: Floats, body: bool
) -> Floats:
    """How far three angles deviate from their integrated rates, squared, over what noise explains of it (3,).

    Args:
        runs: recorded.
        three: places of each angle and its rate; as a body's, roll, pitch and yaw.
        dt: period, s.
        noise: variance of each sensor.
        body: whether the rates are a body's; otherwise they are the angles' derivatives.
    """
    angles, rates = ([pair[k] for pair in three] for k in (0, 1))
    off, explained = np.zeros(3), np.zeros(3)
    for run in runs:
        said = _turning(run.states[:, angles], run.states[:, rates]) if body else run.states[:, rates]
        for k in range(3):
            moved, by_rate = _moved(run.states[:, angles[k]], said[:, k], dt)
            off[k] += float(np.square(_without_line(moved - by_rate)).sum())
        # Integrated, white noise is a random walk: about its line it has a fifteenth of its last variance.
        explained += len(run.states) * (noise[angles] + noise[rates] * dt * dt * len(run.states) / 15.0)
    return off / explained


def _turning(angles: Floats, rates: Floats) -> Floats:
    """Rates of roll, pitch and yaw of a body with these angles and body rates (n, 3); z, then y, then x."""
    roll, pitch, _ = angles.T
    p, q, r = rates.T
    steep = cos(pitch)
    steep = np.where(np.abs(steep) < STEEP, np.where(steep < 0.0, -STEEP, STEEP), steep)
    across = q * sin(roll) + r * cos(roll)
    return np.stack([p + across * sin(pitch) / steep, q * cos(roll) - r * sin(roll), across / steep], axis=1)


def _turns(body: RigidBody) -> Remark:
    return serious(
        "body-rates",
        f"{', '.join(body.rates)} are not the derivatives of {', '.join(body.angles)}, as was declared: these turn as"
        " the angles of a rigid body whose body rates they are. Declare that instead: kinematics ="
        f" RigidBody(angles={body.angles}, rates={body.rates}), without derivative_of.",
    )
