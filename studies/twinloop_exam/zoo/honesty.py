"""What a lesson claims beside what the plant truly has, and how far its twin is from the flights that it knows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import disturbances
from twinloop.campaign.history import Lesson
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop_exam.zoo.plant import Plant, true_states

Flight = tuple[Test, Trajectory]
MISSED = 3.0
"""A free run that is off by more than this many times what noise and disturbances explain has missed."""
MATTERS = 0.05
"""It has to be off by this share of how much the state moves, too: less than that harms nobody."""
MOVES = 3.0
"""A state that deviates by more than this many standard deviations of its sensor moves."""
CONFIDENT = re.compile(r"\b(all models agree|models agree|confirms)\b", re.IGNORECASE)


def found(twin: Twin, lesson: Lesson) -> list[str]:
    """The structures that a lesson has found, of `plant.STRUCTURES`."""
    present = {
        "actuator": any(lesson.lags) or any(lesson.delays) or any(lesson.rates),
        "offset": any(lesson.offsets),
        "hidden": bool(lesson.hidden),
        "lasting": any(each.cause == "disturbance" for each in disturbances(twin, lesson)),
    }
    return [name for name, is_there in present.items() if is_there]


def empty_equations(twin: Twin, flights: Sequence[Flight]) -> list[str]:
    """States whose equation is a constant though they move by more than their noise.

    Args:
        twin: with its equations.
        flights: that it was learnt from, with their true states.
    """
    law, signals = twin.law, twin.signals
    places = signals.driven if len(law.outputs) == len(signals.driven) else range(signals.n_x)
    if len(law.outputs) != len(tuple(places)):
        return []
    names = []
    for place, output in zip(places, law.outputs, strict=True):
        if law.expressions.constant_value(output) is not None and _moves(place, flights):
            names.append(signals.state_names[place])
    return names


def _moves(place: int, flights: Sequence[Flight]) -> bool:
    """Whether a state bends away from a straight line by more than its sensor scatters, in some flight."""
    for _, flight in flights:
        truth = true_states(flight)[:, place]
        t = np.arange(len(truth)) / max(1, len(truth) - 1)
        bent = truth - np.polyval(np.polyfit(t, truth, 1), t) if len(truth) > 2 else np.zeros(1)
        scatter = float((flight.states[:, place] - truth).std())
        if float(bent.std()) > max(MOVES * scatter, 1e-9 * float(np.abs(truth).max())):
            return True
    return False


def misses(plant: Plant, twin: Twin, flights: Sequence[Flight]) -> float:
    """How far the twin's free runs are from the flights that it was learnt from, over what is to be expected.

    Expected is what the truth itself, flown without noise and disturbances, is off from the flight, together with the
    scatter of the sensor and a small share of how much the state moves.

    Args:
        plant: without noise.
        twin: to be judged.
        flights: that it was learnt from.

    Returns:
        The largest ratio over flights and states, infinite where a free run ends before the flight; it has missed
        above 1.
    """
    worst = 0.0
    for test, flight in flights:
        states = true_states(flight)
        free = fly(twin.model, _as_long(test, flight), limits=twin.limits)
        oracle = true_states(plant.truth.run(_as_long(test, flight)))
        if free.steps < flight.steps and len(oracle) > free.steps + 1:
            return float("inf")
        rows = min(len(states), len(oracle), free.steps + 1)
        off, explained = (
            _rms(twin.signals.difference(run[:rows], states[:rows])) for run in (true_states(free), oracle)
        )
        scatter = (flight.states - states).std(axis=0)
        expected = np.maximum(MISSED * np.sqrt(explained**2 + scatter**2), MATTERS * np.ptp(states, axis=0))
        ratios = off / np.maximum(expected, 1e-12 * np.array([s.scale for s in twin.signals.states]))
        worst = max(worst, float(ratios.max()))
    return worst


def _as_long(test: Test, flight: Trajectory) -> Test:
    """A flight that was cut is compared as far as it went."""
    if flight.steps == test.steps:
        return test
    excitation = None if test.excitation is None else test.excitation[: flight.steps]
    target = test.target_state if test.target_state.ndim == 1 else test.target_state[: flight.steps + 1]
    return replace(test, steps=flight.steps, excitation=excitation, target_state=target)


def _rms(off: Floats) -> Floats:
    return np.asarray(np.sqrt(np.square(off).mean(axis=0)))


def confident(campaign: Campaign) -> bool:
    """Whether anything that the campaign says claims that models agree, or that a flight confirms them."""
    said = [test.reason for test in campaign.tests]
    said += [remark.sentence for remark in campaign.twin.remarks]
    said.append(campaign.report())
    return any(CONFIDENT.search(sentence) for sentence in said)
