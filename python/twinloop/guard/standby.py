"""A fallback that runs along before it is needed, so that its integrals know the load when it takes over."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop.controllers.family import Controller
from twinloop.guard.integrals import Integrals
from twinloop.test import Test

WAITING = 100
"""Readings, at most, that wait until a sensor that repeats itself has moved again."""


class Standby:
    """A fallback that sees the readings of the flight, with its answers discarded until it is asked to command.

    A reading that equals the one before may come from a frozen sensor. It waits until the sensor moves; if it never
    does, the errors of the frozen state are not integrated.

    Args:
        controller: the fallback.
        test: that is flown until then.
    """

    def __init__(self, controller: Controller, test: Test) -> None:
        self.controller = controller
        self.signals = test.family.signals
        self._integrals = Integrals(test, controller)
        self.reset()

    def reset(self) -> None:
        """Back to the start of a flight."""
        self.controller.reset()
        self._integrals.reset()
        self._waiting: deque[tuple[Floats, Floats]] = deque()
        self._repeated = np.zeros(self.signals.n_x, np.int64)
        self._last = np.full(self.signals.n_x, np.nan)
        self._cold = False

    def follow(self, reading: Floats, target: Floats) -> None:
        """Runs along for a period that the test's controller commands.

        Args:
            reading: that can be trusted (n_x,), SI units, radians.
            target: (n_x,), the same units.
        """
        self._repeated = np.where(reading == self._last, self._repeated + 1, 0)
        self._last = reading.copy()
        self._waiting.append((self._last, target.copy()))
        while len(self._waiting) > min(int(self._repeated.max()), WAITING):
            self._see(*self._waiting.popleft())

    def command(self, reading: Floats, target: Floats, broken: NDArray[np.bool_]) -> Floats:
        """The command for the coming period.

        Args:
            reading: (n_x,), SI units, radians; what is believed instead of a reading that cannot be trusted.
            target: (n_x,), the same units.
            broken: states (n_x,) whose sensor cannot be trusted.

        Returns:
            Command (n_u,), within its bounds.

        Raises:
            Exception: what the fallback raises, if it is a controller in Python.
        """
        while self._waiting:
            frozen = broken & (self._repeated >= len(self._waiting))
            self._see(*self._waiting.popleft(), frozen)
        if self._cold:
            self.controller.reset()
            self._cold = False
        return self.controller.command(reading, target)

    def _see(self, reading: Floats, target: Floats, frozen: NDArray[np.bool_] | None = None) -> None:
        """Runs the fallback for a period; one in Python that fails begins from rest when it takes over."""
        if self._cold:
            return
        try:
            self.controller.command(reading, self._integrals.target(reading, target, frozen))
        except Exception:
            self._cold = True
