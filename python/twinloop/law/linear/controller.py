"""A controller around its rest: realised from how it answers a small departure, so that each law is written once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.controllers import Family
from twinloop.errors import NotAvailable

HORIZON = 12
"""Periods of a departure's answer from which the memory is read; no law remembers in more independent ways."""
NUDGE = 1e-5
"""Share of a state's scale by which it departs."""
SMOOTH = 1e-3
"""Share by which an answer may change when the departure is turned round and halved."""
ROUNDING = 1e-6
"""Share of an answer below which a memory is rounding."""


@dataclass(frozen=True, eq=False)
class LinearController:
    """m[k+1] = A m[k] + B x[k], u[k] = C m[k] + D x[k], for departures x of the state and u of the commands.

    Args:
        A: (m, m), of a memory in no particular units.
        B: (m, n_x).
        C: (n_u, m).
        D: (n_u, n_x).
        rest: commands where the state is at its target (n_u,), in their units.
        dt: period, s.
    """

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    rest: Floats
    dt: float

    def response(self, frequencies: Floats) -> np.ndarray:
        """From the state to the commands.

        Args:
            frequencies: (f,), rad/s.

        Returns:
            Complex gains (f, n_u, n_x).
        """
        points = np.exp(1j * frequencies * self.dt)
        inner = points[:, np.newaxis, np.newaxis] * np.eye(len(self.A)) - self.A
        return np.asarray(self.C @ np.linalg.solve(inner, self.B.astype(complex)) + self.D)


def linear_controller(family: Family, genes: Floats, target: Floats) -> LinearController:
    """A controller around the state that it leads to (Ho and Kalman 1966).

    Args:
        family: of the controller.
        genes: its gains (size,).
        target: state that it leads to (n_x,).

    Returns:
        The linear controller with the fewest memories.

    Raises:
        NotAvailable: a controller that has no slope at rest, such as one that rests on a bound of a command.
    """
    rest = family.controller(genes).command(target, target)
    up, down, near = (_answers(family, genes, target, share) for share in (NUDGE, -NUDGE, -0.5 * NUDGE))
    answers = 0.5 * (up + down)
    scales = np.array([state.scale for state in family.signals.states])
    size = float(np.abs(answers * scales).max())
    if np.abs((up - near) * scales).max() > SMOOTH * size:
        raise NotAvailable(
            "Linear analysis: expected a controller with a slope where it rests, found one whose commands there are"
            " at a bound or begin with a root of 0; move the bounds, or give its Mixer an offset."
        )
    # Blocks of a Hankel matrix: what is answered i + j + 1 periods after a departure.
    n_u, n_x = answers.shape[1:]
    reach = HORIZON // 2
    hankel, shifted = (
        np.block([[answers[i + j + first] for j in range(reach)] for i in range(reach)]) for first in (1, 2)
    )
    weights = np.tile(scales, reach)
    left, sizes, right = np.linalg.svd(hankel * weights)
    order = int((sizes > ROUNDING * max(size, 1e-300)).sum())
    root = np.sqrt(sizes[:order])
    left, right = left[:, :order], right[:order]
    A = (left / root).T @ (shifted * weights) @ (right.T / root)
    B = (root[:, np.newaxis] * right)[:, :n_x] / scales
    C = (left * root)[:n_u]
    return LinearController(A, B, C, answers[0], rest, family.signals.dt)


def _answers(family: Family, genes: Floats, target: Floats, share: float) -> Floats:
    """Commands in each period after one in which a state departed, by its unit (periods, n_u, n_x)."""
    signals = family.signals
    found = np.empty((HORIZON + 1, signals.n_u, signals.n_x))
    for i, state in enumerate(signals.states):
        controller = family.controller(genes)
        rest = controller.command(target, target)
        departed = target.copy()
        departed[i] += share * state.scale
        run = [controller.command(x, target) for x in [departed, *[target] * HORIZON]]
        found[:, :, i] = (np.array(run) - rest) / (share * state.scale)
    return found
