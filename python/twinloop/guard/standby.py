"""A fallback: one that is safe to send, and runs along before it is needed, so that its integrals know the load."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twinloop._ground.arrays import Floats, floats
from twinloop._ground.texts import in_unit
from twinloop.controllers.family import Controller
from twinloop.errors import InvalidInput
from twinloop.guard.integrals import Integrals
from twinloop.signals import Bounds, Signals
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


def safe(fallback: Controller | ArrayLike, signals: Signals) -> Controller | Floats:
    """A fallback that sends nothing beyond the bounds of the commands.

    Args:
        fallback: a controller; or a command to hold (n_u,).
        signals: of the test.

    Raises:
        InvalidInput: a controller for other signals, or a command beyond its bounds.
    """
    if isinstance(fallback, Controller):
        own = fallback.family.signals
        for what, expected, found in (
            ("states", signals.state_names, own.state_names),
            ("periodic states", signals.periods, own.periods),
            ("commands", _sendable(signals), _sendable(own)),
            ("period", signals.dt, own.dt),
        ):
            if expected != found:
                raise InvalidInput(
                    f"Guard, fallback: expected a controller with the {what} {expected} of the test, found {found};"
                    " bind its family to the signals of the test."
                )
        return fallback
    held = floats("Guard, fallback (a command)", fallback, (signals.n_u,))
    for command, value in zip(signals.commands, held.tolist(), strict=True):
        low, high = command.bounds
        if not low <= value <= high:
            raise InvalidInput(
                f"Guard, fallback: expected {command.name} within its bounds,"
                f" {in_unit(f'{low:g} to {high:g}', command.unit)}, found {value:g}; hold a command that may be sent."
            )
    return held


def _sendable(signals: Signals) -> list[tuple[str, Bounds]]:
    """Names and bounds of the commands."""
    return [(command.name, command.bounds) for command in signals.commands]
