"""Committees: how well candidates fly on every member, and where members disagree, beside NumPy over all at once."""

from collections.abc import Callable
from typing import Any

import numpy as np

import loop
from measure import Line, Section, check_agreement, interleaved, ratio
from twinloop import _core

CANDIDATES, MEMBERS, DRAWS = 96, 8, 4
DAMPING, EFFORT, CAP = -0.5, 0.1, 100.0
HALF_WIDTH, SD = 40.0, 0.01
TARGET = np.deg2rad([-30.0, 30.0, -70.0, 0.0, 0.0, 0.0])
OURS, NUMPY = "twinloop", "NumPy, a step for all flights"


def member(weights: np.ndarray) -> _core.Model:
    """Angular accelerations: damping, and weights (3, 4) on the squares of the rotor speeds."""
    lines = []
    for axis in range(3):
        lines.append(f"r{10 + axis} = r{3 + axis} * {DAMPING!r}")
        for rotor in range(4):
            lines += [f"r13 = r{6 + rotor} * r{6 + rotor}", f"r13 = r13 * {float(weights[axis, rotor])!r}"]
            lines.append(f"r{10 + axis} = r{10 + axis} + r13")
    text = "program inputs=10 outputs=3 registers=14\npage 1\n" + "\n".join(lines) + "\n"
    return _core.Model(_core.Program.parse(text), "acceleration", loop.SIGNALS)


def flown(weights: np.ndarray, gains: np.ndarray, noise: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """States (members, draws, K, n + 1, 6) and commands in units of hovering (…, n, 4)."""
    draws = 1 if noise is None else len(noise)
    shape = (len(weights), draws, len(gains))
    states, commands = np.zeros((*shape, loop.STEPS + 1, 6)), np.empty((*shape, loop.STEPS, 4))
    integral, state = np.zeros((*shape, 3)), np.zeros((*shape, 6))
    p, i, d = gains[:, 0::3], gains[:, 1::3], gains[:, 2::3]

    def slope(state: np.ndarray, squares: np.ndarray) -> np.ndarray:
        pushed = np.einsum("mar,mdkr->mdka", weights, squares)
        return np.concatenate([state[..., 3:], DAMPING * state[..., 3:] + pushed], axis=-1)

    for k in range(loop.STEPS):
        reading = state if noise is None else state + noise[:, k][:, None]
        error = TARGET[:3] - reading[..., :3]
        integral += error * loop.DT
        asked = (p * error + i * integral - d * reading[..., 3:]) @ loop.MATRIX.T + loop.OFFSET
        sent = np.clip(np.sign(asked) * np.sqrt(np.abs(asked)), *loop.BOUNDS) / loop.HOVER
        commands[..., k, :], squares = sent, sent * sent
        first = slope(state, squares)
        second = slope(state + 0.5 * loop.DT * first, squares)
        third = slope(state + 0.5 * loop.DT * second, squares)
        fourth = slope(state + loop.DT * third, squares)
        state = state + loop.DT / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        states[..., k + 1, :] = state
    return states, commands


def qualities(weights: np.ndarray, gains: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    states, commands = flown(weights, gains, noise)
    errors = loop.DT * np.abs(states[..., 1:, :] - TARGET).sum(axis=(-2, -1))
    return errors + EFFORT * loop.DT * np.square(commands).sum(axis=(-2, -1)), np.abs(states).max(
        axis=(-2, -1)
    ) / HALF_WIDTH


def disagreements(weights: np.ndarray, gains: np.ndarray) -> np.ndarray:
    states = flown(weights, gains, None)[0][:, 0, :, 1:] / SD
    off = (
        np.clip(states - states.mean(axis=0), -CAP, CAP).reshape(len(weights), len(gains), -1).swapaxes(0, 1)
    )
    return np.linalg.slogdet(np.eye(len(weights)) + off @ off.swapaxes(1, 2))[1]


def report(smoke: bool) -> Section:
    count = 12 if smoke else CANDIDATES
    section = Section(f"Committees: {count} flights of {loop.STEPS} steps on {MEMBERS} members")
    rng = np.random.default_rng(3)
    # What each rotor turns, in rad/s² at hovering, differs by up to a tenth.
    turned = np.linalg.pinv(loop.MATRIX)
    weights = 60.0 * turned / np.abs(turned).max() * rng.uniform(0.9, 1.1, (MEMBERS, 3, 4))
    good = np.array([0.03, 0.004, 0.024] * 2 + [0.052, 0.004, 0.0416])
    gains = good * rng.uniform(0.5, 1.5, (count, 9))
    noise = rng.normal(0.0, 1e-3, (DRAWS, loop.STEPS + 1, 6))
    members, workers = [member(one) for one in weights], _core.Workers(1)
    flights = _core.Flights(loop.FAR, gains, np.zeros((count, 6)), np.tile(TARGET, (count, 1)), loop.STEPS)
    quality = _core.Quality("iae", np.ones(6), effort=EFFORT)
    envelope = [(-HALF_WIDTH, HALF_WIDTH)] * 6
    cases: dict[str, dict[str, Callable[[], Any]]] = {
        f"qualities, {DRAWS} draws of noise": {
            OURS: lambda: _core.qualities(members, flights, quality, envelope, noise=noise, workers=workers),
            NUMPY: lambda: qualities(weights, gains, noise),
        },
        "disagreement": {
            OURS: lambda: _core.disagreements(members, flights, np.full(6, SD), cap=CAP, workers=workers)[:1],
            NUMPY: lambda: (disagreements(weights, gains),),
        },
    }
    for case, contestants in cases.items():
        for ours, theirs in zip(contestants[OURS](), contestants[NUMPY](), strict=True):
            check_agreement(case, ours, theirs)
        times = interleaved(contestants, 3 if smoke else 21, at_least=0.0 if smoke else 0.02)
        flown_in = MEMBERS * count * loop.STEPS * (DRAWS if "noise" in case else 1)
        for name in contestants:
            figure = float(np.median(times[name])) * 1e9 / flown_in
            against = ratio(times, name, OURS) if name != OURS else None
            section.lines.append(Line(case, name, figure, "ns per step and flight", against))
    return section
