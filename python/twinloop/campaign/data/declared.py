"""Declared: derivatives and body rates, held against what the records show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import permutations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.data.integrated import (
    BENT,
    MOVED,
    WALKED,
    contradiction,
    cuts,
    in_spite_of_drift,
    moved,
    walk,
    without_line,
)
from twinloop.campaign.data.turning import Turned, contradictions, cures, turning
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, serious
from twinloop.signals import RigidBody, Signals
from twinloop.trajectory import Trajectory

SEEN = 0.02
"""Share of its scale that a state moves at least if it contradicts a constant sensor: less may be rounded away."""
AS_A_BODY = 0.25
"""Share of their deviation from integrated derivatives that three angles have at most if body rates turn them."""


def against_derivatives(recorded: Sequence[Trajectory], signals: Signals) -> Iterator[Remark]:
    """States that do not change as their declared derivatives say.

    Args:
        recorded: runs, periodic states among them as they were wrapped.
        signals: of the system.
    """
    runs = [Run.of(run.states, run.commands).continued(signals) for run in recorded]
    noise = guessed_noise(runs, np.array([state.scale for state in signals.states]))
    body = _as_a_body(runs, signals, noise)
    if body is not None:
        yield _turns(body)
    yield from _of_a_body(runs, signals, noise)
    for i, rate in enumerate(signals.states):
        if rate.derivative_of is None or (body is not None and rate.name in body.rates):
            continue
        j = signals.state_names.index(rate.derivative_of)
        how = _beside_a_constant(runs, (j, i), signals, noise)
        if how is None:
            (how,) = in_spite_of_drift(partial(_of_derivative, runs, (j, i), signals.dt, noise))
        if how:
            yield serious(
                "derivative",
                f"{rate.derivative_of} {how} {rate.name}, its declared derivative, says: check their units and signs,"
                " the order of the columns, and what is declared.",
            )


def _of_derivative(
    runs: Sequence[Run], of: tuple[int, int], dt: float, noise: Floats, pieces: int
) -> list[str | None]:
    """How a state contradicts its derivative, the places of both being given, where runs are cut into pieces."""
    j, i = of
    cut = [run.states[part] for run in runs for part in cuts(len(run.states), pieces)]
    pairs = [moved(states[:, j], states[:, i], dt) for states in cut]
    walks = sum(float(walk(noise[i], dt, len(states) - 1)) for states in cut)
    bent = [tuple(map(without_line, pair)) for pair in pairs]
    how = contradiction(bent, BENT * BENT * noise[j], WALKED * WALKED * walks)
    return [contradiction(pairs, MOVED * MOVED * noise[j], 0.0) if how is None else how]


def _beside_a_constant(
    runs: Sequence[Run], of: tuple[int, int], signals: Signals, noise: Floats
) -> str | None:
    """How a state contradicts its derivative where one of them is constant in all runs; None where neither is.

    A constant derivative moves its state along a line: only what the state does beside one contradicts it.
    """
    j, i = of
    on = [run.states for run in runs]
    constant = [all(np.ptp(states[:, place]) == 0.0 for states in on) for place in of]
    if not any(constant):
        return None
    pairs = [moved(states[:, j], states[:, i], signals.dt) for states in on]
    other = 1 if constant[0] else 0
    size = float(np.square(np.concatenate([without_line(pair[other]) for pair in pairs])).mean())
    walks = sum(float(walk(noise[i], signals.dt, len(states) - 1)) for states in on)
    rows = sum(len(states) for states in on)
    scatter = WALKED * WALKED * walks / rows if constant[0] else MOVED * MOVED * float(noise[j])
    least = SEEN * signals.states[j].scale
    return "does not change as" if size > max(least * least, scatter) else ""


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
    if not (declared > BENT * BENT).any() or turned.sum() > AS_A_BODY * declared.sum():
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
        said = turning(run.states[:, angles], run.states[:, rates]) if body else run.states[:, rates]
        for k in range(3):
            by_angle, by_rate = moved(run.states[:, angles[k]], said[:, k], dt)
            off[k] += float(np.square(without_line(by_angle - by_rate)).sum())
        explained += len(run.states) * noise[angles] + walk(noise[rates], dt, len(run.states))
    return off / explained


def _turns(body: RigidBody) -> Remark:
    angles, rates = (", ".join(f'"{name}"' for name in names) for names in (body.angles, body.rates))
    return serious(
        "body-rates",
        f"{', '.join(body.rates)} are not the derivatives of {', '.join(body.angles)}, as was declared, but body rates"
        " that turn these angles of a rigid body. Remove derivative_of from them, and declare the body: in a campaign"
        f" file a table [kinematics] with angles = [{angles}] and rates = [{rates}]; in Python"
        f" kinematics=RigidBody(angles={body.angles}, rates={body.rates}). A store that was begun keeps its signals:"
        " begin a new one, and tell or attach the same logs there.",
    )


def _of_a_body(runs: Sequence[Run], signals: Signals, noise: Floats) -> Iterator[Remark]:
    """Angles that do not turn as the declared body rates say."""
    body = signals.kinematics
    if body is None:
        return
    angles, rates = (
        [signals.state_names.index(name) for name in names] for names in (body.angles, body.rates)
    )
    flown = [Turned(run.states[:, angles], run.states[:, rates], signals.dt) for run in runs]
    hows = contradictions(flown, noise[angles], noise[rates])
    wrong = [
        (angle, rate, how) for angle, rate, how in zip(body.angles, body.rates, hows, strict=True) if how
    ]
    if wrong:
        sentence = "; ".join(f"{angle} {how} the body rates say, mainly {rate}" for angle, rate, how in wrong)
        ways = cures(flown, noise[angles], noise[rates], body)
        yield serious(
            "kinematics",
            f"{sentence}: check their signs and units, the order of the columns, and what the kinematics declare."
            + (f" They would agree {', or '.join(ways)}." if ways else ""),
        )
