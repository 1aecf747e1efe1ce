"""A linear model with the names of what its matrices stand for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import NotAvailable


@dataclass(frozen=True, eq=False)
class Linear:
    """dx/dt = A x + B u, or x[k+1] = A x[k] + B u[k], for deviations x and u from a point; C x is the reading.

    After the states of the signals come those of actuators and hidden states: the effect of a command with a lag, a
    hidden state and, in discrete time, delayed commands and earlier states that a late sensor reads.

    Args:
        A: (n, n), in the units of the states and s.
        B: (n, n_u).
        states: names of the n states.
        commands: names of the n_u commands.
        state: the point (n,).
        command: of the point (n_u,).
        drift: the derivative at the point, or the change over a period (n,); 0 at an equilibrium.
        dt: period, s; None in continuous time.
        delays: of each command, s, outside A and B (n_u,); 0 in discrete time, where A and B contain them. They hold
            for all states but those at `at_once`.
        C: (n, n), from states to readings; the identity in continuous time, or if all sensors are on time.
        offsets: delay of each state's readings, s, outside C (n,); 0 in discrete time.
        at_once: places of hidden states that commands fill by themselves, in continuous time: as they are sent.
    """

    A: Floats
    B: Floats
    states: tuple[str, ...]
    commands: tuple[str, ...]
    state: Floats
    command: Floats
    drift: Floats
    dt: float | None
    delays: Floats
    C: Floats
    offsets: Floats
    at_once: tuple[int, ...] = ()

    def to_control(self) -> Any:
        """The same as a state space of python-control.

        Returns:
            A `control.StateSpace` with the names of the states and commands; its outputs are the readings of the
            states.

        Raises:
            NotAvailable: python-control is missing, or time is continuous and a command or a sensor is delayed.
        """
        try:
            import control
        except ImportError as missing:
            raise NotAvailable(
                "python-control: expected the package `control`, found none; install it with `pip install control`."
            ) from missing
        if self.delays.any() or self.offsets.any():
            raise NotAvailable(
                "python-control: expected no delays in continuous time, because it has none, found"
                f" {self.delays.tolist()} s of commands and {self.offsets.tolist()} s of sensors;"
                " linearise with discrete=True, where they are states."
            )
        dt = 0 if self.dt is None else self.dt
        names = list(self.states)
        return control.ss(
            *(self.A, self.B, self.C, np.zeros(self.B.shape), dt),
            states=names,
            inputs=list(self.commands),
            outputs=[f"{name}_out" for name in names],
        )

    def response(self, frequencies: Floats) -> np.ndarray:
        """The frequency response from commands to the readings of the states.

        Args:
            frequencies: (f,), rad/s.

        Returns:
            Complex gains (f, n, n_u), with delays and offsets.
        """
        s = 1j * frequencies
        points = s if self.dt is None else np.exp(s * self.dt)
        inner = points[:, np.newaxis, np.newaxis] * np.eye(len(self.A)) - self.A
        lost = np.exp(-s[:, np.newaxis] * self.delays)
        late = np.exp(-s[:, np.newaxis] * self.offsets)
        driven = self.B * lost[:, np.newaxis, :]
        driven[:, list(self.at_once)] = self.B[list(self.at_once)]
        states = np.linalg.solve(inner, driven)
        return np.asarray((self.C @ states) * late[:, :, np.newaxis])
