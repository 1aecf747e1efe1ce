"""Errors that a fallback with other gains is given to integrate, so that it takes over the load and no swing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import product
from twinloop.controllers.family import Controller
from twinloop.controllers.riccati import solve_linear
from twinloop.controllers.state_feedback import FeedbackFamily
from twinloop.test import Test

RIDGE = 1e-10
"""Share of the summed squares of integral gains that is added, for integrals that act on commands alike."""


class Integrals:
    """The integrals of a fallback, made to command what those of the test's controller command and have done for long.

    An integral learns the load, but in a swing it also follows the error of the moment. What a fallback with other
    gains takes over is the value nearest to zero of the last integral time (K_P / K_I) of the fallback: a fallback
    that began from rest would have needed about as long to find the load by itself. With the same gains, or with a
    controller of another family, it integrates the errors of the flight.

    Args:
        test: that is flown until the fallback takes over.
        fallback: that shall.
    """

    def __init__(self, test: Test, fallback: Controller) -> None:
        self.signals = test.family.signals
        self._scales = np.zeros((self.signals.n_x, self.signals.n_x))
        self._changed = np.zeros(self.signals.n_x, bool)
        self._past: dict[int, Floats] = {}
        # Gains of another family are no measure for this one's: its mixer or its filters may be others.
        if fallback.family is test.family:
            if isinstance(test.family, FeedbackFamily):
                self._feedback(test.family, test, fallback)
            else:
                self._axes(test, fallback)
        self.reset()

    def reset(self) -> None:
        """Back to the start of a flight."""
        self._period = 0
        self._integral = np.zeros(self.signals.n_x)
        self._lasting = np.zeros(self.signals.n_x)
        for past in self._past.values():
            past[:] = 0.0

    def target(self, reading: Floats, target: Floats, frozen: NDArray[np.bool_] | None) -> Floats:
        """The target that leads to the errors to be integrated; readings stay, for derivatives need them.

        Args:
            reading: (n_x,), SI units, radians.
            target: (n_x,), the same units.
            frozen: states (n_x,) whose errors are not integrated; None: all of them are.

        Returns:
            Target (n_x,), the same units.
        """
        errors = self.signals.difference(target, reading)
        if frozen is not None:
            errors[frozen] = 0.0
            target = np.where(frozen, reading, target)
        if not self._changed.any():
            return target
        steps = product(self._scales, errors[:, np.newaxis])[:, 0] * self.signals.dt
        if frozen is not None:
            steps[frozen] = 0.0
        self._integral += steps
        asked = np.zeros(self.signals.n_x)
        for i, past in self._past.items():
            past[self._period % len(past)] = self._integral[i]
            lasting = np.clip(0.0, past.min(), past.max())
            asked[i] = (lasting - self._lasting[i]) / self.signals.dt
            self._lasting[i] = lasting
        self._period += 1
        for i, period in self.signals.periods:
            # From half a turn on an error would be taken the other way round.
            asked[i] = np.clip(asked[i], -0.49 * period, 0.49 * period)
        return np.where(self._changed, reading + asked, target)

    def _axes(self, test: Test, fallback: Controller) -> None:
        """Of a PID or a cascade."""
        own, other = test.family.parameters(test.genes), fallback.parameters
        place = {name: i for i, name in enumerate(self.signals.state_names)}
        outer = None
        for name in own:
            # A law in Python has names without a dot, and no integrals that are known.
            state, _, term = name.rpartition(".")
            if term == "kp" and f"{state}.ki" not in own:
                outer = state
            if term != "ki" or other[name] == 0.0:
                continue
            i, ratio = place[state], own[name] / other[name]
            same = own[name] == other[name]
            if outer is not None:
                # The set point of a cascade's rate is the outer loop's: the error of the rate is given as a whole.
                angle, gain = place[outer], f"{outer}.kp"
                same = same and own[gain] == other[gain]
                if not same:
                    self._scales[i, angle], self._changed[angle] = ratio * own[gain], True
            if not same:
                self._scales[i, i] = ratio
                self._lasts(i, abs(other[f"{state}.kp"] / other[name]), test)

    def _feedback(self, family: FeedbackFamily, test: Test, fallback: Controller) -> None:
        """Of a state feedback, whose outputs may each have a part of every integral."""
        names = self.signals.state_names
        states, integrals = (
            [names.index(name) for name in some] for some in (family.states, family.integral)
        )
        own, other = (
            np.reshape(list(each.values()), (-1, len(states) + len(integrals)))
            for each in (family.parameters(test.genes), fallback.parameters)
        )
        of_test, of_fallback = own[:, len(states) :], other[:, len(states) :]
        if not of_fallback.any() or np.array_equal(of_test, of_fallback):
            return
        ridge = RIDGE * float(np.square(of_fallback).sum()) * np.eye(len(integrals))
        scales = solve_linear(product(of_fallback.T, of_fallback) + ridge, product(of_fallback.T, of_test))
        if scales is not None:
            self._scales[np.ix_(integrals, integrals)] = scales
        for i, gains in zip(integrals, of_fallback.T, strict=True):
            proportional = other[:, states.index(i)] if i in states else np.zeros(len(other))
            size = float(np.square(gains).sum())
            self._lasts(i, math.sqrt(float(np.square(proportional).sum()) / size) if size else math.inf, test)

    def _lasts(self, i: int, seconds: float, test: Test) -> None:
        """Has the integral of a state transferred as far as it lasted for so long; for longer than the test: not."""
        self._changed[i] = True
        periods = np.ceil(seconds / self.signals.dt)
        if periods <= test.steps:
            self._past[i] = np.zeros(max(1, int(periods)))
