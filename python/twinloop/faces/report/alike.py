"""Whether the qualities of campaigns can be compared: only where one quality is minimised on one task."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from twinloop._ground.texts import enumerated, in_unit
from twinloop.campaign.setup import Setup
from twinloop.faces.result import quality_facts
from twinloop.faces.text import counted
from twinloop.faces.text.words import QUALITIES
from twinloop.signals import State

SAME = 1e-9
"""Relative difference up to which weights, starts, targets and durations are the same: decimals that were typed."""


def task_differences(setups: Sequence[Setup]) -> dict[str, list[object]]:
    """By what makes qualities incomparable, what each campaign has; empty where all have the same.

    Args:
        setups: of the campaigns, at least one.
    """
    return {
        question: [words(setup) for setup in setups]
        for question, (same, words) in _ASPECTS.items()
        if not all(same(setups[0], setup) for setup in setups[1:])
    }


def not_comparable(differences: Sequence[str]) -> str:
    """A sentence for a person; empty where the qualities can be compared.

    Args:
        differences: names, as of `task_differences`.
    """
    if not differences:
        return ""
    return f"The qualities of these campaigns cannot be compared: they differ in {enumerated(list(differences))}."


def _close(one: object, other: object) -> bool:
    a, b = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    return a.shape == b.shape and np.allclose(a, b, rtol=SAME, atol=0.0, equal_nan=True)


def _states(setup: Setup) -> list[tuple[str, str]]:
    return [(state.name, state.unit) for state in setup.signals.states]


def _same_counts(one: Setup, other: Setup) -> bool:
    ours, theirs = one.quality, other.quality
    scales = [[command.scale for command in setup.signals.commands] for setup in (one, other)]
    efforts = [(quality.effort, quality.effort_rate) for quality in (ours, theirs)]
    if ours.kind == theirs.kind:
        weights = [ours.weights, theirs.weights]
    else:  # weights of errors and of their squares differ by the scales: that is the kind's difference
        weights = [ours.weights != 0.0, theirs.weights != 0.0]
    return (
        _states(one) == _states(other)
        and _close(*weights)
        and _close(*efforts)
        # Efforts are counted in units of the commands' scales.
        and (not any(efforts[0]) or _close(*scales))
    )


def _at(setup: Setup, state: Sequence[float]) -> str:
    def named(signal: State, value: float) -> str:
        return f"{signal.name} {in_unit(f'{value:.6g}', signal.unit)}"

    return ", ".join(map(named, setup.signals.states, state))


def _target(setup: Setup) -> str:
    end = _at(setup, setup.final_target.tolist())
    return end if setup.target_state.ndim == 1 else f"a reference that ends at {end}"


_ASPECTS: dict[str, tuple[Callable[[Setup, Setup], bool], Callable[[Setup], str]]] = {
    "the kind of quality": (
        lambda one, other: one.quality.kind == other.quality.kind,
        lambda setup: QUALITIES[setup.quality.kind],
    ),
    "what counts in it": (_same_counts, lambda setup: counted(quality_facts(setup.quality))),
    "the start": (
        lambda one, other: _states(one) == _states(other) and _close(one.initial_state, other.initial_state),
        lambda setup: _at(setup, setup.initial_state.tolist()),
    ),
    "the target": (
        lambda one, other: _states(one) == _states(other) and _close(one.target_state, other.target_state),
        _target,
    ),
    "the duration": (
        lambda one, other: _close(one.steps * one.signals.dt, other.steps * other.signals.dt),
        lambda setup: f"{setup.steps * setup.signals.dt:.6g} s",
    ),
}
